"""A certificate examined again, from code and for the command: `tubecert recheck`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from tubecert import asking
from tubecert.asking import Number
from tubecert.certificate.file import FORMAT, KIND, incomplete, parse, unreadable
from tubecert.errors import ExitCode, TargetError
from tubecert.files import STDIN, read, read_stdin
from tubecert.findings import Finding
from tubecert.library.shown import Shown
from tubecert.printable import json_text, visible
from tubecert.progress import Phase, Progress, Step
from tubecert.recheck import document
from tubecert.recheck.certificate import opened, read_result
from tubecert.recheck.run import BUDGET, Examined, Recheck, Report
from tubecert.recheck.run import recheck as examined
from tubecert.records import FormError
from tubecert.report.page import Page
from tubecert.report.progress import timed
from tubecert.report.rechecked import page_of
from tubecert.report.text import Rows

if TYPE_CHECKING:  # of the producer, which takes longer to import than many certificates to examine
    from tubecert.library.specification import File, Specifiable
    from tubecert.library.stated import Stated


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Rechecked(Shown):
    """What the second arithmetic says of a certificate: `found` has every claim and its outcome.

    `belongs` says that it is of the specification that was given, if one was.
    """

    found: Recheck = field(repr=False)
    name: str
    belongs: str = ""
    alone = True

    @property
    def confirmed(self) -> bool:
        """Whether the certificate says `certified` and every claim of it is confirmed."""
        return self.found.exit_code is ExitCode.CERTIFIED

    @property
    def verdict(self) -> str:
        """`confirmed`, `contradicted` or `undecided`: of what the certificate says, whatever its verdict is."""
        return self.found.verdict

    @property
    def claims(self) -> tuple[Examined, ...]:
        """Every claim: its `name` and its `outcome`."""
        return self.found.claims

    @property
    def first_failing(self) -> Examined | None:
        """The first claim that is contradicted, else the first that is undecided."""
        return self.found.failing

    def _page(self) -> Page:
        return page_of(self.found, self.name, self.belongs)

    def _closing(self) -> Rows:
        report = f"tubecert report {shlex.quote(self.name)}"
        return [("more", f"-v here; {report}: what is certified, as a page with figures")]

    def _json(self) -> str:
        claims = [
            {"claim": each.name, "verdict": each.outcome.verdict, "why": each.outcome.why, "boxes": each.outcome.boxes}
            for each in self.claims
        ]  # fmt: skip
        data = {
            "certificate": self.name,
            "verdict": self.verdict,
            "stated": self.found.stated,
            "hash": self.found.hash,
            "claims": claims,
            "first_failing": None if self.first_failing is None else self.first_failing.name,
            "not_examined": list(self.found.unread),
            **({"specification": self.belongs} if self.belongs else {}),
        }
        return json_text(data)

    @property
    def _exit_code(self) -> ExitCode:
        return self.found.exit_code


@asking.question({
    "result": replace(asking.CERTIFICATE, help="A certificate (JSON); - is stdin."),
    "spec": asking.Kind("Also: that the certificate is of this specification.", "SPEC"),
    "budget": asking.Exact("Boxes examined per claim before giving up.  [200000]", whole=True),
    "deadline": asking.Seconds("Seconds after which what is not proven is undecided."),
    "controller": asking.Text("Also: that what export wrote there is of the certificate.", "FOLDER"),
})  # fmt: skip
def recheck(
    result: Stated[Any] | File,
    *,
    spec: Specifiable | None = None,
    budget: int | None = None,
    deadline: Number | None = None,
    controller: File | None = None,
    progress: Progress | None = None,
) -> Rechecked:
    """Verify every claim of a certificate again: in ball arithmetic, with derivatives of its own, without a solver.

    `result`: the certificate, or its file. `spec`: also that it is of this specification (else TC604 is raised).
    `budget`: boxes per claim before giving up; what is not proven `deadline` s from now is undecided. `controller`: a
    folder that `export` wrote, whose code and numbers are compared with the certificate of a sampled loop. Raises
    `TubecertError` for what is no certificate, and for a folder that cannot be read.
    """
    if isinstance(text := getattr(result, "text", None), str):
        name = str(getattr(result, "name", ""))
    else:
        name = asking.text_of("result", result)
        text = _text_of(name)
    note = "" if spec is None else _specified(text, name, spec)
    if controller is not None:
        _require_folder(os.fspath(controller))
    shown, line = timed(progress), asking.hears(progress, "found")
    found = examined(
        text,
        name,
        budget or BUDGET,
        None if shown is None else _told(shown),
        seconds=None if deadline is None else float(deadline),
        heard=None if line is None else partial(_heard, line),
    )
    if controller is not None:
        found = _with_controller(found, text, name, os.fspath(controller))
    return Rechecked(found=found, name=name, belongs=note)


def _specified(text: str, name: str, spec: Specifiable) -> str:
    """A sentence that says that the certificate is of the specification; raises TC604 if it is not."""
    from tubecert.library import sampled
    from tubecert.library.specification import spec_of
    from tubecert.sampled_loop import record

    if parse(text.encode(), name, (FORMAT, record.FORMAT))["format"] != record.FORMAT:
        return belongs(document.read(text, name), name, spec)
    loaded = spec_of(spec)
    found = sampled.compared(loaded, record.read(text, name).result)
    found.require(loaded, name)
    return found.words(loaded.path)


def belongs(root: document.Node, name: str, spec: Specifiable) -> str:
    """The same of the certificate of a loop that rests on a metric."""
    from tubecert.certificate.belonging import compared
    from tubecert.certificate.result import Result
    from tubecert.library.specification import spec_of

    read_result(opened(root)[0])  # its form: what is compared below is there, and is what is examined
    loaded = spec_of(spec)
    try:
        result = Result.from_json(root.mapping()["result"])
    except FormError as error:
        raise incomplete(name, str(error)) from error
    found = compared(loaded, result)
    found.require(loaded, name)
    return found.words(loaded.path)


def _with_controller(found: Recheck, text: str, name: str, folder: str) -> Recheck:
    """The same, after the claims of a folder of exported code: what was asked for is on the first screen.

    Raises `CertificateError` for the certificate of a loop in continuous time.
    """
    from tubecert.recheck.sampled_loop.exported import exported

    own = document.read(text, name)
    if own.mapping()["format"] != document.SAMPLED_LOOP:
        help = f"leave {asking.named('controller')} out, or give the certificate of a specification with hardware"
        raise document.wrong("TC601", f"{name} is about a loop in continuous time, which has no code", help)
    more = (Examined(*each) for each in exported(own, folder))
    return replace(found, claims=(*more, *found.claims))


def _require_folder(folder: str) -> None:
    """Raise `TargetError` for what is no folder that can be read: a name that is mistyped contradicts nothing."""
    try:
        os.scandir(folder).close()
    except (OSError, ValueError) as error:
        why = (getattr(error, "strerror", None) or str(error)).lower()
        message, help = f"cannot read '{visible(folder)}': {why}", "give a folder that tubecert export wrote"
        raise TargetError([Finding(code="TC100", message=message, help=help)]) from None


def _text_of(name: str) -> str:
    """The text of a certificate's file (`-`: on stdin). Raises `TargetError`."""
    data = read_stdin(KIND) if name == STDIN else read(name, KIND)
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise unreadable(name, "it is not UTF-8") from None


def _heard(found: Callable[[str], None], item: Examined) -> None:
    """Tells in a line what was found of a claim."""
    why = "" if item.outcome.holds else f": {item.outcome.why}"
    found(f"{item.outcome.verdict:<12}  {item.name}{why}")


def _told(progress: Progress) -> Report:
    """What recheck, which shares no record with the rest, tells its progress to."""
    return lambda claim, done, of, boxes, share: progress(
        Step(phase=Phase.RECHECK, name=claim, done=done, of=of, count=boxes, share=share)
    )

"""A certificate examined again, from code and for the command: `tubecert recheck`."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from tubecert.asking import Exact, Number, Source, Text, asker, named, question, text_of
from tubecert.errors import ExitCode
from tubecert.library.shown import Shown

if TYPE_CHECKING:  # of the producer, which takes longer to import than many certificates to examine
    from tubecert.library.specification import File, Specifiable
    from tubecert.library.stated import Stated
    from tubecert.progress import Progress
    from tubecert.recheck.document import Node
    from tubecert.recheck.run import Examined, Recheck, Report
    from tubecert.report.page import Page


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Rechecked(Shown):
    """What the second arithmetic says of a certificate: `found` has every claim and its outcome.

    `belongs` says that it is of the specification that was given, if one was.
    """

    found: Recheck = field(repr=False)
    name: str
    belongs: str = ""

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
        from tubecert.report.rechecked import page_of

        return page_of(self.found, self.name, self.belongs)


@question({
    "spec": Source("Also: that the certificate is of this specification.", "SPEC"),
    "budget": Exact("Boxes examined per claim before giving up.  [200000]", whole=True),
    "deadline": Exact("Seconds after which what is not proven is undecided."),
    "controller": Text("Also: that what export wrote there is of the certificate.", "FOLDER"),
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
    """Examines every claim of a certificate, or of the file of one, in ball arithmetic and without a solver.

    `spec`: also that it is of this specification (else TC604 is raised). `budget`: boxes per claim before giving up;
    what is not proven `deadline` s from now is undecided. `controller`: a folder that `export` wrote, whose code and
    numbers are compared with the certificate of a sampled loop. Raises `TubecertError` for what is no certificate.
    """
    from tubecert.recheck.run import BUDGET
    from tubecert.recheck.run import recheck as examined
    from tubecert.report.progress import timed

    if isinstance(text := getattr(result, "text", None), str):
        name = str(getattr(result, "name", ""))
    else:
        name = text_of("result", result)
        text = _text_of(name)
    note = "" if spec is None else _specified(text, name, spec)
    shown = timed(progress)
    found = examined(
        text,
        name,
        budget or BUDGET,
        None if shown is None else _told(shown),
        seconds=None if deadline is None else float(deadline),
        heard=asker().heard,
    )
    if controller is not None:
        found = _with_controller(found, text, name, os.fspath(controller))
    return Rechecked(found=found, name=name, belongs=note)


def _specified(text: str, name: str, spec: Specifiable) -> str:
    """A sentence that says that the certificate is of the specification; raises TC604 if it is not."""
    from tubecert.certificate.file import FORMAT, parse
    from tubecert.library import sampled
    from tubecert.library.specification import spec_of
    from tubecert.recheck import document
    from tubecert.sampled_loop import record

    if parse(text.encode(), name, (FORMAT, record.FORMAT))["format"] != record.FORMAT:
        return belongs(document.read(text, name), name, spec)
    loaded = spec_of(spec)
    found = sampled.compared(loaded, record.read(text, name).result)
    found.require(loaded, name)
    return found.words(loaded.path)


def belongs(document: Node, name: str, spec: Specifiable) -> str:
    """The same of the certificate of a loop that rests on a metric."""
    from tubecert.certificate.belonging import compared
    from tubecert.certificate.file import incomplete
    from tubecert.certificate.result import Result
    from tubecert.library.specification import spec_of
    from tubecert.recheck.certificate import read_result
    from tubecert.recheck.document import opened
    from tubecert.records import FormError

    read_result(opened(document)[0])  # its form: what is compared below is there, and is what is examined
    loaded = spec_of(spec)
    try:
        result = Result.from_json(document.mapping()["result"])
    except FormError as error:
        raise incomplete(name, str(error)) from error
    found = compared(loaded, result)
    found.require(loaded, name)
    return found.words(loaded.path)


def _with_controller(found: Recheck, text: str, name: str, folder: str) -> Recheck:
    """The same, with the claims of a folder of exported code.

    Raises `CertificateError` for the certificate of a loop in continuous time.
    """
    from tubecert.recheck import document
    from tubecert.recheck.run import Examined
    from tubecert.recheck.sampled_loop.exported import exported

    own = document.read(text, name)
    if own.mapping()["format"] != document.SAMPLED_LOOP:
        help = f"leave {named('controller')} out, or give the certificate of a specification with hardware"
        raise document.wrong("TC601", f"{name} is about a loop in continuous time, which has no code", help)
    more = (Examined(*each) for each in exported(own, folder))
    return replace(found, claims=(*found.claims, *more))


def _text_of(name: str) -> str:
    """The text of a certificate's file (`-`: on stdin). Raises `TargetError`."""
    from tubecert.certificate.file import KIND, unreadable
    from tubecert.files import STDIN, read, read_stdin

    data = read_stdin(KIND) if name == STDIN else read(name, KIND)
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise unreadable(name, "it is not UTF-8") from None


def _told(progress: Progress) -> Report:
    """What recheck, which shares no record with the rest, tells its progress to."""
    from tubecert.progress import Phase, Step

    return lambda claim, done, of, boxes, share: progress(
        Step(phase=Phase.RECHECK, name=claim, done=done, of=of, count=boxes, share=share)
    )

"""A certificate examined again, from code: `tubecert recheck`."""

from __future__ import annotations

import os
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from tubecert.certificate.file import KIND, unreadable
from tubecert.errors import ExitCode
from tubecert.files import STDIN, read, read_stdin
from tubecert.library.numbers import Numbers
from tubecert.progress import Phase, Progress, Step
from tubecert.recheck import document
from tubecert.recheck.run import BUDGET, Examined, Recheck, Report
from tubecert.recheck.run import recheck as examined
from tubecert.report.progress import timed
from tubecert.report.rechecked import page_of

if TYPE_CHECKING:  # of the producer, which takes longer to import than many certificates to examine
    from tubecert.library.plain import Number
    from tubecert.library.specification import File
    from tubecert.library.stated import Stated


@dataclass(frozen=True, slots=True, kw_only=True)
class Rechecked:
    """What the second arithmetic says of a certificate: `found` has every claim and its outcome."""

    found: Recheck = field(repr=False)
    name: str

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

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(page_of(self.found, self.name)).plain

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(page_of(self.found, self.name))


def recheck(
    result: Stated[Any] | File,
    *,
    budget: int | None = None,
    deadline: Number | None = None,
    controller: File | None = None,
    progress: Progress | None = None,
) -> Rechecked:
    """Examines every claim of a certificate, or of the file of one, in ball arithmetic and without a solver.

    `budget`: boxes per claim before giving up; what is not proven `deadline` s from now is undecided. `controller`: a
    folder that `export` wrote, whose code and numbers are compared with the certificate of a sampled loop.
    Raises `TubecertError` for what is no certificate.
    """
    from tubecert.library.plain import number_texts

    numbers = Numbers()
    given = number_texts(budget=budget, deadline=deadline)
    most, seconds = numbers.count("budget", given["budget"]), numbers.positive("deadline", given["deadline"])
    numbers.check()
    if isinstance(result, (str, os.PathLike)):
        name = os.fspath(result)
        text = text_of(name)
    else:
        text, name = result.text, result.name
    shown = timed(progress)
    report = None if shown is None else told(shown)
    limit = None if seconds is None else float(seconds)
    found = examined(text, name, BUDGET if most is None else most, report, seconds=limit)
    if controller is not None:
        found = with_controller(found, text, name, os.fspath(controller))
    return Rechecked(found=found, name=name)


def with_controller(found: Recheck, text: str, name: str, folder: str) -> Recheck:
    """The same, with the claims of a folder of exported code.

    Raises `CertificateError` for the certificate of a loop in continuous time.
    """
    from tubecert.recheck.sampled_loop.exported import exported

    own = document.read(text, name)
    if own.mapping()["format"] != document.SAMPLED_LOOP:
        help = "leave --controller out, or give the certificate of a specification with hardware"
        raise document.wrong("TC601", f"{name} is about a loop in continuous time, which has no code", help)
    more = (Examined(*each) for each in exported(own, folder))
    return replace(found, claims=(*found.claims, *more))


def text_of(name: str) -> str:
    """The text of a certificate's file (`-`: on stdin). Raises `TargetError`."""
    data = read_stdin(KIND) if name == STDIN else read(name, KIND)
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise unreadable(name, "it is not UTF-8") from None


def told(progress: Progress) -> Report:
    """What recheck, which shares no record with the rest, tells its progress to."""
    return lambda claim, done, of, boxes, share: progress(
        Step(phase=Phase.RECHECK, name=claim, done=done, of=of, count=boxes, share=share)
    )

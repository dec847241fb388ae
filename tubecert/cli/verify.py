"""`verify`: metrics in; for each of them a verdict, the largest rate it supports, and its condition number out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate
from tubecert.cli import telling
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output, flag
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import refused, spare
from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.findings import Finding, Location
from tubecert.library.asked import at_rate, verification_numbers
from tubecert.printable import visible
from tubecert.progress import Phase
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.pipeline.verification import Verified
    from tubecert.spec import Setting, Spec

_METRICS = (".json", ".csv", ".npz", ".mat")


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A metric that is decided: the file that it stands in, and the specification with it."""

    file: str
    spec: Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """The command line."""

    files: Sequence[str]
    settings: Sequence[str]
    rate: str | None
    gap: str
    budget: str | None
    target: str | None
    expect: bool


def run(given: Given, output: Output) -> ExitCode:
    """Verify every metric."""
    texts = {"rate": given.rate, "gap": given.gap, "budget": given.budget}
    numbers = verification_numbers(texts, flag)
    cases = list(_cases(given.files, numbers.rate, settings_of(given.settings)))
    target = given.target
    if target is not None:
        if len(cases) != 1:
            raise refused(f"-o takes one metric, and {len(cases)} were given", "verify them one by one")
        certificate.check_target(target)
        spare(target, {"input": cases[0].file, "specification": cases[0].spec.path})
    from tubecert.enclosure.branch_and_bound import Effort
    from tubecert.pipeline.verification import verify
    from tubecert.report import progress, text, verification

    effort = Effort(gap=float(numbers.gap), budget=numbers.budget)
    terminal = Terminal.stderr(color=output.color)
    shown = Terminal.stdout(color=output.color)
    found: list[tuple[str, Verified]] = []
    for case in cases:
        with telling.shown(terminal, output) as show:
            told = (
                None
                if show is None
                else progress.Pieces(show, Phase.VERIFICATION, len(cases), done=len(found))
            )
            verified = verify(case.spec, effort, told)
        found.append((case.file, verified))
        if not output.json:  # one after the other: many metrics take their time
            page = verification.page_of(case.file, verified)
            write_stdout(
                shown.text([text.headline(page)] if output.quiet else text.screen(page, [], verbose=True))
            )
    if target is not None and found[0][1].file is not None:
        certificate.write(target, found[0][1].file.to_json())
    if output.json:
        write_stdout(verification.as_json(found))
    elif not output.quiet:
        write_stdout(_closing([verified for _, verified in found], target))
    if given.expect:
        return _as_locked([case.spec for case in cases], [verified for _, verified in found], terminal)
    return _code([verified for _, verified in found])


def _closing(found: Sequence[Verified], target: str | None) -> str:
    """How many there are of each verdict, and where a metric was written."""
    verdicts = [verified.verdict for verified in found]
    counts = ", ".join(f"{verdicts.count(each)} {each}" for each in dict.fromkeys(verdicts))
    written = target is not None and found[0].file is not None
    return (f"\n{len(found)} metrics: {counts}\n" if len(found) > 1 else "") + (
        f"  metric file {visible(target or '')}\n" if written else ""
    )


def _as_locked(specs: Sequence[Spec], found: Sequence[Verified], terminal: Terminal) -> ExitCode:
    """Certified if every metric is what the section `expect` of its specification says."""
    from tubecert.checking.expectations import metric_compared, outcome_of_metric
    from tubecert.report.findings import render

    wrong = [
        each
        for spec, verified in zip(specs, found, strict=True)
        for each in metric_compared(spec, outcome_of_metric(verified))
    ]
    if wrong:
        terminal.show(render(wrong))
    return ExitCode.NOT_CERTIFIED if wrong else ExitCode.CERTIFIED


def _cases(files: Sequence[str], rate: Fraction | None, settings: Sequence[Setting]) -> Iterator[Case]:
    """What is to be decided, read before any work is done; raises `TubecertError`."""
    from tubecert.spec.load import load_system
    from tubecert.spec.metric_file import with_metric

    pending: tuple[str, Spec] | None = None
    system: Spec | None = None
    for file in files:
        if Path(file).suffix.lower() in _METRICS:
            if system is None:
                raise _error(file, "a metric needs a system", "give a specification before it")
            pending = None
            yield _case(file, with_metric(system, file, rate), rate)
        else:
            if pending is not None:
                yield _case(*pending, rate)
            system = load_system(file, settings)
            pending = file, system
    if pending is not None:
        yield _case(*pending, rate)


def _case(file: str, spec: Spec, rate: Fraction | None) -> Case:
    if spec.metric is None:
        remedy = "give a metric file after the specification (tubecert synth finds one), or metric.dual_metric and rate"
        raise _error(file, "there is no metric to verify", remedy)
    return Case(file=file, spec=at_rate(spec, rate))


def _error(file: str, message: str, help: str) -> TubecertError:
    place = Location(file=file, line=1, column=1)
    return SpecError([Finding(code="TC105", message=message, location=place, help=help)])


def _code(found: Sequence[Verified]) -> ExitCode:
    """The worst: refuted, then undecided."""
    codes = [verified.verdict.exit_code for verified in found]
    return next((c for c in (ExitCode.NOT_CERTIFIED, ExitCode.UNDECIDED) if c in codes), ExitCode.CERTIFIED)

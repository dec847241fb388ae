"""`verify`: metrics in; for each of them a verdict, the largest rate it supports, and its condition number out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert import certificate
from tubecert.asking import ENDING, SETTINGS, Flag, Text, words_of
from tubecert.certificate.file import refused, spare
from tubecert.cli import telling
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.findings import Finding, Location
from tubecert.library import metrics
from tubecert.library.specification import Specification
from tubecert.printable import visible
from tubecert.progress import Phase
from tubecert.report.findings import render
from tubecert.report.terminal import Terminal
from tubecert.spec import Setting, Spec, load
from tubecert.synthesis.coefficients import with_metric_file

if TYPE_CHECKING:
    from fractions import Fraction

    from tubecert.library.metrics import VerifiedMetric

_METRICS = (".json", ".csv", ".npz", ".mat")
_WORDS: Final = {
    "files": Text("Specifications, and metrics after them.", "SPEC|METRIC...", place=True, many=True),
    "settings": SETTINGS,
    **{name: kind for name, kind in words_of(metrics.verify).items() if name != "metric"},
    "deadline": ENDING,
    "output": Text("Write a metric file, if there is one metric and it holds.", "FILE", short="-o"),
    "expect": Flag("Compare each with the section `expect` of its specification; 0 if all agree."),
}


@command(_WORDS)
def verify(
    how: Output,
    files: Sequence[str],
    *,
    settings: Sequence[Setting] = (),
    output: str | None = None,
    expect: bool = False,
    **asked: Any,
) -> ExitCode:
    """Decide C1, C2, C3 of metrics on their safe sets, without plan, uncertainty or tube."""
    from tubecert.report import progress, verification

    cases = list(_cases(files, asked.get("rate"), settings))
    if output is not None:
        if len(cases) != 1:
            raise refused(f"-o takes one metric, and {len(cases)} were given", "verify them one by one")
        certificate.check_target(output)
        spare(output, "metric file", {"input": cases[0][0], "specification": cases[0][1].path})
    found: list[VerifiedMetric] = []
    for file, spec in cases:
        with telling.shown(how) as show:
            told = progress.Pieces(show, Phase.VERIFICATION, len(cases), done=len(found))
            found.append(metrics.verify(Specification(spec=spec), **asked, progress=told))
        if not how.json:  # one after the other: many metrics take their time
            page = verification.page_of(file, found[-1].found)
            write_stdout(telling.text_of(replace(how, verbose=True), page, []))
    if output is not None and found[0].proven:
        found[0].save(output)
    if how.json:
        judged = [(file, own.found) for (file, _), own in zip(cases, found, strict=True)]
        write_stdout(verification.as_json(judged))
    elif not how.quiet:
        write_stdout(_closing(found, output))
    if expect:
        return _as_locked(cases, found, how)
    codes = [metric.verdict.exit_code for metric in found]
    return next((c for c in (ExitCode.NOT_CERTIFIED, ExitCode.UNDECIDED) if c in codes), ExitCode.CERTIFIED)


def _closing(found: Sequence[VerifiedMetric], target: str | None) -> str:
    """How many there are of each verdict, and where a metric was written."""
    verdicts = [metric.verdict for metric in found]
    counts = ", ".join(f"{verdicts.count(each)} {each}" for each in dict.fromkeys(verdicts))
    many = f"\n{len(found)} metrics: {counts}\n" if len(found) > 1 else ""
    return many + (f"  metric file {visible(target)}\n" if target and found[0].proven else "")


def _as_locked(cases: Sequence[tuple[str, Spec]], found: Sequence[VerifiedMetric], how: Output) -> ExitCode:
    """Certified if every metric is what the section `expect` of its specification says."""
    from tubecert.checking.expectations import metric_compared, outcome_of_metric

    pairs = [(spec, outcome_of_metric(metric.found)) for (_, spec), metric in zip(cases, found, strict=True)]
    if wrong := [each for pair in pairs for each in metric_compared(*pair)]:
        Terminal.stderr(color=how.color).show(render(wrong))
    return ExitCode.NOT_CERTIFIED if wrong else ExitCode.CERTIFIED


def _cases(
    files: Sequence[str], rate: Fraction | None, settings: Sequence[Setting]
) -> Iterator[tuple[str, Spec]]:
    """What is to be decided, read before any work is done: the file of each metric, and the specification with it.

    Raises `TubecertError`.
    """
    system: Spec | None = None
    own = [Path(file).suffix.lower() in _METRICS for file in files]
    for file, alone, follows in zip(files, own, [*own[1:], False], strict=True):
        if not alone:
            system = load(file, settings, "system")
            if not follows:
                yield file, metrics.at_rate(system, rate)
        elif system is None:
            raise _no_system(file)
        else:
            yield file, metrics.at_rate(with_metric_file(system, file, rate), rate)


def _no_system(file: str) -> TubecertError:
    place, message = Location(file=file, line=1, column=1), "a metric needs a system"
    help = "give a specification before it"
    return SpecError([Finding(code="TC105", message=message, location=place, help=help)])

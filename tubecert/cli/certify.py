"""`certify`: a specification in; a certificate, a report and an exit code out."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate
from tubecert.cli import keeper, telling
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.report import check_pages, write_pages
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import plan_of, refused, spare
from tubecert.digits import exact
from tubecert.errors import ExitCode, TubecertError
from tubecert.files import read
from tubecert.library.asked import certification_numbers, jobs_of, require_nothing_of_a_metric
from tubecert.printable import visible
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.pipeline.synthesised import Synthesised
    from tubecert.spec import Spec

_OF_SEARCH: Final = Fraction(1, 2)  # of the time that is given: the certification has the rest


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says; `numbers` are texts, by the names of their options."""

    spec: str
    settings: Sequence[str]
    metric: Path | None
    conditions: str | None
    numbers: Mapping[str, str | None]
    jobs: str
    scheduler: str | None
    target: str | None
    pages: Sequence[str]


def run(given: Given, output: Output) -> ExitCode:
    """Certify."""
    numbers = certification_numbers(given.numbers, flag)
    seconds = None if numbers.deadline is None else keeper.left_of(float(numbers.deadline), interrupted=True)
    jobs = jobs_of("--jobs", given.jobs)
    radii = {name: given.numbers[name] for name in ("rho_a", "epsilon")}
    settings = settings_of(given.settings, metric=given.metric, **radii)
    target = _target(given)
    pages = _pages(given, target)
    from tubecert import spec
    from tubecert.spec.metric_file import with_metric

    system = spec.load(given.spec, settings)
    if system.hardware is not None:
        spare(target, {"plan": plan_of(given.spec, system)})
        return _sampled(given, system, (target, pages), output)
    if given.metric is not None:
        system = with_metric(system, str(given.metric))
    kept = _kept_place(given, system, target)
    from tubecert.library.certifying import (
        certified,  # numpy and the rest, once the input is known to be readable
    )
    from tubecert.library.workers import workers_of

    workers = workers_of(jobs, given.scheduler, "--scheduler")
    options = numbers.options(conditions=given.conditions, metric=given.metric)
    terminal = Terminal.stderr(color=output.color)
    if system.metric is None and system.synthesis is not None:
        telling.warn_of_size(system, terminal, output)
    with telling.shown(terminal, output) as report:
        found = certified(
            system,
            options,
            report,
            seconds=None if seconds is None else Fraction(seconds) * _OF_SEARCH,
            command=_command(),
            workers=workers,
            kept=telling.kept(lambda so_far: _will(so_far, kept)),
        )
    if target != certificate.STDOUT:
        certificate.write_text(target, found.text)
    metric = _kept_metric(found.result, kept)
    write_pages(pages, found.certificate)
    written = [("metric", metric)] if metric else []
    _show(found, [*written, *_closing(found, system, (target, pages))], output)
    return found.verdict.exit_code


def _sampled(given: Given, system: Spec, files: tuple[str, Sequence[str]], output: Output) -> ExitCode:
    """The same of a sampled loop; `files` are that of the certificate and those of pages."""
    words = {"metric": given.metric, "conditions": given.conditions, "scheduler": given.scheduler}
    words |= {"deadline": None, "jobs": None if given.jobs == "1" else given.jobs}
    require_nothing_of_a_metric({**given.numbers, **words}, flag)
    from tubecert.library import sampled

    target, pages = files
    with telling.shown(Terminal.stderr(color=output.color), output) as report:
        found = sampled.certified(system, progress=report, command=_command())
    if target != certificate.STDOUT:
        certificate.write_text(target, found.text)
    write_pages(pages, found.certificate)
    after = [] if system.controller == "none" else ["export"]
    _show(found, _closing(found, system, files, after), output)
    return found.verdict.exit_code


def _closing(
    found: Certification | SampledCertification,
    spec: Spec,
    files: tuple[str, Sequence[str]],
    after: Sequence[str] = (),
) -> Iterator[tuple[str, str]]:
    """What was written, and the commands that come next."""
    target, pages = files
    name = shlex.quote(target)
    yield "certificate", target
    yield from (("page", page) for page in pages)
    if found.certified:
        yield "next", f"tubecert recheck {name}"
        yield "", f"tubecert simulate {shlex.quote(spec.path)} --certificate {name}"
    if found.certified and after:
        yield "", f"tubecert export {name} -o {shlex.quote(spec.name)}.controller"
    if not (found.certified and after):
        yield "more", f"-v here; tubecert report {name}: a page with figures"


def _command() -> str:
    return visible(shlex.join(["tubecert", *sys.argv[1:]]))


def _will(found: Synthesised, target: str | None) -> keeper.Will | None:
    """The metric that was found, if the certification does not come to its end."""
    if target is None or found.file is None:
        return None
    telling.found(f"metric proven, rate {exact(found.file.rate)} 1/s: kept in {target}")
    text = certificate.dump(found.file.to_json())
    return {"files": {target: text}, "said": "", "code": ExitCode.UNDECIDED.value}


def _target(given: Given) -> str:
    """Where the certificate goes, checked before any work is done.

    Raises `TargetError` if it cannot go there, or would take the place of an input.
    """
    target = f"{Path(given.spec).stem}.certificate.json" if given.target is None else given.target
    certificate.check_target(target)
    spare(target, {"specification": given.spec, "metric file": given.metric})
    return target


def _pages(given: Given, target: str) -> list[str]:
    """Where the pages about the certificate go, checked before any work is done. Raises `TargetError`."""
    pages = list(given.pages)
    written = None if target == certificate.STDOUT else target
    check_pages(pages, {"specification": given.spec, "metric file": given.metric, "certificate": written})
    return pages


def _kept_place(given: Given, system: Spec, beside: str) -> str | None:
    """Where a metric that is synthesised on the way is kept: beside the certificate; None if there will be none.

    Raises `TargetError` if it cannot go there, or would take the place of an input or of what somebody wrote by hand.
    """
    plan = plan_of(given.spec, system)
    if beside == certificate.STDOUT:
        return None
    spare(beside, {"plan": plan})
    if system.metric is not None or system.synthesis is None:
        return None
    name = Path(beside).name.removesuffix(".json").removesuffix(".certificate")
    target = str(Path(beside).with_name(f"{name}.metric.json"))
    certificate.check_target(target)
    spare(target, {"specification": given.spec, "plan": plan})
    if Path(target).exists() and not _synthesised(target):
        raise refused(
            f"{target} was not written by tubecert and would be overwritten by the metric that is synthesised"
        )
    return target


def _synthesised(path: str) -> bool:
    """Whether a file is a metric that tubecert wrote: it can write it again."""
    from tubecert.spec.source import METRIC

    try:
        content = json.loads(read(path, METRIC))
    except (TubecertError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and "solver" in content and "verified_on" in content


def _kept_metric(result: Result, target: str | None) -> str | None:
    """The file in which a synthesised metric was kept, None if there is none."""
    from tubecert.certificate.metric_file import metric_file
    from tubecert.verdict import Verdict

    metric, synthesis = result.metric, result.synthesis
    solver = None if synthesis is None or synthesis.search is None else synthesis.search.solver
    if target is None or solver is None or metric is None or metric.verdict is not Verdict.CERTIFIED:
        return None
    certificate.write(target, metric_file(result.safe_set, metric, solver).to_json())
    return target


def _show(
    found: Certification | SampledCertification, files: Iterable[tuple[str, str]], output: Output
) -> None:
    """The page on stdout, with `files` by what they are; or the certificate, with the verdict line on stderr."""
    from tubecert.library.stated import page_of

    closing, page = list(files), page_of(found.certificate, all_of_it=output.verbose)
    target = dict(closing)["certificate"]
    data = found.text if output.json or target == certificate.STDOUT else None
    present(output, page, closing, data)

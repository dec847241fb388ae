"""`simulate`: a specification and its certificate in; runs, figures and what they falsify out."""

from __future__ import annotations

import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import certificate
from tubecert.certificate.file import foreign
from tubecert.cli import telling
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.errors import ExitCode
from tubecert.executor import Serial
from tubecert.libraries import versions
from tubecert.library.asked import jobs_of, require_nothing_of_a_metric
from tubecert.library.simulating import (
    SimulationNumbers,
    campaign_of,
    controllers_of,
    require_extra,
    require_members,
    simulation_numbers,
    wishes_of,
)
from tubecert.library.workers import workers_of
from tubecert.printable import visible
from tubecert.progress import Phase, Progress, Step
from tubecert.records import Json
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.certificate.result import Certificate
    from tubecert.spec import Spec

_CODES: Final = {
    "falsified": ExitCode.NOT_CERTIFIED,
    "tube left": ExitCode.NOT_CERTIFIED,
    "no result": ExitCode.UNDECIDED,
    "interrupted": ExitCode.INTERRUPTED,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says; `numbers` are texts, by the names of their options."""

    spec: str
    settings: Sequence[str]
    certificate: Path | None
    metric: Path | None
    controllers: str | None
    gains: str | None
    plan: Path | None
    numbers: Mapping[str, str | None]
    folder: str | None
    jobs: str
    scheduler: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Simulate."""
    numbers, jobs = simulation_numbers(given.numbers, flag), jobs_of("--jobs", given.jobs)
    radii = {name: given.numbers[name] for name in ("rho_a", "epsilon")}
    settings = settings_of(given.settings, metric=given.metric, **radii)
    from tubecert import spec

    system = spec.load(given.spec, settings)
    if system.hardware is not None:
        return _sampled(given, system, numbers, output)
    require_extra()
    chosen = controllers_of(given.controllers, flag)
    if given.metric is not None:
        from tubecert.spec.metric_file import with_metric

        system = with_metric(system, str(given.metric))
    wishes = wishes_of(system, numbers, chosen, given.gains, given.plan)
    folder = _folder(given)
    executor = workers_of(jobs, given.scheduler, "--scheduler") or Serial()
    from tubecert.report import simulation as told
    from tubecert.simulation.adaptive.files import write
    from tubecert.simulation.folder import prepared

    require_members(system, wishes, flag)
    terminal = Terminal.stderr(color=output.color)
    with prepared(folder), telling.shown(terminal, output) as report:
        system, certified = _certificate(given, system, numbers, folder, report)
        campaign = campaign_of(system, certified.result, wishes, report, executor)
        if report is not None:
            report(Step(phase=Phase.FIGURES))
        files = write(folder, campaign, certificate=certified.hash)
    page, closing = told.page_of(campaign), _closing(given, folder, files)
    present(output, page, closing, _json(campaign.summary(certified.hash)) if output.json else None)
    return _CODES.get(campaign.outcome, ExitCode.CERTIFIED)


def _sampled(given: Given, system: Spec, numbers: SimulationNumbers, output: Output) -> ExitCode:
    """The same of a sampled loop."""
    from tubecert.library.reading import read
    from tubecert.library.sampled import SampledCertification, certified
    from tubecert.library.simulating import sampled_of
    from tubecert.report import sampled_simulation as told
    from tubecert.simulation.folder import prepared

    words = {name: getattr(given, name) for name in ("metric", "scheduler", "controllers", "gains", "plan")}
    words["jobs"] = None if given.jobs == "1" else given.jobs
    require_nothing_of_a_metric({**given.numbers, **words}, flag)
    folder = _folder(given)
    with prepared(folder), telling.shown(Terminal.stderr(color=output.color), output) as report:
        found = None if given.certificate is None else read(given.certificate)
        if found is None:
            _tell_first(given)
            found = certified(system, progress=report, command="tubecert simulate")
            found.save(Path(folder) / "certificate.json")
        if not isinstance(found, SampledCertification):
            what = "is of a loop that rests on a metric, and not of a sampled one"
            raise foreign(str(given.certificate), what)
        simulation = sampled_of(found, system, numbers, report)
        files = simulation.save(folder)
    page, closing = told.page_of(simulation.campaign), _closing(given, folder, files)
    present(output, page, closing, _json(simulation.summary) if output.json else None)
    return _CODES.get(simulation.outcome, ExitCode.CERTIFIED)


def _closing(given: Given, folder: str, files: Sequence[str]) -> list[tuple[str, str]]:
    """What was written, and the command that shows it beside what is proven."""
    certified = given.certificate or Path(folder) / "certificate.json"
    command = shlex.join(
        ["tubecert", "report", str(certified), "--simulation", folder, "-o", f"{folder}.html"]
    )
    return [("files", f"{folder}: {', '.join(files)}"), ("next", command)]


def _folder(given: Given) -> str:
    return given.folder or f"{Path(given.spec).stem}.simulation"


def _json(data: Json) -> str:
    return json.dumps(data, indent=1, sort_keys=True, allow_nan=False) + "\n"


def _tell_first(given: Given) -> None:
    there = f"{Path(given.spec).stem}.certificate.json"
    hint = f" (--certificate {visible(there)} takes the one that is there)" if Path(there).is_file() else ""
    _tell(f"no certificate is given: certifying first{hint}")


def _certificate(
    given: Given, system: Spec, numbers: SimulationNumbers, folder: str, report: Progress | None
) -> tuple[Spec, Certificate]:
    """The specification as it was certified, and its certificate: the one that is given, or a new one."""
    from tubecert.library.certification import certification_of, read
    from tubecert.simulation.adaptive.reading import adopted, require_tube

    if given.certificate is not None:
        certified = read(str(given.certificate)).certificate
        system = adopted(system, certified.result)
        require_tube(certified.result)
        return system, certified
    from tubecert import pipeline

    options = pipeline.Options(epsilon=numbers.epsilon, rho_a=numbers.rho_a, metric=given.metric)
    _tell_first(given)
    result = pipeline.certify(system, options, report)
    sealed = certificate.seal(result.to_json(), {"command": "simulate", "versions": versions()})
    certificate.write(str(Path(folder) / "certificate.json"), sealed)
    require_tube(result)
    return adopted(system, result), certification_of(sealed).certificate


def _tell(line: str) -> None:
    if sys.stderr is not None:
        print(line, file=sys.stderr, flush=True)

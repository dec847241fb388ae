"""`simulate`: a specification and its certificate in; runs, figures and what they falsify out."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

from tubecert import certificate
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.errors import ExitCode, SpecError
from tubecert.expression import suggestion
from tubecert.findings import Finding
from tubecert.letters import DISTANCE, name_of
from tubecert.libraries import versions
from tubecert.library.numbers import Numbers
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.certificate.result import Certificate, Result
    from tubecert.simulate.campaign import Campaign
    from tubecert.simulate.loops import Controller
    from tubecert.spec import Spec

_POSITIVE: Final = ("epsilon", "rho_a", "duration", "control_rate")
_GAINS: Final = ("bandwidth", "adaptation_rate", "sample_time")
_CODES: Final = {
    "falsified": ExitCode.NOT_CERTIFIED,
    "tube left": ExitCode.NOT_CERTIFIED,
    "no result": ExitCode.UNDECIDED,
    "interrupted": ExitCode.INTERRUPTED,
}
RUNS: Final = 100
SEED: Final = 0
EXTRA: Final = ("numba", "llvmlite", "matplotlib")

Step = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What the command line says, then the specification's section `simulation`, then defaults."""

    controllers: tuple[str, ...]
    gains: str
    runs: int
    seed: int
    replay: int | None
    numbers: Mapping[str, Fraction | None]


def run(given: Mapping[str, Any], output: Output) -> ExitCode:
    """Simulate; `given` holds the options by the names of their parameters."""
    _installed()
    numbers = _numbers(given)
    settings = settings_of(given)
    chosen = _controllers(given["controllers"])
    from tubecert import spec

    system = spec.load(given["spec"], settings)
    wishes = _wishes(given, numbers, chosen, system)
    folder = given["output"] or f"{Path(given['spec']).stem}.simulation"
    from tubecert.simulate.certified import require_plan
    from tubecert.simulate.output import prepared, write
    from tubecert.simulate.summary import outcome, summary

    require_plan(system)
    terminal = Terminal.stderr(color=output.color)
    wanted = not (output.no_progress or output.quiet)
    with prepared(folder), _progress(terminal, wanted=wanted) as report:
        system, certified = _certificate(given, system, wishes, folder, report)
        campaign = _campaign(system, certified.result, wishes, report)
        if report is not None:
            report("figures and data", 0, 1)
        files = write(folder, campaign, certificate=certified.hash)
    _report(summary(campaign, certified.hash), folder, len(files), output)
    return _CODES.get(outcome(campaign), ExitCode.CERTIFIED)


def _installed() -> None:
    """Raises `SpecError` without the libraries that no other command needs."""
    missing = [name for name in EXTRA if importlib.util.find_spec(name) is None]
    if missing:
        message = f"simulate needs {' and '.join(missing)}"
        help = "install tubecert with its extra: pip install 'tubecert[simulate]'"
        raise SpecError([Finding(code="TC122", message=message, help=help)])


def _numbers(given: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers among the options, exact; raises `SpecError` with everything that is wrong with them."""
    numbers = Numbers()
    values: dict[str, Any] = {name: numbers.positive(flag(name), given[name]) for name in _POSITIVE}
    values |= {name: numbers.gain(flag(name), given[name]) for name in _GAINS}
    values |= {name: numbers.whole(flag(name), given[name]) for name in ("runs", "seed", "replay")}
    numbers.check()
    return values


def _controllers(text: str | None) -> tuple[str, ...]:
    """The loops that are asked for; raises `SpecError` for a name that is none."""
    from tubecert.spec.simulation import CONTROLLERS

    words = tuple(dict.fromkeys(word.strip() for word in (text or "").split(",") if word.strip()))
    for word in words:
        if word not in CONTROLLERS:
            help = suggestion(word, CONTROLLERS, what="controllers")
            message = f"--controllers: {word[:40]!r} is no controller"
            raise SpecError([Finding(code="TC112", message=message, help=help)])
    return words


def _wishes(
    given: Mapping[str, Any], numbers: Mapping[str, Any], chosen: tuple[str, ...], system: Spec
) -> Wishes:
    from tubecert.simulate.promise import KINDS
    from tubecert.spec import Simulation

    default = system.simulation or Simulation()
    gains = name_of(str(given["gains"] or default.gains or DISTANCE.option)).option
    adaptive = KINDS[gains].controller
    values = dict(numbers)
    if values["control_rate"] is None:
        values["control_rate"] = default.control_rate

    def first(name: str, otherwise: int) -> int:
        own = numbers[name]
        wanted = getattr(default, name) if own is None else own
        return otherwise if wanted is None else int(wanted)

    return Wishes(
        controllers=chosen or default.controllers or ("ccm", adaptive),
        gains=gains,
        runs=first("runs", RUNS),
        seed=first("seed", SEED),
        replay=numbers["replay"],
        numbers=values,
    )


@contextmanager
def _progress(terminal: Terminal, *, wanted: bool) -> Iterator[Step | None]:
    """A callback that takes what is done, how many, of how many."""
    from tubecert.pipeline import Step as Shown
    from tubecert.report import progress

    with progress.shown(terminal, wanted=wanted) as show:
        if show is None:
            yield None
        else:
            yield lambda name, done, total: show(Shown(name=name, boxes=done, unit=f"of {total}"))


def _certificate(
    given: Mapping[str, Any], system: Spec, wishes: Wishes, folder: str, report: Step | None
) -> tuple[Spec, Certificate]:
    """The specification as it was certified, and its certificate: the one that is given, or a new one."""
    from tubecert.library.certification import certification_of, read
    from tubecert.simulate.certified import adopted, require_tube

    if given["certificate"] is not None:
        certified = read(str(given["certificate"])).certificate
        system = adopted(system, certified.result)
        require_tube(certified.result)
        return system, certified
    from tubecert import pipeline

    options = pipeline.Options(epsilon=wishes.numbers["epsilon"], rho_a=wishes.numbers["rho_a"])
    _tell("no certificate is given: certifying first")

    def show(step: pipeline.Step) -> None:
        if report is not None:
            report(f"certifying: {step.name}", step.boxes, step.boxes)

    result = pipeline.certify(system, options, show)
    sealed = certificate.seal(result.to_json(), {"command": "simulate", "versions": versions()})
    certificate.write(str(Path(folder) / "certificate.json"), sealed)
    require_tube(result)
    return adopted(system, result), certification_of(sealed).certificate


def _campaign(system: Spec, result: Result, wishes: Wishes, report: Step | None) -> Campaign:
    from tubecert.simulate.campaign import simulate
    from tubecert.simulate.compiled import told
    from tubecert.simulate.setting import Choice, loop_of, setting_of

    numbers = wishes.numbers
    setting = setting_of(system, result, numbers["duration"])
    gains = {name: numbers[name] for name in _GAINS}
    choice = Choice(source=wishes.gains, **gains)
    rate = numbers["control_rate"]
    loops = [loop_of(setting, cast("Controller", name), choice, rate) for name in wishes.controllers]
    with told(report):
        return simulate(
            setting, loops, count=wishes.runs, seed=wishes.seed, replay=wishes.replay, report=report
        )


def _report(data: Mapping[str, Any], folder: str, files: int, output: Output) -> None:
    """The report on stdout, or the summary as JSON, with the verdict line on stderr."""
    from tubecert.report import simulation

    present(
        output,
        simulation.verdict_line(data),
        lambda: simulation.report(data, folder=folder, files=files, verbose=output.verbose),
        json.dumps(data, indent=1, sort_keys=True, allow_nan=False) + "\n" if output.json else None,
    )


def _tell(line: str) -> None:
    if sys.stderr is not None:
        print(line, file=sys.stderr, flush=True)

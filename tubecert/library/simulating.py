"""Simulation from code, and what the command shares with it: which loops, with which gains, how many runs."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final, cast

from tubecert.certificate.result import Result
from tubecert.errors import SpecError
from tubecert.executor import Executor, Serial
from tubecert.expression import suggestion
from tubecert.findings import Finding, Severity
from tubecert.letters import ADAPTIVE, DISTANCE, name_of, words_of
from tubecert.library import sampled_simulation
from tubecert.library.asked import Named, one_of, require_nothing_of_a_metric
from tubecert.library.certification import Certification
from tubecert.library.numbers import Numbers
from tubecert.library.plain import Number, number_texts
from tubecert.library.reading import read
from tubecert.library.sampled import SampledCertification, compared
from tubecert.library.sampled_simulation import SampledSimulation
from tubecert.library.simulation import Simulation
from tubecert.library.specification import File, Specifiable, spec_of
from tubecert.library.stated import Stated
from tubecert.printable import visible
from tubecert.progress import Progress
from tubecert.report.progress import timed
from tubecert.spec import Simulation as Section
from tubecert.spec import Spec
from tubecert.trajectory.make import plan_of

if TYPE_CHECKING:
    from tubecert.simulation.adaptive.campaign import Campaign
    from tubecert.simulation.adaptive.families import Drawing
    from tubecert.simulation.adaptive.loops import Controller
    from tubecert.simulation.adaptive.setting import Setting

_HERE: Final = Serial()
EXTRA: Final = ("matplotlib",)
RUNS: Final = 100
MEMBERS: Final = 20  # random plans of a family
SEED: Final = 0


def simulate(
    result: Certification | SampledCertification | File,
    *,
    spec: Specifiable | None = None,
    controllers: str | Sequence[str] | None = None,
    gains: str | None = None,
    runs: int | None = None,
    seed: int | None = None,
    replay: int | None = None,
    duration: Number | None = None,
    bandwidth: Number | None = None,
    adaptation_rate: Number | None = None,
    members: int | None = None,
    plan: File | None = None,
    progress: Progress | None = None,
) -> Simulation | SampledSimulation:
    """Integrates the closed loops of a certificate, or of the file of one, and attacks the tube: `tubecert simulate`.

    The arguments are the options of the command; of a sampled loop only `runs`, `seed`, `duration` mean something.
    `spec` is needed where the certificate was read and its plan is in a file. Needs the extra `simulate`. Raises
    `TubecertError` if there is no tube that could be left, or if the specification is another one.
    """
    texts = number_texts(
        duration=duration,
        bandwidth=bandwidth,
        adaptation_rate=adaptation_rate,
        runs=runs,
        seed=seed,
        replay=replay,
        members=members,
    )
    numbers = simulation_numbers(texts, str)
    found = result if isinstance(result, Stated) else read(result)
    system = specification_of(found) if spec is None else spec_of(spec)
    if isinstance(found, SampledCertification):
        given = {"controllers": controllers, "gains": gains, "plan": plan, **texts}
        require_nothing_of_a_metric(given, str)
        return sampled_of(found, system, numbers, timed(progress))
    require_extra()
    chosen = controllers_of(controllers, str)
    one_of("gains", gains, words_of(ADAPTIVE))
    from tubecert.simulation.adaptive.reading import adopted, require_tube

    wishes = wishes_of(system, numbers, chosen, gains, plan)
    require_members(system, wishes, str)
    system = adopted(system, found.result)
    require_tube(found.result)
    campaign = campaign_of(system, found.result, wishes, timed(progress))
    return Simulation(campaign=campaign, compared_with=found.hash)


def sampled_of(
    found: SampledCertification, system: Spec, numbers: SimulationNumbers, report: Progress | None
) -> SampledSimulation:
    """The same of a sampled loop."""
    from tubecert.certificate.belonging import as_set
    from tubecert.simulation.sampled.campaign import simulate as campaign
    from tubecert.simulation.sampled.setting import setting_of

    require_extra(("matplotlib",))
    sampled_simulation.require_tube(found)
    compared(system, found.result).require(system, "the certificate")
    default, system = system.simulation or Section(), as_set(system, found.result.spec.settings)
    own = campaign(
        setting_of(system, found.result, numbers.duration),
        found.hash,
        sampled_simulation.compiled(found.certificate),
        runs=_first(numbers.runs, default.runs, RUNS),
        seed=_first(numbers.seed, default.seed, SEED),
        report=report,
    )
    return SampledSimulation(campaign=own)


def specification_of(found: Certification | SampledCertification) -> Spec:
    """What was certified; raises `SpecError` if the certificate does not say all of it."""
    try:
        return found.specification.spec
    except SpecError as error:
        help = "give the specification: simulate(result, spec=...)"
        message = "the certificate alone does not say what to simulate"
        raise SpecError([*error.findings, Finding(code="TC100", message=message, help=help)]) from None


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What is asked for, then the specification's section `simulation`, then defaults."""

    controllers: tuple[str, ...]
    gains: str
    runs: int
    seed: int
    replay: int | None
    duration: Fraction | None
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    members: int | None
    plan: str | None


def require_extra(names: Sequence[str] = EXTRA) -> None:
    """Raises `SpecError` without the libraries that nothing else needs."""
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    if missing:
        message = f"simulate needs {' and '.join(missing)}"
        help = "install tubecert with its extra: pip install 'tubecert[simulate]'"
        raise SpecError([Finding(code="TC122", message=message, help=help)])


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationNumbers:
    """The numbers that a simulation may be asked with, exact; None: what the specification, or a default, says."""

    epsilon: Fraction | None
    rho_a: Fraction | None
    duration: Fraction | None
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    runs: int | None
    seed: int | None
    replay: int | None
    members: int | None


def simulation_numbers(given: Mapping[str, str | None], named: Named) -> SimulationNumbers:
    """The numbers of a simulation; raises `SpecError` with everything that is wrong with them."""
    numbers = Numbers()

    def positive(name: str) -> Fraction | None:
        return numbers.positive(named(name), given.get(name))

    def gain(name: str) -> Fraction | None:
        return numbers.gain(named(name), given[name])

    def whole(name: str) -> int | None:
        return numbers.whole(named(name), given[name])

    found = SimulationNumbers(
        epsilon=positive("epsilon"),
        rho_a=positive("rho_a"),
        duration=positive("duration"),
        bandwidth=gain("bandwidth"),
        adaptation_rate=gain("adaptation_rate"),
        runs=whole("runs"),
        seed=whole("seed"),
        replay=whole("replay"),
        members=numbers.count(named("members"), given["members"]),
    )
    numbers.check()
    return found


def controllers_of(given: str | Sequence[str] | None, named: Named) -> tuple[str, ...]:
    """The loops that are asked for; raises `SpecError` for a name that is none."""
    from tubecert.spec.scene import CONTROLLERS

    parts = given.split(",") if isinstance(given, str) else given or ()
    words = tuple(dict.fromkeys(word.strip() for word in parts if word.strip()))
    for word in words:
        if word not in CONTROLLERS:
            help = suggestion(word, CONTROLLERS, what="controllers")
            message = f"{named('controllers')}: {word[:40]!r} is no controller"
            raise SpecError([Finding(code="TC112", message=message, help=help)])
    return words


def require_members(system: Spec, wishes: Wishes, named: Named) -> None:
    """Raises TC708 where a plan of a family is asked for, and there is no family."""
    from tubecert.simulation.adaptive.reading import require_family

    asked = ("members", wishes.members), ("plan", wishes.plan)
    require_family(system, [named(name) for name, value in asked if value is not None])


def wishes_of(
    system: Spec,
    numbers: SimulationNumbers,
    chosen: tuple[str, ...],
    gains: str | None,
    plan: File | None = None,
) -> Wishes:
    """What is simulated of a specification."""
    default = system.simulation or Section()
    return Wishes(
        controllers=chosen or default.controllers or ("ccm", "l1"),
        gains=name_of(gains or default.gains or DISTANCE.option).option,
        runs=_first(numbers.runs, default.runs, RUNS),
        seed=_first(numbers.seed, default.seed, SEED),
        replay=numbers.replay,
        duration=numbers.duration,
        bandwidth=numbers.bandwidth,
        adaptation_rate=numbers.adaptation_rate,
        members=numbers.members,
        plan=None if plan is None else os.fspath(plan),
    )


def _first(asked: int | None, default: int | None, otherwise: int) -> int:
    return asked if asked is not None else otherwise if default is None else default


def campaign_of(
    system: Spec,
    result: Result,
    wishes: Wishes,
    report: Progress | None,
    executor: Executor = _HERE,
) -> Campaign:
    """Every loop that is wished for, integrated and attacked; random runs are those of the `executor`."""
    from tubecert.simulation.adaptive.campaign import follow
    from tubecert.simulation.adaptive.campaign import simulate as campaign
    from tubecert.simulation.adaptive.families import members_of
    from tubecert.simulation.adaptive.setting import Choice, loop_of

    setting, drawing = _setting(system, result, wishes)
    choice = Choice(
        source=wishes.gains,
        bandwidth=wishes.bandwidth,
        adaptation_rate=wishes.adaptation_rate,
    )
    names = dict.fromkeys(wishes.controllers)
    loops = [loop_of(setting, cast("Controller", name), choice) for name in names]
    asked = MEMBERS if wishes.members is None else wishes.members
    each = wishes.runs if drawing is None else -(-wishes.runs // asked)
    own = campaign(
        setting,
        loops,
        count=each,
        seed=wishes.seed,
        replay=wishes.replay,
        report=report,
        executor=executor,
    )
    further = asked - 1  # the first plan has an adversary of its own
    if drawing is None or not each or not further or own.interrupted:
        return own
    plans = members_of(drawing, wishes.seed, range(1, asked))
    found = follow(setting, loops, plans, asked=further, each=each, seed=wishes.seed, report=report)
    return replace(own, members=found, interrupted=found is None or found.plans < further)


def _setting(system: Spec, result: Result, wishes: Wishes) -> tuple[Setting, Drawing | None]:
    """The setting; of a family that of the plan that is given, or of a random one, and what draws others."""
    from tubecert.model import build
    from tubecert.simulation.adaptive.families import drawing_of, members_of
    from tubecert.simulation.adaptive.setting import horizon_of, setting_of

    if system.trajectory.bundle is None:
        return setting_of(system, result, wishes.duration), None
    model = build(system)
    if wishes.plan is not None:
        own = _member(system, wishes.plan)
        return setting_of(own, result, wishes.duration, plan_of(own, model)), None
    drawing = drawing_of(system, model, horizon_of(system, wishes.duration))
    ((plan, _),) = members_of(drawing, wishes.seed, [0])
    return setting_of(system, result, wishes.duration, plan), drawing


def _member(system: Spec, path: str) -> Spec:
    """The specification of a plan in a file that is proven to be one of the family; raises `SpecError` if not."""
    from tubecert.pipeline.membership import member_spec, membership

    own = member_spec(path, system)
    missed = [item for item in membership(own, system, visible(path)) if item.severity is Severity.ERROR]
    if missed:
        raise SpecError(missed)
    return own

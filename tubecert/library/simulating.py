"""Simulation from code, and for the command: which loops, with which gains, how many runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import TYPE_CHECKING, Final, cast

from tubecert import asking
from tubecert.asking import Number
from tubecert.errors import SpecError, TubecertError
from tubecert.executor import Serial
from tubecert.findings import Finding
from tubecert.letters import ADAPTIVE, DISTANCE, name_of, words_of
from tubecert.library.certifying import SCHEDULER
from tubecert.library.reading import certificate_of
from tubecert.library.specification import File, Specifiable, spec_of
from tubecert.library.workers import workers_of
from tubecert.progress import Progress
from tubecert.report.progress import timed
from tubecert.spec import Simulation as Section
from tubecert.spec import Spec

if TYPE_CHECKING:
    from tubecert.certificate.result import Result
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.library.simulation import SampledSimulation, Simulation
    from tubecert.simulation.adaptive.families import Drawing
    from tubecert.simulation.adaptive.loops import Controller
    from tubecert.simulation.adaptive.setting import Setting

EXTRA: Final = "matplotlib"
RUNS: Final = 100
MEMBERS: Final = 20  # random plans of a family


@asking.question({
    "controllers": asking.Names(
        "Loops, separated by commas: nominal, ccm, reference, l1.  [ccm,l1]", "NAMES",
        words=("nominal", "ccm", "reference", "l1"), what="controller", of=asking.METRIC,
    ),
    "gains": asking.Choice(
        "The certificate whose gains are taken.  [distance]", words=tuple(words_of(ADAPTIVE)), of=asking.METRIC
    ),
    "runs": asking.Exact("Random runs against each loop that adapts; 0: no attacks.  [100]", whole=True, least=0),
    "jobs": asking.Exact("Vectors of 128 runs at a time; not with hardware.", whole=True, of=asking.SEARCH),
    "scheduler": SCHEDULER,
    "seed": asking.Exact("Seed of the random runs and of the adversary.  [0]", whole=True, least=0),
    "replay": asking.Exact(
        "Draw this random run in place of the specification's h; not with hardware.",
        whole=True, least=0, of=asking.METRIC,
    ),
    "members": asking.Exact(
        "Of a family without hardware: random plans that share the runs.  [20]", whole=True, of=asking.METRIC
    ),
    "plan": asking.Text("... this plan (CSV or specification), if it is one.", "FILE", of=asking.METRIC),
    "duration": asking.Exact("How long, in s.  [the horizon, else 10/rate]"),
    "bandwidth": asking.Exact("Choose the filter bandwidth, in rad/s.", moderate=True, of=asking.METRIC),
    "adaptation_rate": asking.Exact("Choose the adaptation rate of l1.", moderate=True, of=asking.METRIC),
})  # fmt: skip
def simulate(
    result: Certification | SampledCertification | File,
    *,
    spec: Specifiable | None = None,
    controllers: str | Sequence[str] | None = None,
    gains: str | None = None,
    runs: int | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    seed: int | None = None,
    replay: int | None = None,
    members: int | None = None,
    plan: File | None = None,
    duration: Number | None = None,
    bandwidth: Number | None = None,
    adaptation_rate: Number | None = None,
    progress: Progress | None = None,
) -> Simulation | SampledSimulation:
    """Integrates the closed loops of a certificate, or of the file of one, and attacks the tube: `tubecert simulate`.

    The arguments are the options of the command; of a sampled loop only `runs`, `seed`, `duration` mean something.
    `spec` is needed where the certificate was read and its plan is in a file. Needs the extra `simulate`. Raises
    `TubecertError` if there is no tube that could be left, or if the specification is another one.
    """
    from tubecert.library.sampled import SampledCertification

    found = certificate_of(result)
    system = _certified(found) if spec is None else spec_of(spec)
    require_ready(system)
    if isinstance(found, SampledCertification):
        return _sampled(found, system, timed(progress), duration=asking.exact(duration), runs=runs, seed=seed)
    from tubecert.library.simulation import Simulation
    from tubecert.simulation.adaptive import campaign, families
    from tubecert.simulation.adaptive.setting import Choice, adopted, loop_of, require_tube

    default, system = system.simulation or Section(), adopted(system, found.result)
    require_tube(found.result)
    runs, seed = _first(runs, default.runs, RUNS), _first(seed, default.seed, 0)
    setting, drawing = _setting(system, found.result, asking.exact(duration), seed, plan)
    choice = Choice(
        source=name_of(gains or default.gains or DISTANCE.option).option,
        bandwidth=asking.exact(bandwidth),
        adaptation_rate=asking.exact(adaptation_rate),
    )
    names = dict.fromkeys(controllers or default.controllers or ("ccm", "l1"))
    loops = [loop_of(setting, cast("Controller", name), choice) for name in names]
    asked, report = members or MEMBERS, timed(progress)
    each = runs if drawing is None else -(-runs // asked)
    workers = workers_of(jobs, scheduler) or Serial()
    own = campaign.simulate(
        setting, loops, count=each, seed=seed, replay=replay, report=report, executor=workers
    )
    further = asked - 1  # the first plan has an adversary of its own
    if drawing is not None and each and further and not own.interrupted:
        plans = families.members_of(drawing, seed, range(1, asked))
        others = campaign.follow(setting, loops, plans, asked=further, each=each, seed=seed, report=report)
        own = replace(own, members=others, interrupted=others is None or others.plans < further)
    return Simulation(campaign=own, compared_with=found.hash)


def require_ready(system: Spec) -> None:
    """Raises `SpecError` for what is asked in vain of a specification, and without what only this needs."""
    if system.hardware is not None:
        asking.require_nothing_of_a_metric()
    asking.require_installed(EXTRA, "simulate", "simulate needs")
    given = asking.asker().given
    if of_families := [asking.named(name) for name in ("members", "plan") if given.get(name) is not None]:
        from tubecert.simulation.adaptive.setting import require_family

        require_family(system, of_families)


def _certified(found: Certification | SampledCertification) -> Spec:
    """What was certified; raises `SpecError` if the certificate does not say all of it."""
    try:
        return found.specification.spec
    except SpecError as error:
        help = "give the specification: simulate(result, spec=...)"
        message = "the certificate alone does not say what to simulate"
        raise SpecError([*error.findings, Finding(code="TC100", message=message, help=help)]) from None


def _first(asked: int | None, default: int | None, otherwise: int) -> int:
    return asked if asked is not None else otherwise if default is None else default


def _setting(
    system: Spec, result: Result, duration: Fraction | None, seed: int, path: File | None
) -> tuple[Setting, Drawing | None]:
    """The setting; of a family that of the plan that is given, or of a random one, and what draws others."""
    from tubecert.model import build
    from tubecert.pipeline.membership import member
    from tubecert.simulation.adaptive.families import drawing_of, members_of
    from tubecert.simulation.adaptive.setting import horizon_of, setting_of
    from tubecert.trajectory.make import plan_of

    if system.trajectory.bundle is None:
        return setting_of(system, result, duration), None
    model = build(system)
    if path is not None:
        own = member(os.fspath(path), system)
        return setting_of(own, result, duration, plan_of(own, model)), None
    drawing = drawing_of(system, model, horizon_of(system, duration))
    ((plan, _),) = members_of(drawing, seed, [0])
    return setting_of(system, result, duration, plan), drawing


def _sampled(
    found: SampledCertification, system: Spec, report: Progress | None, *, duration: Fraction | None,
    runs: int | None, seed: int | None,
) -> SampledSimulation:  # fmt: skip
    """The same of a sampled loop."""
    from tubecert.certificate.belonging import as_set
    from tubecert.controller.compiled import stepper
    from tubecert.library.sampled import compared
    from tubecert.library.simulation import SampledSimulation
    from tubecert.simulation.sampled.campaign import simulate as campaign
    from tubecert.simulation.sampled.setting import setting_of

    result = found.result
    if not result.tube or result.controller is None or result.nominal is None:
        reason = found.reasons[0].message if found.reasons else "nothing was found"
        message = f"there is no tube that a simulation could leave ({found.verdict}: {reason})"
        finding = Finding(code="TC703", message=message, help="tubecert certify tells more")
        raise TubecertError([finding], found.verdict.exit_code)
    compared(system, result).require(system, "the certificate")
    default, system = system.simulation or Section(), as_set(system, result.spec.settings)
    own = campaign(
        setting_of(system, result, duration),
        found.hash,
        stepper(found.certificate),
        runs=_first(runs, default.runs, RUNS),
        seed=_first(seed, default.seed, 0),
        report=report,
    )
    return SampledSimulation(campaign=own)

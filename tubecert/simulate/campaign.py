"""All that one command simulates: every loop under the uncertainty that is drawn, then attacks on the loops that adapt.

Interruption keeps what is finished; `interrupted` says that something is missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.executor import Executor, Serial
from tubecert.progress import Phase, Progress, Step
from tubecert.simulate.clearance import Clearance, of_curve, of_tube
from tubecert.simulate.compare import Comparison, check_class, compare, merged
from tubecert.simulate.integrator import integrate
from tubecert.simulate.monte_carlo import (
    Case,
    Sample,
    along,
    attack,
    case,
    disturbance_of,
    monte_carlo,
)
from tubecert.simulate.problem import Disturbance
from tubecert.simulate.runs import Runs
from tubecert.simulate.setting import Loop, Setting
from tubecert.simulate.uncertainty import usual
from tubecert.trajectory import Plan

_HERE: Final = Serial()
_DEAR: Final = 60_000  # steps of a run
SPECIFIED: Final = "of the specification"
RANDOM: Final = "of random run {run}, seed {seed}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawn:
    """One run of a loop that is drawn: its comparison, and its clearance from every obstacle."""

    loop: Loop
    runs: Runs
    comparison: Comparison
    clearance: tuple[Clearance, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attack:
    """What random runs and the adversary found against a loop; the adversary's run is alone in `worst`."""

    loop: Loop
    sample: Sample | None
    comparison: Comparison | None
    worst: Runs | None
    case: Case | None
    worst_comparison: Comparison | None

    @property
    def greatest(self) -> float:
        """The largest d(x*, x) that was met."""
        found = [c.uses["distance"].value for c in (self.comparison, self.worst_comparison) if c and c.uses]
        return max(found, default=float("nan"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """What random runs along random plans of a family found against a loop: run i is along plan 1 + i // `each`."""

    loop: Loop
    comparison: Comparison


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Members:
    """Further random plans of a family: `each` runs of every loop along each; `asked` is how many there were to be.

    `defect` is the largest |x*' - f - B u*| of them that was seen; `replan`: after so many s each is given up for
    another.
    """

    asked: int
    plans: int
    each: int
    defect: float
    followed: tuple[Followed, ...]
    replan: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Campaign:
    """Everything that was simulated; `uncertainty` says which h is drawn, `members`: further plans of a family."""

    setting: Setting
    uncertainty: str
    drawn: tuple[Drawn, ...]
    attacks: tuple[Attack, ...]
    plan_clearance: tuple[Clearance, ...]
    tube_clearance: tuple[Clearance, ...]
    count: int
    seed: int
    interrupted: bool
    members: Members | None = None

    @property
    def comparisons(self) -> tuple[tuple[Loop, Comparison], ...]:
        """Every comparison with its loop."""
        drawn = [(item.loop, item.comparison) for item in self.drawn]
        attacked = [
            (item.loop, found)
            for item in self.attacks
            for found in (item.comparison, item.worst_comparison)
            if found is not None
        ]
        followed = self.members.followed if self.members else ()
        return (*drawn, *attacked, *((item.loop, item.comparison) for item in followed))

    @property
    def falsified(self) -> bool:
        """Whether a promise was broken."""
        return any(found.violations for _, found in self.comparisons)

    @property
    def left(self) -> bool:
        """Whether a loop that is meant to stay in the tube left it, promised or not."""
        return any(loop.tested and found.outside for loop, found in self.comparisons)

    @property
    def unreliable(self) -> bool:
        """Whether some run of a loop that is tested is no result: its own error estimate is too large, or it failed."""
        return any(
            loop.tested and (found.unreliable or len(found.failures) > _exits(found))
            for loop, found in self.comparisons
        )


def _exits(found: Comparison) -> int:
    """How many of the runs that were stopped had left the tube."""
    return sum(lane in found.outside for lane, _, _ in found.failures)


def simulate(
    setting: Setting,
    loops: Sequence[Loop],
    *,
    count: int,
    seed: int,
    replay: int | None = None,
    report: Progress | None = None,
    executor: Executor = _HERE,
) -> Campaign:
    """Every loop once, and `count` random runs and an adversary against each loop that adapts (none if 0).

    A loop whose own run is no result is not attacked: neither would the others be.

    Random runs are done by the `executor`. The loops are drawn under the specification's h, or as random run `replay`.
    Raises `TubecertError` if the specification's h leaves its class while the state is in the tube.
    """
    if setting.h is None and replay is None:
        replay = 0
    words = SPECIFIED if replay is None else RANDOM.format(run=replay, seed=seed)
    drawn = []
    for number, loop in enumerate(loops):
        if report is not None:
            name = f"{loop.controller}, {words}"
            report(Step(phase=Phase.SIMULATION, name=name, done=number, of=len(loops)))
        drawn.append(_drawn(setting, loop, *_uncertainty(setting, loop, seed, replay)))
    if setting.h is not None and replay is None:
        where = "simulation.h" if setting.spec.simulation and setting.spec.simulation.h else "uncertainty.h"
        for item in drawn:
            check_class(setting, item.runs, setting.h, where)
    attacks: list[Attack] = []
    interrupted = False
    for loop, own in zip(loops, drawn, strict=True):
        if loop.tested and count and not interrupted and not own.comparison.unreliable:
            attacked = replace(setting, dear=bool(own.runs.steps.max() > _DEAR))
            attacks.append(_attack(attacked, loop, count, seed, report, executor))
            sample = attacks[-1].sample
            interrupted = sample is None or sample.interrupted or attacks[-1].worst is None
    first = drawn[0].runs
    return Campaign(
        setting=setting,
        uncertainty=words,
        drawn=tuple(drawn),
        attacks=tuple(attacks),
        plan_clearance=of_curve(setting.spec, first.t, first.x_plan),
        tube_clearance=of_tube(
            setting.spec, first.t, first.x_plan, setting.greatest_radius, setting.half_widths
        ),
        count=count,
        seed=seed,
        interrupted=interrupted,
    )


def follow(
    setting: Setting,
    loops: Sequence[Loop],
    plans: Iterator[tuple[Plan, float]],
    *,
    asked: int,
    each: int,
    seed: int,
    report: Progress | None = None,
) -> Members | None:
    """Every loop that adapts along `asked` plans with their defects, `each` runs along each of them.

    Of an interruption what is finished is kept; None if nothing is.
    """
    found: list[tuple[Comparison, ...]] = []
    defects: list[float] = []
    tested = [loop for loop in loops if loop.tested]
    try:
        for number, (plan, defect) in enumerate(plans, start=1):
            if report is not None:
                name = "random plans of the family"
                report(Step(phase=Phase.SIMULATION, name=name, done=(number - 1) * each, of=asked * each))
            around = setting.along(plan)
            numbers = range(number * each, (number + 1) * each)
            runs = [along(around, loop.along(plan), seed, numbers) for loop in tested]
            found.append(
                tuple(compare(around, own, loop.promise) for own, loop in zip(runs, tested, strict=True))
            )
            defects.append(defect)
    except KeyboardInterrupt:
        pass
    if not found:
        return None
    return Members(
        asked=asked,
        plans=len(found),
        each=each,
        defect=max(defects),
        followed=tuple(
            Followed(loop=loop, comparison=merged([row[i] for row in found])) for i, loop in enumerate(tested)
        ),
    )


def _uncertainty(setting: Setting, loop: Loop, seed: int, replay: int | None) -> tuple[Array, Disturbance]:
    """Start (n,) and h of the run that is drawn: the specification's own, or those of a random run."""
    kind = setting.uncertainty
    if replay is not None:
        found = case(setting, kind, seed, replay)
        return found.start, disturbance_of(setting, kind, [found])
    start = setting.started(np.ones(len(setting.x0))) if setting.varied else setting.x0
    own = Disturbance.from_expressions(setting.h, setting.model, 1)
    return start, own if kind.sources is None else replace(own, beside=usual(kind, kind.sources))


def _drawn(setting: Setting, loop: Loop, start: Array, h: Disturbance) -> Drawn:
    runs = integrate(loop.problem, start[None], h, tolerance=setting.tolerance)
    return Drawn(
        loop=loop,
        runs=runs,
        comparison=compare(setting, runs, loop.promise),
        clearance=of_curve(setting.spec, runs.t, runs.x[0]),
    )


def _attack(
    setting: Setting, loop: Loop, count: int, seed: int, report: Progress | None, executor: Executor
) -> Attack:
    sample = monte_carlo(setting, loop, count, seed, report, executor)
    found, worst, measured = None, None, None
    if sample is not None and not sample.interrupted:
        try:
            found = attack(setting, loop, seed, report)
            one = disturbance_of(setting, setting.uncertainty, [found])
            worst = integrate(loop.problem, found.start[None], one, tolerance=setting.tolerance)
            measured = compare(setting, worst, loop.promise)
        except KeyboardInterrupt:
            found, worst = None, None
    return Attack(
        loop=loop,
        sample=sample,
        comparison=None if sample is None else compare(setting, sample.runs, loop.promise),
        worst=worst,
        case=found,
        worst_comparison=measured,
    )

"""All that one command simulates: every loop under the uncertainty that is drawn, then attacks on the loops that adapt.

Loops and random runs are one vector of lanes, or several where there are many. Interruption keeps what is finished;
`interrupted` says that something is missing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Final

import numpy as np

from tubecert.executor import Executor, Serial
from tubecert.progress import Phase, Progress, Step
from tubecert.simulation.adaptive.attack import Cases, cases, worst
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.judge import Comparison, check_class, compare
from tubecert.simulation.adaptive.loops import Batch, Disturbance, Runs, joined
from tubecert.simulation.adaptive.record import FollowedData, LoopData, MembersData
from tubecert.simulation.adaptive.setting import Loop, Setting
from tubecert.simulation.adaptive.uncertainty import usual
from tubecert.simulation.vectors import finished, vectors_of
from tubecert.trajectory import Plan

LANES: Final = 128  # random runs of a vector: they are kept, and told of, when all of them are finished
_FIRST: Final = 8  # of the first vector: who interrupts soon has these, and the loops that are drawn
_KEPT: Final = ("x", "off", "distance")  # of random runs, at the output times
PLANS: Final = 25  # random plans whose runs are one vector
SPECIFIED: Final = "of the specification"
RANDOM: Final = "of random run {run}, seed {seed}"
_HERE: Final = Serial()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawn:
    """One run of a loop that is drawn, and its comparison."""

    loop: Loop
    runs: Runs
    comparison: Comparison


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attack:
    """What random runs, of which so many were `asked` for, and the adversary found against a loop.

    The adversary's run is alone in `worst` and `case`.
    """

    loop: Loop
    runs: Runs
    asked: int
    comparison: Comparison
    worst: Runs | None = None
    case: Cases | None = None
    worst_comparison: Comparison | None = None

    @property
    def greatest(self) -> float | None:
        """The largest d(x*, x) that was met, if a run is a result."""
        found = [c.worst["distance"].value for c in (self.comparison, self.worst_comparison) if c and c.worst]
        return max(found, default=None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Campaign:
    """Everything that was simulated; `uncertainty` says which h is drawn, `members`: further plans of a family."""

    setting: Setting
    uncertainty: str
    drawn: tuple[Drawn, ...]
    attacks: tuple[Attack, ...]
    seed: int
    interrupted: bool
    members: MembersData | None = None


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

    Vectors of lanes are done by the `executor`. The loops are drawn under the specification's h, or as random run
    `replay`. No adversary is sought where a loop's own run is no result: neither would its runs be. Raises
    `TubecertError` if the specification's h leaves its class while the state is in the tube.
    """
    if setting.h is None and replay is None:
        replay = 0
    own = _specified(setting) if replay is None else cases(setting, seed, [replay])
    tested = [loop for loop in loops if loop.tested] if count else []
    vectors = vectors_of(count if tested else 0, min(_FIRST, LANES), LANES)
    work = partial(_vector, setting, loops, own, seed)
    found = finished(work, vectors, executor, report, "loops and random runs")
    parts, complete = [runs[len(runs) - len(tested) :] for runs in found], len(found) == len(vectors)
    drawn = [
        Drawn(loop=loop, runs=runs, comparison=compare(setting, runs, loop.promise))
        for loop, runs in zip(loops, found[0], strict=False)
    ]
    if setting.h is not None and replay is None:
        where = "simulation.h" if setting.spec.simulation and setting.spec.simulation.h else "uncertainty.h"
        for item in drawn:
            check_class(setting, item.runs, setting.h, where)
    lost = [item.loop for item in drawn if item.comparison.no_result]
    attacks = []
    for loop, *sample in zip(tested, *parts, strict=True):
        runs = joined(sample)
        attack = Attack(loop=loop, runs=runs, asked=count, comparison=compare(setting, runs, loop.promise))
        if complete and loop not in lost:
            attack = _attacked(setting, attack, seed, report)
            complete = attack.worst is not None
        attacks.append(attack)
    return Campaign(
        setting=setting,
        uncertainty=SPECIFIED if replay is None else RANDOM.format(run=replay, seed=seed),
        drawn=tuple(drawn),
        attacks=tuple(attacks),
        seed=seed,
        interrupted=not complete,
    )


def _specified(setting: Setting) -> Cases:
    """Start and h of the specification."""
    start = setting.started(np.ones(len(setting.x0))) if setting.varied else setting.x0
    own = Disturbance.from_expressions(setting.h, setting.model, 1)
    if setting.uncertainty.sources is not None:
        own = replace(own, beside=usual(setting.uncertainty))
    return Cases(start[None], own)


def _vector(setting: Setting, loops: Sequence[Loop], own: Cases, seed: int, numbers: range) -> list[Runs]:
    """Some random runs of every loop that adapts; before the first of them those of all loops that are drawn."""
    drawn = [own.of(loop.problem) for loop in loops if not numbers.start]
    random = [cases(setting, seed, numbers).of(loop.problem) for loop in loops if loop.tested and numbers]
    found = integrate(drawn + random, tolerance=setting.tolerance)
    return [*found[: len(drawn)], *(runs.with_only(_KEPT) for runs in found[len(drawn) :])]


def _attacked(setting: Setting, attack: Attack, seed: int, report: Progress | None) -> Attack:
    """With the adversary's run, if nobody interrupts."""
    try:
        found = worst(setting, attack.loop, seed, attack.runs, report)
        (runs,) = integrate([found.of(attack.loop.problem)], tolerance=setting.tolerance)
    except KeyboardInterrupt:
        return attack
    measured = compare(setting, runs, attack.loop.promise)
    return replace(attack, worst=runs, case=found, worst_comparison=measured)


def follow(
    setting: Setting,
    loops: Sequence[Loop],
    plans: Iterator[tuple[Plan, float]],
    *,
    asked: int,
    each: int,
    seed: int,
    report: Progress | None = None,
) -> MembersData | None:
    """Every loop that adapts along `asked` plans with their defects, `each` runs along each of them.

    Of an interruption what is finished is kept; None if nothing is.
    """
    tested = [loop for loop in loops if loop.tested]
    found, defects = list[list[Runs]](), list[float]()
    with suppress(KeyboardInterrupt):
        while part := [*islice(plans, PLANS)]:
            if report is not None:
                name, done = "random plans of the family", len(defects) * each
                report(Step(phase=Phase.SIMULATION, name=name, done=done, of=asked * each))
            found.append(_along(setting, tested, [plan for plan, _ in part], seed, each, len(defects) + 1))
            defects += [defect for _, defect in part]
    if not found:
        return None
    every = [joined(parts) for parts in zip(*found, strict=True)]
    return MembersData(
        asked=asked,
        plans=len(defects),
        runs_each=each,
        largest_defect=max(defects),
        loops=tuple(
            FollowedData(loop=LoopData.of(loop), comparison=compare(setting, runs, loop.promise))
            for loop, runs in zip(tested, every, strict=True)
        ),
    )


def _along(
    setting: Setting, loops: Sequence[Loop], plans: Sequence[Plan], seed: int, each: int, first: int
) -> list[Runs]:
    """Every loop along all plans, from this number on."""
    batches = list[list[Batch]]()
    for number, plan in enumerate(plans, first):
        own = cases(setting.along(plan), seed, range(number * each, (number + 1) * each))
        batches.append([own.of(loop.along(plan).problem) for loop in loops])
    runs = integrate([batch for part in batches for batch in part], tolerance=setting.tolerance)
    return [joined([run.with_only(_KEPT) for run in runs[i :: len(loops)]]) for i in range(len(loops))]

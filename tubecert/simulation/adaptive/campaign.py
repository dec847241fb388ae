"""All that one command simulates: every loop under the uncertainty that is drawn, then attacks on the loops that adapt.

Loops and random runs are one vector of lanes, or several where there are many. Interruption keeps what is finished;
`interrupted` says that something is missing. The words are chosen with care: a simulation that finds nothing has not
falsified anything, and that is all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from typing import Final, Literal

import numpy as np

from tubecert.executor import Executor, Serial
from tubecert.progress import Phase, Progress, Step
from tubecert.records import Json, to_json
from tubecert.simulation.adaptive.attack import cases, worst
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.judge import Comparison, check_class, compare, of_plan, of_run, of_tube
from tubecert.simulation.adaptive.loops import Batch, Cases, Disturbance, Runs, joined
from tubecert.simulation.adaptive.setting import Loop, Setting
from tubecert.simulation.adaptive.uncertainty import usual
from tubecert.simulation.told import Clearance
from tubecert.simulation.vectors import finished, vectors_of
from tubecert.trajectory import Plan

FORMAT: Final = "tubecert-simulation/1"
LANES: Final = 128  # random runs of a vector: they are kept, and told of, when all of them are finished
_FIRST: Final = 8  # of the first vector: who interrupts soon has these, and the loops that are drawn
_KEPT: Final = ("x", "off", "distance")  # of random runs, at the output times
PLANS: Final = 25  # random plans whose runs are one vector
SPECIFIED: Final = "of the specification"
RANDOM: Final = "of random run {run}, seed {seed}"
_HERE: Final = Serial()
_WAVES: Final = ("amplitude", "frequency", "wave", "phase", "push")
_BESIDE: Final = ("wind", "aim", "blowing", "gusting", "theta")
Kind = Literal["one", "random", "adversary", "other plans"]
Outcome = Literal["falsified", "tube left", "no result", "interrupted", "not falsified", "nothing claimed"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """Runs of a loop, and what they came to: `one` that is drawn, `random` runs, of which so many were `asked` for, ...

    Of one that is drawn how near it came to `obstacles`; of an adversary the `case`: its start, and what acted on it.
    """

    kind: Kind
    loop: Loop
    runs: Runs
    comparison: Comparison
    asked: int = 0
    obstacles: tuple[Clearance, ...] = ()
    case: Cases | None = None

    @classmethod
    def judged(cls, setting: Setting, kind: Kind, loop: Loop, runs: Runs) -> Followed:
        """Runs beside what is promised of their loop."""
        return cls(kind=kind, loop=loop, runs=runs, comparison=compare(setting, runs, loop.promise))

    @property
    def data(self) -> dict[str, object]:
        """The loop and its comparison."""
        return {**self.loop.data, **to_json(self.comparison)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attack:
    """What random runs and the adversary found against a loop."""

    random: Followed
    adversary: Followed | None = None

    @property
    def loop(self) -> Loop:
        """The loop."""
        return self.random.loop

    @property
    def greatest(self) -> float | None:
        """The largest d(x*, x) that was met, if a run is a result."""
        found = [own.comparison.worst.get("distance") for own in (self.random, self.adversary) if own]
        return max((use.value for use in found if use), default=None)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Members:
    """Further random plans of a family: run i is along plan i // `runs_each`; the largest defect is a sampled one."""

    asked: int
    plans: int
    runs_each: int
    largest_defect: float
    loops: tuple[Followed, ...]

    @property
    def data(self) -> dict[str, object]:
        """As it is told."""
        told = {name: getattr(self, name) for name in ("asked", "plans", "runs_each", "largest_defect")}
        return told | {"loops": [item.data for item in self.loops]}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Campaign:
    """Everything that was simulated; `uncertainty` says which h is drawn, `members`: further plans of a family."""

    setting: Setting
    uncertainty: str
    loops: tuple[Followed, ...]
    attacks: tuple[Attack, ...]
    seed: int
    interrupted: bool
    members: Members | None = None

    @property
    def followed(self) -> list[Followed]:
        """All runs of all loops."""
        attacks = [own for attack in self.attacks for own in (attack.random, attack.adversary) if own]
        return [*self.loops, *attacks, *(self.members.loops if self.members else ())]

    @property
    def outcome(self) -> Outcome:
        """What all runs came to; a loop that is not meant to stay in the tube has no say but by a broken promise."""
        found = self.followed
        tested = [own.comparison for own in found if own.loop.adapts]
        if any(own.comparison.violations for own in found):
            return "falsified"
        if any(own.left_the_tube for own in tested):
            return "tube left"
        if any(own.no_result for own in tested):
            return "no result"
        if self.interrupted:
            return "interrupted"
        return "not falsified" if any(own.loop.covered for own in found) else "nothing claimed"

    def summary(self, certificate: str) -> Json:
        """What `summary.json` holds; `certificate` is the hash of the one that was compared with."""
        own = self.setting
        bounds = {name: getattr(own.uncertainty, name) for name in ("h", "h_x", "h_t", "h_initial")}
        return {
            "format": FORMAT,
            "name": own.spec.name,
            "outcome": self.outcome,
            "certificate": certificate,
            "horizon": own.horizon,
            "rho": own.rho,
            "dbar": own.reach,
            "uncertainty": self.uncertainty,
            "class": bounds,
            "seed": self.seed,
            "loops": [item.data | {"obstacles": to_json(item.obstacles)} for item in self.loops],
            "attacks": [_attack_data(item, own) for item in self.attacks],
            "obstacles": {"plan": to_json(of_plan(own)), "tube": to_json(of_tube(own))},
            **({} if self.members is None else {"members": self.members.data}),
        }


def _attack_data(attack: Attack, setting: Setting) -> dict[str, object]:
    """Random runs and the adversary of a loop; h of the latter is a wave in x and t (`loops.Disturbance`)."""
    found, most = attack.adversary, attack.greatest
    data = attack.loop.data | {
        "largest_distance_over_dbar": None if most is None else most / setting.reach,
        "random": {"asked": attack.random.asked, **to_json(attack.random.comparison)},
    }
    if found is not None and found.case is not None:
        start, h = found.case
        drawn = {"h": _WAVES} | ({"beside": _BESIDE} if setting.uncertainty.beside else {})
        waves = {of: {name: getattr(h, name)[..., 0].tolist() for name in drawn[of]} for of in drawn}
        data["adversary"] = {**to_json(found.comparison), "start": start[:, 0].tolist(), **waves}
    return data


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
    tested = [loop for loop in loops if loop.adapts] if count else []
    vectors = vectors_of(count if tested else 0, min(_FIRST, LANES), LANES)
    work = partial(_vector, setting, loops, own, seed)
    found = finished(work, vectors, executor, report, "loops and random runs")
    parts, complete = [runs[len(runs) - len(tested) :] for runs in found], len(found) == len(vectors)
    drawn = [Followed.judged(setting, "one", *each) for each in zip(loops, found[0], strict=False)]
    if setting.h is not None and replay is None:
        where = "simulation.h" if setting.spec.simulation and setting.spec.simulation.h else "uncertainty.h"
        for item in drawn:
            check_class(setting, item.runs, setting.h, where)
    lost = [item.loop for item in drawn if item.comparison.no_result]
    attacks = []
    for loop, *sample in zip(tested, *parts, strict=True):
        attack = Attack(random=replace(Followed.judged(setting, "random", loop, joined(sample)), asked=count))
        if complete and loop not in lost:
            with suppress(KeyboardInterrupt):
                attack = replace(attack, adversary=_adversary(setting, attack.random, seed, report))
            complete = attack.adversary is not None
        attacks.append(attack)
    return Campaign(
        setting=setting,
        uncertainty=SPECIFIED if replay is None else RANDOM.format(run=replay, seed=seed),
        loops=tuple(replace(item, obstacles=of_run(setting, item.runs)) for item in drawn),
        attacks=tuple(attacks),
        seed=seed,
        interrupted=not complete,
    )


def _specified(setting: Setting) -> Cases:
    """Start and h of the specification."""
    own = usual(setting.uncertainty, Disturbance.from_expressions(setting.h, setting.model, 1))
    return Cases(setting.started(np.ones((len(setting.x0), 1))), own)


def _vector(setting: Setting, loops: Sequence[Loop], own: Cases, seed: int, numbers: range) -> list[Runs]:
    """Some random runs of every loop that adapts; before the first of them those of all loops that are drawn."""
    drawn = [(loop, own) for loop in loops if not numbers.start]
    random = [(loop, cases(setting, seed, numbers)) for loop in loops if loop.adapts and numbers]
    found = integrate(drawn + random, tolerance=setting.tolerance)
    return [*found[: len(drawn)], *(runs.with_only(_KEPT) for runs in found[len(drawn) :])]


def _adversary(setting: Setting, random: Followed, seed: int, report: Progress | None) -> Followed:
    """The worst run that a search finds."""
    found = worst(setting, random.loop, seed, random.runs, report)
    (runs,) = integrate([(random.loop, found)], tolerance=setting.tolerance)
    return replace(Followed.judged(setting, "adversary", random.loop, runs), case=found)


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
    tested = [loop for loop in loops if loop.adapts]
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
    return Members(
        asked=asked,
        plans=len(defects),
        runs_each=each,
        largest_defect=max(defects),
        loops=tuple(
            Followed.judged(setting, "other plans", loop, joined(parts))
            for loop, *parts in zip(tested, *found, strict=True)
        ),
    )


def _along(
    setting: Setting, loops: Sequence[Loop], plans: Sequence[Plan], seed: int, each: int, first: int
) -> list[Runs]:
    """Every loop along all plans, from this number on."""
    batches = list[list[Batch]]()
    for number, plan in enumerate(plans, first):
        own = cases(setting.along(plan), seed, range(number * each, (number + 1) * each))
        batches.append([(replace(loop, plan=plan), own) for loop in loops])
    runs = integrate([batch for part in batches for batch in part], tolerance=setting.tolerance)
    return [joined([run.with_only(_KEPT) for run in runs[i :: len(loops)]]) for i in range(len(loops))]

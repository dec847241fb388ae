"""All that one command simulates: every loop under the uncertainty that is drawn, then attacks on the loops that adapt.

Loops and random runs are one vector of lanes, or several where there are many. Interruption keeps what is finished;
`interrupted` says that something is missing. The words are chosen with care: a simulation that finds nothing has not
falsified anything, and that is all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from math import ceil
from typing import Final, Literal

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.executor import Executor, Serial
from tubecert.progress import Progress
from tubecert.records import Json, to_json
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.judge import Comparison, check_class, compare, of_plan, of_run, of_tube
from tubecert.simulation.adaptive.loops import Batch, Cases, Disturbance, Loop, Runs, joined, mapped
from tubecert.simulation.adaptive.setting import Setting
from tubecert.simulation.adaptive.uncertainty import acting, adversaries, random_members
from tubecert.simulation.told import Clearance
from tubecert.simulation.vectors import finished, tell, vectors_of
from tubecert.trajectory import Plan

FORMAT: Final = "tubecert-simulation/1"
LANES: Final = 128  # random runs of a vector: they are kept, and told of, when all of them are finished
_POPULATION, _ELITE, _ROUNDS = 256, 12, 4
_COARSER: Final = 3  # times: the steps of runs that are only compared
_MOVED: Final = 0.3  # of the width of a gene, at first
_FIRST: Final = 8  # of the first vector: who interrupts soon has these, and the loops that are drawn
_KEPT: Final = ("x", "off", "distance")  # of random runs, at the output times
_PLANS: Final = 25  # random plans whose runs are one vector
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

    @property
    def data(self) -> dict[str, object]:
        """The loop and its comparison."""
        return {**self.loop.data, **to_json(self.comparison)}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attack:
    """What random runs and the adversary found against a loop."""

    random: Followed
    adversary: Followed | None = None

    def data(self, setting: Setting) -> dict[str, object]:
        """As it is told; h of the adversary is a wave in x and t (`loops.Disturbance`)."""
        random, found = self.random, self.adversary
        uses = [own.comparison.worst.get("distance") for own in (random, found) if own]
        most = max((use.value for use in uses if use), default=None)
        data = random.loop.data | {
            "largest_distance_over_dbar": None if most is None else most / setting.reach,
            "random": {"asked": random.asked, **to_json(random.comparison)},
        }
        if found is not None and found.case is not None:
            start, h = found.case
            drawn = {"h": _WAVES} | ({"beside": _BESIDE} if setting.uncertainty.beside else {})
            waves = {of: {name: getattr(h, name)[..., 0].tolist() for name in drawn[of]} for of in drawn}
            data["adversary"] = {**to_json(found.comparison), "start": start[:, 0].tolist(), **waves}
        return data


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
        return "not falsified" if any(own.loop.promise for own in found) else "nothing claimed"

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
            "attacks": [item.data(own) for item in self.attacks],
            "obstacles": {"plan": to_json(of_plan(own)), "tube": to_json(of_tube(own))},
            **({} if self.members is None else {"members": self.members.data}),
        }


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
    drawn = [_judged(setting, "one", *each) for each in zip(loops, found[0], strict=False)]
    if setting.h is not None and replay is None:
        where = "simulation.h" if setting.spec.simulation and setting.spec.simulation.h else "uncertainty.h"
        for item in drawn:
            check_class(setting, item.runs, setting.h, where)
    lost, attacks = [item.loop for item in drawn if item.comparison.no_result], []
    for loop, *sample in zip(tested, *parts, strict=True):
        random = _judged(setting, "random", loop, joined(sample), asked=count)
        adversary = None
        if complete and loop not in lost:
            with suppress(KeyboardInterrupt):
                case = worst(setting, loop, seed, random.runs, report)
                (runs,) = integrate([(setting, loop, case)], tolerance=setting.tolerance)
                adversary = _judged(setting, "adversary", loop, runs, case=case)
            complete = adversary is not None
        attacks.append(Attack(random=random, adversary=adversary))
    return Campaign(
        setting=setting,
        uncertainty=SPECIFIED if replay is None else RANDOM.format(run=replay, seed=seed),
        loops=tuple(drawn),
        attacks=tuple(attacks),
        seed=seed,
        interrupted=not complete,
    )


def _judged(
    setting: Setting, kind: Kind, loop: Loop, runs: Runs, asked: int = 0, case: Cases | None = None
) -> Followed:
    """Runs beside what is promised of their loop, and of one that is drawn beside obstacles."""
    own, near = compare(setting, runs, loop.promise), of_run(setting, runs) if kind == "one" else ()
    return Followed(kind=kind, loop=loop, runs=runs, comparison=own, asked=asked, obstacles=near, case=case)


def _specified(setting: Setting) -> Cases:
    """Start and h of the specification, beside a wind, if there is any, that blows outward and does not turn."""
    genes = np.full((setting.uncertainty.beside, 1), 0.5)
    genes[1:2] = 0.0
    h = Disturbance.from_expressions(setting.h, setting.model, 1)
    return Cases(setting.started(np.ones((len(setting.x0), 1))), acting(setting.uncertainty, h, genes))


def _vector(setting: Setting, loops: Sequence[Loop], own: Cases, seed: int, numbers: range) -> list[Runs]:
    """Some random runs of every loop that adapts; before the first of them those of all loops that are drawn."""
    drawn = [(setting, loop, own) for loop in loops if not numbers.start]
    random = [(setting, loop, cases(setting, seed, numbers)) for loop in loops if loop.adapts and numbers]
    found = integrate(drawn + random, tolerance=setting.tolerance)
    return [*found[: len(drawn)], *(runs.with_only(_KEPT) for runs in found[len(drawn) :])]


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
    tested, parts = [loop for loop in loops if loop.adapts], list[tuple[list[Runs], list[float]]]()

    def along(numbers: range) -> tuple[list[Runs], list[float]]:
        batches, drawn = list[Batch](), [*islice(plans, len(numbers) // each)]
        for place, (plan, _) in enumerate(drawn, 1 + numbers.start // each):
            own = setting.along(plan)
            case = cases(own, seed, range(place * each, (place + 1) * each))
            batches += [(own, loop, case) for loop in tested]
        runs = [own.with_only(_KEPT) for own in integrate(batches, tolerance=setting.tolerance)]
        return [joined(runs[i :: len(tested)]) for i in range(len(tested))], [defect for _, defect in drawn]

    with suppress(KeyboardInterrupt):
        vectors = vectors_of(asked * each, _PLANS * each, _PLANS * each)
        parts = finished(along, vectors, _HERE, report, "random plans of the family")
    if not parts:
        return None
    found, (runs, defects) = list[Followed](), zip(*parts, strict=True)
    for loop, *sample in zip(tested, *runs, strict=True):
        found.append(_judged(setting, "other plans", loop, joined(sample)))
    missed = [defect for own in defects for defect in own]
    return Members(
        asked=asked, plans=len(missed), runs_each=each, largest_defect=max(missed), loops=tuple(found)
    )


def cases(setting: Setting, seed: int, numbers: Sequence[int]) -> Cases:
    """What runs of a seed do, by their numbers: half are random members, half are random adversaries.

    Run i draws everything from its own generator, keyed by (seed, i): it can be repeated alone, and is the same run
    however many there are, however they are grouped, and whoever does them.
    """
    kind, n = setting.uncertainty, len(setting.x0)
    sizes = np.cumsum([1, kind.member, kind.adversary, kind.beside, n])
    seeds = [np.random.SeedSequence(entropy=seed, spawn_key=(number,)) for number in numbers]
    genes = np.stack([np.random.default_rng(each).random(sizes[-1] + 2) for each in seeds], axis=1)
    (coin,), own, aimed, beside, begin, (place, part) = np.split(genes, sizes)
    # the initial state, or points of the ball or the box that is allowed (its surface, half of the time)
    direction, outside = 2 * begin - 1, place < 0.5
    if not setting.within:
        direction = np.where(outside, np.sign(direction), direction)
    start = setting.started(direction, np.where(outside, 1.0, part ** (1 / n)))

    def drawn(offset: Array) -> Disturbance:
        both = random_members(kind, own, offset), adversaries(kind, aimed, offset)
        return mapped(lambda a, b: np.asarray(np.where(coin < 0.5, a, b)), *both)

    return _cases(setting, start, drawn, beside)


def _cases(setting: Setting, start: Array, drawn: Callable[[Array], Disturbance], beside: Array) -> Cases:
    """Members of the class, which is one of functions of z = S (x - centre), as functions of x.

    What they add up to is clipped beside a wind only: every h is in the class.
    """
    kind, N = setting.uncertainty, start.shape[1]
    h = drawn(setting.S @ (start - setting.centre[:, None]))
    wave = np.einsum("win,ij->wjn", h.wave, setting.S)
    h = h._replace(
        wave=wave,
        phase=h.phase - np.einsum("wjn,j->wn", wave, setting.centre),
        radius=np.full(N, kind.h if kind.beside else np.inf),
        layer=np.full(N, kind.layer),
    )
    return Cases(start, acting(kind, h, beside))


def bred(setting: Setting, genes: Array) -> Cases:
    """The adversaries that genes (G, N) in [0, 1] describe, and where their runs start."""
    kind = setting.uncertainty
    aimed, beside, begin = np.split(genes, np.cumsum([kind.adversary, kind.beside]))
    start = setting.started(2 * begin - 1 if setting.varied else np.zeros((len(setting.x0), genes.shape[1])))
    return _cases(setting, start, partial(adversaries, kind, aimed), beside)


def worst(setting: Setting, loop: Loop, seed: int, known: Runs, report: Progress | None = None) -> Cases:
    """The case with the largest distance that a short evolution of adversaries finds; deterministic for a seed.

    Its runs take a third of the steps of those that are `known`: what they find is a proposal. Children are mixtures of
    two of the best, moved a little; genes are mirrored at 0 and 1.
    """
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(2**31,)))
    kind, count = setting.uncertainty, ceil(np.median(known.found.steps) / _COARSER)
    size = kind.adversary + kind.beside + (len(setting.x0) if setting.varied else 0)
    genes = rng.random((_POPULATION, size))
    kept, scores = np.zeros((0, size)), np.zeros(0)
    for turn in range(_ROUNDS):
        tell(report, f"{loop.controller}, adversary", turn * _POPULATION, _ROUNDS * _POPULATION)
        batch = setting, loop, bred(setting, genes.T)
        (runs,) = integrate([batch], tolerance=setting.tolerance, count=count)
        found = np.nan_to_num(runs.found.peak.distance, nan=np.inf)
        pool, values = np.vstack([kept, genes]), np.concatenate([scores, found])
        order = np.argsort(-values, kind="stable")[:_ELITE]
        kept, scores = pool[order], values[order]
        one, other = kept[rng.integers(len(kept), size=(2, _POPULATION))]
        mixed = np.where(rng.random(genes.shape) < 0.5, one, other)
        moved = mixed + _MOVED * 0.5 ** (turn + 1) * rng.normal(size=mixed.shape)
        genes = np.abs(np.remainder(moved + 1, 2) - 1)
    return bred(setting, kept[:1].T)

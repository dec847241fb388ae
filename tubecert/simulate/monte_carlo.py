"""Many runs of one loop: random members of the class, random starts, and a search for the worst member.

Run i draws everything from its own generator, keyed by (seed, i): it can be repeated alone, and results depend neither
on the number of cores nor on how runs are grouped, nor on who does them. What is finished when the user interrupts is
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from itertools import pairwise, takewhile
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.executor import Executor, Serial
from tubecert.progress import Phase, Progress, Step
from tubecert.simulate.integrator import integrate
from tubecert.simulate.problem import Disturbance, LoopProblem
from tubecert.simulate.runs import Runs, joined
from tubecert.simulate.setting import Loop, Setting
from tubecert.simulate.uncertainty import Class, Member, adversary, assembled, genes_of, random_member

BATCH: Final = 32  # runs that are kept, and told of, when they are finished
FIRST: Final = 8  # of them: soon enough to say how long the others will take
TIMES: Final = 201  # output times of a run
_POPULATION, _POPULATION_IF_DEAR, _ELITE = 64, 16, 12
_ROUNDS: Final = 4
_FIT: Final = 10  # times the tolerance: a search only compares, what it finds is integrated again
_HERE: Final = Serial()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """One run: a start (n,) and a member of the class."""

    start: Array
    member: Member


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """Runs of a loop and their cases, in the order of their numbers; `asked` is how many there were to be."""

    runs: Runs
    cases: tuple[Case, ...]
    asked: int

    @property
    def interrupted(self) -> bool:
        """Whether some runs are missing."""
        return len(self.cases) < self.asked


def case(setting: Setting, kind: Class, seed: int, number: int) -> Case:
    """What run `number` of a seed does: half of the runs are random members, half are random adversaries."""
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(number,)))
    start = _random_start(setting, rng)
    S = setting.S
    centre, begin = S @ setting.centre, S @ start  # the class is one of functions of z
    if rng.random() < 0.5:
        member = random_member(kind, begin, centre, rng)
    else:
        member = adversary(kind, rng.random(genes_of(kind)), begin, centre, setting.layer)
    return Case(start=start, member=member)


def _random_start(setting: Setting, rng: np.random.Generator) -> Array:
    """The initial state, or a point of the ball or the box that is allowed (its surface, half of the time)."""
    n = len(setting.x0)
    if not setting.varied:
        return setting.x0
    if not setting.within:
        part = rng.uniform(-1, 1, n)
        return setting.started(np.sign(part) if rng.random() < 0.5 else part)
    direction = rng.normal(size=n)
    radius = 1.0 if rng.random() < 0.5 else rng.random() ** (1 / n)
    return setting.started(direction, radius)


def disturbance_of(setting: Setting, kind: Class, cases: Sequence[Case]) -> Disturbance:
    """One lane for each case."""
    members = [item.member for item in cases]
    found = assembled(members, kind, setting.centre, setting.layer)
    return replace(found, wave=found.wave @ setting.S)


def monte_carlo(
    setting: Setting,
    loop: Loop,
    count: int,
    seed: int,
    report: Progress | None = None,
    executor: Executor = _HERE,
) -> Sample | None:
    """`count` runs; fewer, or None, if the user interrupts: those before the first one that is missing."""
    starts = [0, *range(min(FIRST, BATCH), count, BATCH)]
    batches = [range(first, last) for first, last in pairwise([*starts, count])]
    found: dict[int, Runs] = {}

    def ready(place: int, runs: Runs) -> None:
        found[place] = runs
        tell()

    def tell() -> None:
        if report is not None:
            done = sum(part.lanes for part in found.values())
            name = f"{loop.controller}, random runs"
            report(Step(phase=Phase.SIMULATION, name=name, done=done, of=count))

    with suppress(KeyboardInterrupt):
        tell()
        executor.map(partial(along, setting, loop, seed), batches, ready)
    parts = [found[place] for place in takewhile(found.__contains__, range(len(batches)))]
    kind = setting.uncertainty
    cases = tuple(case(setting, kind, seed, number) for number in range(sum(part.lanes for part in parts)))
    return Sample(runs=joined(parts), cases=cases, asked=count) if parts else None


def along(setting: Setting, loop: Loop, seed: int, numbers: Sequence[int]) -> Runs:
    """The runs of some numbers, without what only drawings need."""
    kind = setting.uncertainty
    cases = [case(setting, kind, seed, number) for number in numbers]
    return _slim(_run(setting, kind, with_times(loop.problem, TIMES), cases, setting.tolerance))


def _run(
    setting: Setting, kind: Class, problem: LoopProblem, cases: Sequence[Case], tolerance: float
) -> Runs:
    starts = np.array([item.start for item in cases])
    return integrate(problem, starts, disturbance_of(setting, kind, cases), tolerance=tolerance)


def _slim(runs: Runs) -> Runs:
    """Runs without what only drawings need: many of them fit into memory."""
    return replace(
        runs,
        k=runs.k[:, :0],
        u_a=runs.u_a[:, :0],
        sigma_hat=runs.sigma_hat[:, :0],
        h=runs.h[:, :0],
        xtilde=runs.xtilde[:, :0],
    )


@lru_cache(maxsize=4)
def with_times(problem: LoopProblem, count: int) -> LoopProblem:
    """The problem with another number of output times, the same one for all batches, which share its levels."""
    return replace(problem, times=np.linspace(0.0, problem.horizon, count))


def attack(setting: Setting, loop: Loop, seed: int, report: Progress | None = None) -> Case:
    """The case with the largest distance that a short evolution of adversaries finds; deterministic for a seed.

    The evolution's own runs are known up to ten times the tolerance: what they find is a proposal.
    """
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(2**31,)))
    problem, kind = with_times(loop.problem, 2), setting.uncertainty
    size = genes_of_case(setting, kind)
    population = _POPULATION_IF_DEAR if setting.dear else _POPULATION
    genes, worst = rng.random((population, size)), np.full(population, -np.inf)
    kept = np.zeros((0, size))
    scores = np.zeros(0)
    for turn in range(_ROUNDS):
        if report is not None:
            name = f"{loop.controller}, adversary"
            report(Step(phase=Phase.SIMULATION, name=name, done=turn * population, of=_ROUNDS * population))
        cases = [bred(setting, kind, row) for row in genes]
        runs = _run(setting, kind, problem, cases, _FIT * setting.tolerance)
        worst = np.nan_to_num(runs.worst.distance.value, nan=np.inf)
        pool, values = np.vstack([kept, genes]), np.concatenate([scores, worst])
        order = np.argsort(-values, kind="stable")[:_ELITE]
        kept, scores = pool[order], values[order]
        genes = children(kept, population, 0.5 ** (turn + 1), rng)
    return bred(setting, kind, kept[0])


def children(parents: Array, count: int, spread: float, rng: np.random.Generator) -> Array:
    """Mixtures of two parents each, moved a little; genes are mirrored at 0 and 1."""
    chosen = rng.integers(len(parents), size=(2, count))
    take = rng.random((count, parents.shape[1])) < 0.5
    mixed = np.where(take, parents[chosen[0]], parents[chosen[1]])
    moved = mixed + 0.3 * spread * rng.normal(size=mixed.shape)
    folded = np.abs(np.remainder(moved + 1, 2) - 1)
    return np.asarray(folded)


def genes_of_case(setting: Setting, kind: Class) -> int:
    """How many numbers describe an adversary and where its run starts."""
    return genes_of(kind) + (len(setting.x0) if setting.varied else 0)


def bred(setting: Setting, kind: Class, genes: Array) -> Case:
    """The case that `genes` in [0, 1] describe."""
    own = genes_of(kind)
    start = setting.started(2 * genes[own:] - 1) if setting.varied else setting.x0
    member = adversary(kind, genes[:own], setting.S @ start, setting.S @ setting.centre, setting.layer)
    return Case(start=start, member=member)

"""Batches of runs as lanes of one vector: steps are halved until the error of every lane is as small as is asked.

Two whole runs are compared. Only these tell the error: between two switches of a feedback a loop may amplify what was
lost in one step.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.continuous import Continuous
from tubecert.simulation.adaptive.lanes import Found, combined, follow, of_some
from tubecert.simulation.adaptive.loops import Batch, Runs
from tubecert.simulation.adaptive.times import START, steps

Places = NDArray[np.intp]
_LEVELS: Final = 7  # of steps: the last ones are 2^6 times shorter than the first
_AGREEING: Final = 0.02  # of the horizon: two levels that stop a lane this near to each other are believed
_LIVED: Final = 16  # steps that a lane must have come: what stops it earlier may be nothing but their length
_PATIENCE: Final = 2  # levels over which the change of a run must fall to less than half (theory: to 1/256)
_DOUBTFUL: Final = 5  # the level from which on a run that does not converge is given up
_ENOUGH: Final = 5.0  # tolerances that an error may be told to be: it is mostly far below
_LUCK: Final = 2.0  # times a change an error may be, where a feedback has kinks ...
_BEFORE: Final = 1 / 8  # ... and times the change before
_ESTIMATE: Final = 0.02  # of R_H, 1 % of what bounds |sigma_hat - h|: what sigma_hat and that peak may change


def integrate(batches: Sequence[Batch], *, tolerance: float, count: int | None = None) -> tuple[Runs, ...]:
    """The runs of every batch, all as lanes of one vector, to an error of about `tolerance` in |S x|, P = S'S.

    Batches are of the same model and times. A lane that diverges or has no geodesic is stopped, and the others go on.
    With a `count` of steps runs are proposals whose error is not known (inf), seen at their ends alone.
    """
    lanes = _Lanes(batches, count)
    best = _resolved(lanes, tolerance) if count is None else follow(lanes.system(np.arange(lanes.N), 0))
    runs = list[Runs]()
    for (problem, _), a, b in lanes.parts():
        plan = next(i for i, each in enumerate(lanes.plans) if each is problem.plan)
        x, u = (each[lanes.grid.outputs, START, :, plan] for each in (lanes.grid.plan.x, lanes.grid.plan.u))
        runs.append(Runs(t=lanes.times, x_plan=x, u_plan=u, found=of_some(best, slice(a, b))))
    return tuple(runs)


class _Lanes:
    """The lanes of all batches, which can be run in the steps of any level; `grid` is that of the first."""

    def __init__(self, batches: Sequence[Batch], count: int | None) -> None:
        first = batches[0][0]
        self._batches, self._P = batches, first.P
        self.plans = list({id(problem.plan): problem.plan for problem, _ in batches}.values())
        self._ends = np.cumsum([0, *(own.start.shape[1] for _, own in batches)]).tolist()
        self.N, self.times = self._ends[-1], first.times if count is None else np.array([0.0, first.horizon])
        self.grid = steps(first, 0, self.plans, count)
        gains = [problem.gains for problem, _ in batches]
        radius = [np.inf if own is None else own.projection_radius for own in gains]
        self._room = np.repeat(radius, np.diff(self._ends)) * _ESTIMATE

    def parts(self) -> list[tuple[Batch, int, int]]:
        """Every batch with its first lane, and the one after its last."""
        return list(zip(self._batches, self._ends, self._ends[1:], strict=False))

    def system(self, lanes: Places, level: int) -> Continuous:
        """Some of the lanes at a level."""
        some = [(batch, lanes[(lanes >= a) & (lanes < b)] - a) for batch, a, b in self.parts()]
        grid = steps(self._batches[0][0], level, self.plans) if level else self.grid
        own = [(problem, cases.of(each)) for (problem, cases), each in some if len(each)]
        return Continuous(own, grid, self.plans)

    def apart(self, lanes: Places, finer: Found, coarser: Found) -> tuple[Array, Array]:
        """|S x| of differences (K, N), and those of sigma_hat and its peak, of the room that they have, (N,)."""
        z = finer.seen["x"] - coarser.seen["x"]
        square = (z * (z if self._P is None else self._P @ z)).sum(axis=1)
        moved = np.sqrt(((finer.seen["sigma_hat"] - coarser.seen["sigma_hat"]) ** 2).sum(axis=1)).max(axis=0)
        with np.errstate(invalid="ignore"):  # lanes that were stopped at once have no peak
            peaks = np.abs(finer.peak["sigma_error"] - coarser.peak["sigma_error"])
        return np.sqrt(np.maximum(square, 0.0)), np.maximum(moved, peaks) / self._room[lanes]


def _resolved(vector: _Lanes, tolerance: float) -> Found:
    """All lanes, level after level of those that are not done.

    What is told of a lane's error is at most five tolerances, or it cannot be integrated so far. It is given up as soon
    as halving its steps no longer helps, which is so where the loop itself amplifies every difference.
    """
    lanes = np.arange(vector.N)
    best = follow(vector.system(lanes, 0))
    changes = np.full((_LEVELS, vector.N), np.inf)
    failed = np.zeros((_LEVELS, vector.N), dtype=bool)
    failed[0] = best.stopped > 0
    for level in range(1, _LEVELS):
        system, whole = vector.system(lanes, level), len(lanes) == vector.N
        coarser, finer = best if whole else of_some(best, lanes), follow(system)
        apart, beside = vector.apart(lanes, finer, coarser)
        change = np.nan_to_num(apart.max(axis=0), nan=np.inf)
        failed[level, lanes], changes[level, lanes] = finer.stopped > 0, change
        told = np.maximum(_LUCK * change, changes[level - 1, lanes] * _BEFORE if level > 1 else 0.0)
        finer.error[:] = np.where(failed[level, lanes], np.inf, told)
        beyond = ~(apart <= tolerance)
        first = vector.times[np.argmax(beyond, axis=0)]
        finer.unresolved[:] = np.where(beyond.any(axis=0), first, np.nan)
        best = finer if whole else combined([best, finer], _put(lanes))
        agree = np.abs(finer.ended - coarser.ended) <= _AGREEING * vector.times[-1]
        agree &= failed[level - 1, lanes] & (np.searchsorted(system.grid.start, finer.ended) >= _LIVED)
        near = (told <= _ENOUGH * tolerance) & (beside <= 1)
        done = np.where(failed[level, lanes], agree, near)
        if level >= _DOUBTFUL:
            done |= _hopeless(changes[: level + 1, lanes], failed[: level + 1, lanes])
        lanes = lanes[~done]
        if not len(lanes):
            break
    return best


def _put(lanes: Places) -> Callable[[Array, Array], Array]:
    """What replaces some lanes of an array by those of another."""

    def put(whole: Array, part: Array) -> Array:
        whole = whole.copy()
        whole[..., lanes] = part
        return whole

    return put


def _hopeless(changes: Array, failed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether smaller steps do not help: a change that stays, or a lane that is stopped at every level."""
    now, then = changes[-1], changes[-1 - _PATIENCE]
    stays = np.isfinite(now) & np.isfinite(then) & (now > 0.5 * then)
    return np.asarray(stays | failed[-1 - _PATIENCE :].all(axis=0))

"""Batches of runs as lanes of one vector: steps are halved until the error of every lane is as small as is asked.

Two whole runs are compared. Only these tell the error: between two switches of a feedback a loop may amplify what was
lost in one step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.continuous import Continuous
from tubecert.simulation.adaptive.loops import Batch, Found, Runs, lanes_of, of_some, put
from tubecert.simulation.adaptive.times import START, Grid, steps

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

    Batches are of the same problem, but for its plan. A lane that diverges or has no geodesic is stopped, and the
    others go on. With a `count` of steps runs are proposals whose error is not known (inf), seen at their ends alone.
    """
    vector = Vector(batches, count)
    lanes = np.arange(vector.ends[-1])
    best = vector.run(vector.grid, lanes) if count else _resolved(vector, lanes, tolerance)
    t, plans, runs = vector.times, vector.grid.plan, list[Runs]()
    for a, b in pairwise(vector.ends):
        x, u = (own[vector.grid.outputs, START, :, vector.lanes.plan[a]] for own in (plans.x, plans.u))
        runs.append(Runs(t=t, x_plan=x, u_plan=u, found=of_some(best, lanes[a:b])))
    return tuple(runs)


class Vector:
    """The lanes of all batches, which end before `ends`, with the `grid` of their first level."""

    def __init__(self, batches: Sequence[Batch], count: int | None = None) -> None:
        self._problem, gains = batches[0][0], [loop.gains for _, loop, _ in batches]
        self.times = self._problem.times if count is None else np.array([0.0, self._problem.horizon])
        self._plans = {id(problem.plan): problem.plan for problem, *_ in batches}
        loops = [(loop.adapts, loop.gains if loop.filters else None) for _, loop, _ in batches]
        self._loops, places = [*dict.fromkeys(loops)], [*self._plans]
        numbers = [places.index(id(problem.plan)) for problem, *_ in batches]
        self.lanes = lanes_of(batches, [*map(self._loops.index, loops)], numbers)
        sizes = [cases.start.shape[1] for *_, cases in batches]
        self.ends = np.cumsum([0, *sizes]).tolist()
        self._room = _ESTIMATE * np.repeat([own.projection_radius if own else np.inf for own in gains], sizes)
        self.grid = self.steps(0, count)

    def steps(self, level: int, count: int | None = None) -> Grid:
        """Those of a level."""
        return steps(self._problem, level, [*self._plans.values()], count)

    def run(self, grid: Grid, lanes: Places) -> Found:
        """Some of the lanes."""
        return Continuous(self._problem, self._loops, of_some(self.lanes, lanes), grid).followed()

    def apart(self, lanes: Places, finer: Found, coarser: Found) -> tuple[Array, Array]:
        """|S x| of differences (K, N), and those of sigma_hat and its peak, of the room that they have, (N,)."""
        z, turned = (getattr(finer.seen, name) - getattr(coarser.seen, name) for name in ("x", "sigma_hat"))
        moved = np.sqrt((turned**2).sum(axis=1)).max(axis=0)
        with np.errstate(invalid="ignore"):  # lanes that were stopped at once have no peak
            peaks = np.abs(finer.peak.sigma_error - coarser.peak.sigma_error)
        square = (z * (self._problem.P @ z)).sum(axis=1)
        return np.sqrt(np.maximum(square, 0.0)), np.maximum(moved, peaks) / self._room[lanes]


def _resolved(vector: Vector, lanes: Places, tolerance: float) -> Found:
    """All lanes, level after level of those that are not done.

    What is told of a lane's error is at most five tolerances, or it cannot be integrated so far. It is given up as soon
    as halving its steps no longer helps, which is so where the loop itself amplifies every difference.
    """
    best = vector.run(vector.grid, lanes)
    changes = np.full((_LEVELS, len(lanes)), np.inf)
    failed = np.zeros(changes.shape, dtype=bool)
    failed[0] = best.stopped > 0
    for level in range(1, _LEVELS):
        grid, coarser = vector.steps(level), of_some(best, lanes)
        finer = vector.run(grid, lanes)
        apart, beside = vector.apart(lanes, finer, coarser)
        change = np.nan_to_num(apart.max(axis=0), nan=np.inf)
        failed[level, lanes], changes[level, lanes] = finer.stopped > 0, change
        told = np.maximum(_LUCK * change, changes[level - 1, lanes] * _BEFORE if level > 1 else 0.0)
        finer.error[:] = np.where(failed[level, lanes], np.inf, told)
        beyond = ~(apart <= tolerance)
        first = vector.times[np.argmax(beyond, axis=0)]
        finer.unresolved[:] = np.where(beyond.any(axis=0), first, np.nan)
        put(best, lanes, finer)
        agree = np.abs(finer.ended - coarser.ended) <= _AGREEING * vector.times[-1]
        agree &= failed[level - 1, lanes] & (np.searchsorted(grid.start, finer.ended) >= _LIVED)
        near = (told <= _ENOUGH * tolerance) & (beside <= 1)
        done = np.where(failed[level, lanes], agree, near)
        if level >= _DOUBTFUL:
            then = changes[level - _PATIENCE, lanes]
            done |= np.isfinite(change) & np.isfinite(then) & (change > 0.5 * then)
            done |= failed[level - _PATIENCE : level + 1, lanes].all(axis=0)
        lanes = lanes[~done]
        if not len(lanes):
            break
    return best

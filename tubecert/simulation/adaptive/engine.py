"""The closed loops over many lanes: steps are halved until every lane's error estimate is small enough."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.continuous import Continuous
from tubecert.simulation.adaptive.problem import Batch
from tubecert.simulation.adaptive.runs import Failure, Peak, Runs, Worst
from tubecert.simulation.adaptive.times import START, Grid, steps
from tubecert.simulation.lanes import Found, follow
from tubecert.trajectory import Plan

_SEEN: Final = ("x", "slope", "k", "u_a", "sigma_hat", "h", "xtilde", "distance")  # at output times
_LEVELS: Final = 7  # of steps: the last ones are 2^6 times shorter than the first
_AGREEING: Final = 0.02  # of the horizon: two levels that stop a lane this near to each other are believed
_LIVED: Final = 16  # steps that a lane must have come: what stops it earlier may be nothing but their length
_PATIENCE: Final = 2  # levels over which the change of a run must fall to less than half (theory: to 1/256)
_DOUBTFUL: Final = 5  # the level from which on a run that does not converge is given up
_ENOUGH: Final = 5.0  # tolerances that an error may be told to be: it is mostly far below
_LUCK: Final = 2.0  # times a change an error may be, where k has kinks ...
_BEFORE: Final = 1 / 8  # ... and times the change before
_ESTIMATE: Final = 0.02  # of R_H, 1 % of what bounds |sigma_hat - h|: what sigma_hat and that peak may change


def integrate(batches: Sequence[Batch], *, tolerance: float, level: int | None = None) -> tuple[Runs, ...]:
    """The runs of every batch, all as lanes of one vector, to an error of about `tolerance` in |S x|, P = S'S.

    Batches have the same model and times. What is told of a run's error is mostly far above it, and may be five
    tolerances. A lane that cannot be integrated so far has a larger one, and `unresolved` says from when on; it is
    given up as soon as halving its steps no longer helps, which is so where the loop itself amplifies every difference.
    One that diverges or has no geodesic is stopped and listed in `failures`, and the others go on. With a `level` (0:
    the longest steps) runs are proposals on this level alone, whose error is not known: inf. ValueError for arguments
    that do not fit.
    """
    if not tolerance > 0:
        raise ValueError("tolerance must be positive")
    if not batches or any(not batch.beside(batches[0]) for batch in batches):
        raise ValueError("batches must be of the same model and times")
    lanes = _Lanes(batches)
    if level is None:
        lanes.halve(tolerance)
    else:
        lanes.grid = lanes.run(np.arange(lanes.N), level)
    return lanes.runs()


class _Lanes:
    """Lanes on their way down the levels; arrays have the lanes last, as in `lanes.Found`.

    Once a level has run, `grid` is that of the first, and `found` of every lane what its last one found.
    """

    found: Found
    grid: Grid

    def __init__(self, batches: Sequence[Batch]) -> None:
        self.batches, self.problem = batches, batches[0].problem
        self.plans = list({id(batch.problem.plan): batch.problem.plan for batch in batches}.values())
        self.ends = np.cumsum([0, *(len(batch.x0) for batch in batches)])
        self.N = int(self.ends[-1])
        self.error = np.full(self.N, np.inf)
        self.unresolved = np.full(self.N, np.nan)
        self.changes = np.full((_LEVELS, self.N), np.inf)
        self.failed = np.zeros((_LEVELS, self.N), dtype=bool)
        self.steps = np.zeros(self.N, dtype=np.int64)
        gains = [batch.problem.gains for batch in batches]
        radius = [np.inf if own is None else own.projection_radius for own in gains]
        self.room = np.repeat(radius, np.diff(self.ends)) * _ESTIMATE
        self.reasons = dict[int, str]()

    def halve(self, tolerance: float) -> None:
        """Level after level, of the lanes that are not done."""
        lanes = np.arange(self.N)
        self.grid = self.run(lanes, 0)
        for level in range(1, _LEVELS):
            before = self.found
            grid = self.run(lanes, level)
            lanes = lanes[~self._compare(lanes, before, grid, tolerance)]
            if not len(lanes):
                break

    def run(self, lanes: NDArray[np.intp], level: int) -> Grid:
        """Takes lanes over all steps of a level."""
        grid = steps(self.problem, level, self.plans)
        own = [batch.of(lanes[(lanes >= a) & (lanes < b)] - a) for batch, a, b in self._parts()]
        system = Continuous([batch for batch in own if len(batch.x0)], grid, self.plans)
        finer = follow(system, grid.start, grid.length, grid.outputs)
        for place in np.flatnonzero(finer.stopped):
            self.reasons[int(lanes[place])] = system.reason(int(place), int(finer.stopped[place]))
        self.found = finer if len(lanes) == self.N else _merged(self.found, finer, lanes)
        self.steps[lanes] = len(grid.start) - 1
        self.failed[level, lanes] = finer.stopped != 0
        return grid

    def _parts(self) -> list[tuple[Batch, int, int]]:
        ends = self.ends.tolist()
        return list(zip(self.batches, ends, ends[1:], strict=False))

    def _compare(
        self, lanes: NDArray[np.intp], coarser: Found, grid: Grid, tolerance: float
    ) -> NDArray[np.bool_]:
        """Estimates the errors of the finer runs of lanes, and says which of them are done."""
        own, level = self.found, grid.level
        apart = self._length(own.seen["x"][..., lanes] - coarser.seen["x"][..., lanes])
        change = np.nan_to_num(apart.max(axis=0), nan=np.inf)
        moved = own.seen["sigma_hat"][..., lanes] - coarser.seen["sigma_hat"][..., lanes]
        own_peak, its_peak = (found.peak["sigma_error"][lanes] for found in (own, coarser))
        moved = np.maximum(np.sqrt((moved**2).sum(axis=1)).max(axis=0), np.abs(own_peak - its_peak))
        failed, before = own.stopped[lanes] != 0, coarser.stopped[lanes] != 0
        agree = np.abs(own.ended[lanes] - coarser.ended[lanes]) <= _AGREEING * self.problem.horizon
        agree &= np.searchsorted(grid.start, own.ended[lanes]) >= _LIVED
        told = np.maximum(_LUCK * change, self.changes[level - 1, lanes] * _BEFORE if level > 1 else 0.0)
        self.error[lanes] = np.where(failed, np.inf, told)
        self.changes[level, lanes] = change
        beyond = ~(apart <= tolerance)
        first = self.problem.times[np.argmax(beyond, axis=0)]
        self.unresolved[lanes] = np.where(beyond.any(axis=0), first, np.nan)
        near = (told <= _ENOUGH * tolerance) & (moved <= self.room[lanes])
        done = np.where(failed, before & agree, near)
        return np.asarray(done | self._hopeless(lanes, level))

    def _length(self, z: Array) -> Array:
        """|S z| of (K, n, N), in the coordinates of the tube."""
        P = self.problem.P
        square = (z * (z if P is None else P @ z)).sum(axis=1)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def _hopeless(self, lanes: NDArray[np.intp], level: int) -> NDArray[np.bool_]:
        """Whether smaller steps do not help: a change that stays, or a lane that is stopped at every level."""
        if level < _DOUBTFUL:
            return np.zeros(len(lanes), dtype=bool)
        now, then = self.changes[level, lanes], self.changes[level - _PATIENCE, lanes]
        stays = np.isfinite(now) & np.isfinite(then) & (now > 0.5 * then)
        return np.asarray(stays | self.failed[level - _PATIENCE : level + 1, lanes].all(axis=0))

    def runs(self) -> tuple[Runs, ...]:
        """Batch by batch."""
        return tuple(self._runs(batch.problem.plan, slice(a, b)) for batch, a, b in self._parts())

    def _runs(self, plan: Plan, lanes: slice) -> Runs:
        found, grid, own = self.found, self.grid, next(i for i, each in enumerate(self.plans) if each is plan)
        times, stopped = found.peak_time, np.flatnonzero(found.stopped[lanes]) + lanes.start
        peaks = {name: Peak(value=peak[lanes], time=times[name][lanes]) for name, peak in found.peak.items()}
        seen = {name: np.moveaxis(part[..., lanes], -1, 0) for name, part in found.seen.items()}
        return Runs(
            t=np.array(self.problem.times, dtype=float),
            x_plan=grid.plan.x[grid.outputs, START, :, own],
            u_plan=grid.plan.u[grid.outputs, START, :, own],
            worst=Worst(**peaks),
            least=found.least[:, lanes].T,
            greatest=found.greatest[:, lanes].T,
            error=self.error[lanes],
            unresolved=self.unresolved[lanes],
            failures=tuple(
                Failure(lane=lane - lanes.start, t=float(found.ended[lane]), reason=self.reasons[lane])
                for lane in stopped.tolist()
            ),
            steps=self.steps[lanes],
            **{name: seen[name] for name in _SEEN},
        )


def _merged(coarser: Found, finer: Found, lanes: NDArray[np.intp]) -> Found:
    """The coarser lanes, with some of them replaced."""

    def put(whole: Array, part: Array) -> Array:
        whole = whole.copy()
        whole[..., lanes] = part
        return whole

    def each(whole: dict[str, Array], part: dict[str, Array]) -> dict[str, Array]:
        return {name: put(whole[name], part[name]) for name in whole}

    stopped = coarser.stopped.copy()
    stopped[lanes] = finer.stopped
    return Found(
        seen=each(coarser.seen, finer.seen),
        peak=each(coarser.peak, finer.peak),
        peak_time=each(coarser.peak_time, finer.peak_time),
        least=put(coarser.least, finer.least),
        greatest=put(coarser.greatest, finer.greatest),
        stopped=stopped,
        ended=put(coarser.ended, finer.ended),
    )

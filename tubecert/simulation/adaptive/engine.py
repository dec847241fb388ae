"""Batches of runs as lanes of one vector, integrated to an error that is asked for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.continuous import Continuous, reason
from tubecert.simulation.adaptive.loops import Batch, Failure, Runs
from tubecert.simulation.adaptive.times import START, steps
from tubecert.simulation.halving import Places, proposed, resolved
from tubecert.simulation.lanes import Found, of_some

_ESTIMATE: Final = 0.02  # of R_H, 1 % of what bounds |sigma_hat - h|: what sigma_hat and that peak may change


def integrate(batches: Sequence[Batch], *, tolerance: float, count: int | None = None) -> tuple[Runs, ...]:
    """The runs of every batch, all as lanes of one vector, to an error of about `tolerance` in |S x|, P = S'S.

    Batches are of the same model and times. A lane that diverges or has no geodesic is stopped and listed in
    `failures`, and the others go on. With a `count` of steps runs are proposals whose error is not known
    (`halving.proposed`), seen at their ends alone.
    """
    lanes = _Lanes(batches, count)
    best = resolved(lanes, tolerance) if count is None else proposed(lanes)
    runs = list[Runs]()
    for batch, a, b in lanes.parts():
        problem, found = batch.problem, of_some(best.found, slice(a, b))
        plan = next(i for i, each in enumerate(lanes.plans) if each is problem.plan)
        at = lanes.grid.steps.outputs, START, slice(None), plan
        runs.append(
            Runs(
                t=lanes.times,
                x_plan=lanes.grid.plan.x[at],
                u_plan=lanes.grid.plan.u[at],
                found=found,
                error=best.error[a:b],
                unresolved=best.unresolved[a:b],
                steps=best.steps[a:b],
                failures=tuple(
                    Failure(lane, float(found.ended[lane]), reason(int(found.stopped[lane]), problem.limit))
                    for lane in np.flatnonzero(found.stopped).tolist()
                ),
            )
        )
    return tuple(runs)


class _Lanes:
    """The lanes of all batches: a `halving.Vector`. `grid` is that of the first level."""

    def __init__(self, batches: Sequence[Batch], count: int | None) -> None:
        first = batches[0].problem
        self._batches, self._P = batches, first.P
        self.plans = list({id(batch.problem.plan): batch.problem.plan for batch in batches}.values())
        self._ends = np.cumsum([0, *(len(batch.x0) for batch in batches)]).tolist()
        self.N, self.times = self._ends[-1], first.times if count is None else np.array([0.0, first.horizon])
        self.grid = steps(first, 0, self.plans, count)
        gains = [batch.problem.gains for batch in batches]
        radius = [np.inf if own is None else own.projection_radius for own in gains]
        self._room = np.repeat(radius, np.diff(self._ends)) * _ESTIMATE

    def parts(self) -> list[tuple[Batch, int, int]]:
        """Every batch with its first lane, and the one after its last."""
        return list(zip(self._batches, self._ends, self._ends[1:], strict=False))

    def system(self, lanes: Places, level: int) -> Continuous:
        """Some of the lanes at a level."""
        own = [batch.of(lanes[(lanes >= a) & (lanes < b)] - a) for batch, a, b in self.parts()]
        grid = steps(self._batches[0].problem, level, self.plans) if level else self.grid
        return Continuous([batch for batch in own if len(batch.x0)], grid, self.plans)

    def apart(self, lanes: Places, finer: Found, coarser: Found) -> tuple[Array, Array]:
        """|S x| of differences, and those of sigma_hat and its peak, of the room that they have."""
        z = finer.seen["x"] - coarser.seen["x"]
        square = (z * (z if self._P is None else self._P @ z)).sum(axis=1)
        moved = np.sqrt(((finer.seen["sigma_hat"] - coarser.seen["sigma_hat"]) ** 2).sum(axis=1)).max(axis=0)
        with np.errstate(invalid="ignore"):  # lanes that were stopped at once have no peak
            peaks = np.abs(finer.peak["sigma_error"] - coarser.peak["sigma_error"])
        return np.sqrt(np.maximum(square, 0.0)), np.maximum(moved, peaks) / self._room[lanes]

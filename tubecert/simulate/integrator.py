"""The closed loops over many lanes: steps are halved until every lane's error estimate is small enough."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.expression import Expression
from tubecert.simulate.problem import Disturbance, LoopProblem
from tubecert.simulate.runs import Failure, Peak, Runs, Worst

if TYPE_CHECKING:
    from tubecert.simulate.stepping import Loop, Output

Progress = Callable[[int, int], None]
_MOST_HALVINGS = 14
_CHUNK = 16  # lanes that one thread takes at once
_AGREEING = 0.02  # of the horizon: two levels that stop a lane this near to each other are believed


def integrate(
    problem: LoopProblem,
    x0: Array,
    disturbance: Disturbance,
    *,
    tolerance: float,
    progress: Progress | None = None,
) -> Runs:
    """N runs from x0 (N, n) under a disturbance of N lanes, to an error of about `tolerance` in |x|.

    A lane that cannot be integrated so far has a larger `error` than asked for; one that diverges or has no geodesic is
    stopped and listed in `failures`, and the others go on. ValueError for arguments that do not fit. `progress` is told
    how many of how many lanes are done.
    """
    starts = np.ascontiguousarray(x0, dtype=float)
    N, n = starts.shape
    if n != len(problem.model.states) or disturbance.lanes != N or len(disturbance.centre) != n:
        raise ValueError(
            f"x0 of shape {starts.shape} does not fit the disturbance's {disturbance.lanes} lanes"
        )
    if disturbance.amplitude.shape[2] != len(problem.model.inputs):
        raise ValueError("the disturbance has another number of inputs than the model")
    if not tolerance > 0:
        raise ValueError("tolerance must be positive")
    if problem.controller == "nominal":
        disturbance = Disturbance.from_expressions(None, problem.model, N)
    return _Lanes(problem, starts, disturbance).halve(tolerance, progress)


class Ladder:
    """The levels of one problem, built when first needed and kept for its next batch of lanes."""

    def __init__(self, problem: LoopProblem, base: tuple[Expression, ...] | None) -> None:
        from tubecert.simulate import grid
        from tubecert.simulate.feedback import field

        self.problem = problem
        self.field = field(problem.model, base, problem.degree)
        self.computer = grid.computer(problem)
        self._levels: dict[int, Loop] = {}

    def level(self, number: int, disturbance: Disturbance) -> Loop:
        """The compiled loop's data at a level; ValueError if it has too many steps."""
        from tubecert.simulate import grid
        from tubecert.simulate.feedback import Force
        from tubecert.simulate.stepping import Loop

        d = disturbance
        parts = (d.amplitude, d.frequency, d.wave, d.phase, d.push, d.radius, d.centre)
        force = Force(*(np.ascontiguousarray(part, dtype=float) for part in parts), float(d.layer))
        if number not in self._levels:
            steps, lengths = grid.steps(self.problem, number)
            fast = grid.fast_part(self.problem, lengths, number)
            self._levels[number] = Loop(self.field, force, fast, self.computer, steps)
        return self._levels[number]._replace(force=force)


@lru_cache(maxsize=2)
def ladder(problem: LoopProblem, base: tuple[Expression, ...] | None) -> Ladder:
    """The levels of a problem; problems are told apart by identity."""
    return Ladder(problem, base)


class _Lanes:
    """Lanes on their way down the levels."""

    def __init__(self, problem: LoopProblem, starts: Array, disturbance: Disturbance) -> None:
        from tubecert.simulate.stepping import output

        self.problem, self.starts, self.disturbance = problem, starts, disturbance
        self.ladder = ladder(problem, disturbance.base)
        self.N, n = starts.shape
        self.found = output(self.N, len(problem.times), n, len(problem.model.inputs))
        self.error = np.full(self.N, np.inf)
        self.steps = np.zeros(self.N, dtype=np.int64)

    def halve(self, tolerance: float, progress: Progress | None) -> Runs:
        """Level after level, of the lanes that are not done."""
        lanes = np.arange(self.N)
        for number in range(_MOST_HALVINGS + 1):
            try:
                loop = self.ladder.level(number, self.disturbance.of(lanes))
            except ValueError:
                if number == 0:
                    raise
                break  # no more steps: the error estimates say how far it came
            done = self._compare(lanes, run(loop, self.starts[lanes]), number, tolerance)
            self.steps[lanes] = len(loop.grid.t) - 1
            lanes = lanes[~done]
            if progress is not None:
                progress(self.N - len(lanes), self.N)
            if not len(lanes):
                break
        return self._runs()

    def _compare(
        self, lanes: NDArray[np.intp], finer: Output, number: int, tolerance: float
    ) -> NDArray[np.bool_]:
        """Takes the finer runs, estimates their errors, and says which lanes are done."""
        coarser = self.found
        with np.errstate(invalid="ignore"):
            change = np.sqrt(np.sum((finer.x - coarser.x[lanes]) ** 2, axis=2)).max(axis=1)
        failed, before = finer.status != 0, coarser.status[lanes] != 0
        change = np.where(np.isnan(change), np.inf, change)
        with np.errstate(invalid="ignore"):
            agree = np.abs(finer.stop - coarser.stop[lanes]) <= _AGREEING * self.problem.horizon
        for ours, theirs in zip(coarser, finer, strict=True):
            ours[lanes] = theirs
        self.error[lanes] = np.where(failed, np.inf, change)
        if number == 0:
            return np.zeros(len(lanes), dtype=bool)
        return np.asarray(np.where(failed, before & agree, change <= tolerance))

    def _runs(self) -> Runs:
        from tubecert.simulate.stepping import PEAKS

        problem, found = self.problem, self.found
        loop = self.ladder.level(0, self.disturbance)
        at = [np.flatnonzero(loop.grid.output == k)[0] for k in range(len(problem.times))]
        peaks = {
            name: Peak(value=found.peak[:, i].copy(), time=found.peak_time[:, i].copy())
            for i, name in enumerate(PEAKS)
        }
        return Runs(
            t=np.array(problem.times, dtype=float),
            x=found.x,
            x_plan=loop.grid.plan.x[at, 0],
            u_plan=loop.grid.plan.u[at, 0],
            k=found.k,
            u_a=found.u_a,
            sigma_hat=found.sigma_hat,
            h=found.h,
            xtilde=found.xtilde,
            distance=found.distance,
            worst=Worst(**peaks),
            error=self.error,
            failures=tuple(self._failure(int(lane)) for lane in np.flatnonzero(found.status)),
            steps=self.steps,
        )

    def _failure(self, lane: int) -> Failure:
        from tubecert.simulate.feedback import INFEASIBLE
        from tubecert.simulate.geodesic import REASONS
        from tubecert.simulate.stepping import DIVERGED

        reasons = {
            **REASONS,
            INFEASIBLE: "no input makes the metric contract here",
            DIVERGED: "the state diverges from the plan",
        }
        return Failure(
            lane=lane, t=float(self.found.stop[lane]), reason=reasons[int(self.found.status[lane])]
        )


def run(loop: Loop, starts: Array) -> Output:
    """One level of some lanes, on all cores; the result does not depend on how many there are."""
    from tubecert.simulate import stepping

    N = len(starts)
    out = stepping.output(N, int(loop.grid.output.max()) + 1, loop.field.n, loop.field.m)
    chunk = max(1, min(_CHUNK, -(-N // _cores())))

    def work(first: int) -> None:
        last = min(first + chunk, N)
        stepping.run(first, last, loop, starts, stepping.work(loop.field), out)

    firsts = range(0, N, chunk)
    if len(firsts) == 1:
        work(0)
        return out
    pool = ThreadPoolExecutor(_cores())
    try:
        for _ in pool.map(work, firsts):
            pass
    finally:
        pool.shutdown(cancel_futures=True)
    return out


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

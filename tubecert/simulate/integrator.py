"""The closed loops over many lanes: steps are halved until every lane's error estimate is small enough."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.expression import Expression
from tubecert.simulate.loops import DESIGNS
from tubecert.simulate.problem import Disturbance, LoopProblem
from tubecert.simulate.runs import Failure, Peak, Runs, Worst

if TYPE_CHECKING:
    from tubecert.simulate.feedback import Point
    from tubecert.simulate.stepping import Lane, Output

_MOST_HALVINGS = 14
_CHUNK = 16  # lanes that one thread takes at once
_AGREEING = 0.02  # of the horizon: two levels that stop a lane this near to each other are believed
_LIVED = 16  # steps that a lane must have come: what stops it earlier may be nothing but their length
_PATIENCE = 2  # levels over which the change of a run must fall to less than half (theory: to 1/256)
_DOUBTFUL = 7  # the level from which on a run that does not converge is given up


def integrate(
    problem: LoopProblem,
    x0: Array,
    disturbance: Disturbance,
    *,
    tolerance: float,
) -> Runs:
    """N runs from x0 (N, n) under a disturbance of N lanes, to an error of about `tolerance` in |S x|, P = S'S.

    A lane that cannot be integrated so far has a larger `error` than asked for, and `unresolved` says from when on; it
    is given up as soon as halving its steps no longer helps, which is so where the loop itself amplifies every
    difference. One that diverges or has no geodesic is stopped and listed in `failures`, and the others go on.
    ValueError for arguments that do not fit.
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
    if not DESIGNS[problem.controller].disturbed:
        disturbance = Disturbance.from_expressions(None, problem.model, N)
    return _Lanes(problem, starts, disturbance).halve(tolerance)


class Ladder:
    """The levels of one problem, built when first needed and kept for its next batch of lanes."""

    def __init__(self, problem: LoopProblem, base: tuple[Expression, ...] | None) -> None:
        from tubecert.simulate.feedback import field

        self.problem = problem
        self.field, self.point = field(problem.model, base, problem.E, problem.rest, problem.degree)
        self._levels: dict[int, Lane] = {}

    def level(self, number: int, disturbance: Disturbance) -> Lane:
        """The compiled loop's data at a level; ValueError if it has too many steps."""
        from tubecert.simulate import grid
        from tubecert.simulate.feedback import force
        from tubecert.simulate.stepping import Lane

        acting = force(disturbance)
        if number not in self._levels:
            steps, lengths = grid.steps(self.problem, number)
            self._levels[number] = Lane(
                field=self.field,
                force=acting,
                fast=grid.fast_part(self.problem, lengths, number),
                flows=self.problem.adaptive,
                limit=self.problem.limit,
                grid=steps,
            )
        return self._levels[number]._replace(force=acting)


@lru_cache(maxsize=2)
def ladder(problem: LoopProblem, base: tuple[Expression, ...] | None) -> Ladder:
    """The levels of a problem; problems are told apart by identity."""
    return Ladder(problem, base)


class _Lanes:
    """Lanes on their way down the levels."""

    def __init__(self, problem: LoopProblem, starts: Array, disturbance: Disturbance) -> None:
        from tubecert.simulate.layout import layout
        from tubecert.simulate.stepping import output

        self.problem, self.starts, self.disturbance = problem, starts, disturbance
        self.ladder = ladder(problem, disturbance.base)
        self.N, n = starts.shape
        self.found = output(self.N, len(problem.times), layout(n, len(problem.model.inputs)))
        self.error = np.full(self.N, np.inf)
        self.unresolved = np.full(self.N, np.nan)
        self.changes = np.full((self.N, _MOST_HALVINGS + 1), np.inf)
        self.failed = np.zeros((self.N, _MOST_HALVINGS + 1), dtype=bool)
        self.steps = np.zeros(self.N, dtype=np.int64)

    def halve(self, tolerance: float) -> Runs:
        """Level after level, of the lanes that are not done."""
        lanes = np.arange(self.N)
        for number in range(_MOST_HALVINGS + 1):
            try:
                lane = self.ladder.level(number, self.disturbance.of(lanes))
            except ValueError:
                if number == 0:
                    raise
                break  # no more steps: the error estimates say how far it came
            finer = run(lane, self.ladder.point, self.starts[lanes], len(self.problem.times))
            self.steps[lanes] = len(lane.grid.start) - 1
            done = self._compare(lanes, finer, number, tolerance, lane.grid.start)
            lanes = lanes[~done]
            if not len(lanes):
                break
        return self._runs()

    def _compare(
        self, lanes: NDArray[np.intp], finer: Output, number: int, tolerance: float, start: Array
    ) -> NDArray[np.bool_]:
        """Takes the finer runs, estimates their errors, and says which lanes are done."""
        coarser = self.found
        apart = self._length(finer.x - coarser.x[lanes])
        change = apart.max(axis=1)
        change = np.where(np.isnan(change), np.inf, change)
        failed, before = finer.status != 0, coarser.status[lanes] != 0
        agree = np.abs(finer.ended - coarser.ended[lanes]) <= _AGREEING * self.problem.horizon
        agree &= np.searchsorted(start, finer.ended) >= _LIVED
        for ours, theirs in zip(coarser, finer, strict=True):
            ours[lanes] = theirs
        self.error[lanes] = np.where(failed, np.inf, change)
        self.changes[lanes, number], self.failed[lanes, number] = change, failed
        if number == 0:
            return np.zeros(len(lanes), dtype=bool)
        beyond = ~(apart <= tolerance)
        first = self.problem.times[np.argmax(beyond, axis=1)]
        self.unresolved[lanes] = np.where(beyond.any(axis=1), first, np.nan)
        done = np.where(failed, before & agree, change <= tolerance)
        return np.asarray(done | self._hopeless(lanes, number))

    def _length(self, z: Array) -> Array:
        """|S z| of the last axis, in the coordinates of the tube."""
        P = self.problem.P
        square = np.sum(z**2 if P is None else z * (z @ P), axis=-1)
        return np.asarray(np.sqrt(np.maximum(square, 0.0)))

    def _hopeless(self, lanes: NDArray[np.intp], number: int) -> NDArray[np.bool_]:
        """Whether smaller steps do not help: a change that stays, or a lane that is stopped at every level."""
        if number < _DOUBTFUL:
            return np.zeros(len(lanes), dtype=bool)
        changes, failed = self.changes[lanes], self.failed[lanes]
        now, then = changes[:, number], changes[:, number - _PATIENCE]
        stays = np.isfinite(now) & np.isfinite(then) & (now > 0.5 * then)
        return np.asarray(stays | failed[:, number - _PATIENCE : number + 1].all(axis=1))

    def _runs(self) -> Runs:
        from tubecert.simulate.stepping import PEAKS, START

        problem, found = self.problem, self.found
        grid = self.ladder.level(0, self.disturbance).grid
        at = [np.flatnonzero(grid.output == k)[0] for k in range(len(problem.times))]
        peaks = {
            name: Peak(value=found.peak[:, i].copy(), time=found.peak_time[:, i].copy())
            for i, name in enumerate(PEAKS)
        }
        return Runs(
            t=np.array(problem.times, dtype=float),
            x=found.x,
            x_plan=grid.plan.x[at, START],
            u_plan=grid.plan.u[at, START],
            k=found.k,
            u_a=found.u_a,
            sigma_hat=found.sigma_hat,
            h=found.h,
            xtilde=found.xtilde,
            distance=found.distance,
            worst=Worst(**peaks),
            least=found.least,
            greatest=found.greatest,
            error=self.error,
            unresolved=self.unresolved,
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
            DIVERGED: _diverged(self.problem),
        }
        found = self.found
        return Failure(lane=lane, t=float(found.ended[lane]), reason=reasons[int(found.status[lane])])


def _diverged(problem: LoopProblem) -> str:
    beyond = "" if np.isinf(problem.limit) else f": |x - x*| exceeds {near(problem.limit, 4)}"
    return f"the state diverges from the plan{beyond}"


def run(own: Lane, point: Point, starts: Array, outputs: int) -> Output:
    """One level of some lanes, on all cores; the result does not depend on how many there are."""
    from tubecert.simulate import stepping

    N, at = len(starts), own.fast.at
    out, stop = stepping.output(N, outputs, at), np.zeros(1)
    chunk = max(1, min(_CHUNK, -(-N // _cores())))

    def work(first: int, last: int) -> None:
        stepping.run(first, last, own, starts, stepping.work(own.fast, point, stop), out)

    work(0, 0)  # compiles, in a thread that Ctrl-C ends
    pool = ThreadPoolExecutor(_cores())
    try:
        for _ in pool.map(lambda first: work(first, min(first + chunk, N)), range(0, N, chunk)):
            pass
    finally:
        stop[:] = 1.0  # of an interruption: the lanes under way end at their next step
        pool.shutdown(cancel_futures=True)
    return out


def _cores() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

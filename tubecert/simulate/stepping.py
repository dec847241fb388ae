"""One lane from start to end: RK4 on the slow part, with the flow of the fast part inside every stage.

x' = f + B(u* + k + h) + B u_a. The stages are those of the exponential Runge-Kutta method of Krogstad: between them h (and
a moving B) are the polynomials of time through the stages so far, and the fast part flows under these. Without a fast part
this is classical RK4. Source: S. Krogstad, Generalized integrating factor methods for stiff PDEs, J. Comput. Phys. 203, 2005.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate import fast as quick
from tubecert.simulate.compiled import compiled
from tubecert.simulate.computer import Computer, adapt, control
from tubecert.simulate.fast import NONE, SAMPLED, Fast, Inner, advance
from tubecert.simulate.feedback import Field, Force, Point, evaluate, point, without_feedback
from tubecert.simulate.geodesic import FOUND
from tubecert.simulate.program import Index
from tubecert.simulate.small import dot

DIVERGED = 20
_FAR = 1e6
PEAKS = ("distance", "deviation", "u", "k", "xtilde", "sigma_error", "h")


class Course(NamedTuple):
    """The plan at start, middle and end of every step: x (S + 1, 3, n), u (S + 1, 3, m), drift f + B u (S + 1, 3, n)."""

    x: Array
    u: Array
    drift: Array


class Grid(NamedTuple):
    """Steps: `t` and `length` (S + 1,) in s (the last has length 0), `which` of the distinct lengths, `tick` 1 where a
    computer samples, `output` the number of the output time that the step starts at, or -1.
    """

    t: Array
    length: Array
    which: Index
    tick: Index
    output: Index
    plan: Course


class Loop(NamedTuple):
    """Everything that a compiled lane reads."""

    field: Field
    force: Force
    fast: Fast
    computer: Computer
    grid: Grid


class Work(NamedTuple):
    """Everything that a compiled lane writes to while it runs: state, stages, the fast part, held input."""

    x: Array
    at: Array
    y: Array
    y_end: Array
    w: Array
    h: Array
    B: Array
    held: Array
    u_now: Array
    gram: Array
    point: Point
    inner: Inner


class Output(NamedTuple):
    """What lanes leave behind: values at the output times, peaks and their times (N, 7), why and when it stopped (N,)."""

    x: Array
    k: Array
    u_a: Array
    sigma_hat: Array
    h: Array
    xtilde: Array
    distance: Array
    peak: Array
    peak_time: Array
    status: Index
    stop: Array


def work(field: Field) -> Work:
    """Fresh working memory of one thread."""
    n, m, Y = field.n, field.m, quick.size(field.n, field.m)
    return Work(
        np.zeros(n),
        np.zeros(n),
        np.zeros(Y),
        np.zeros(Y),
        np.zeros((4, n)),
        np.zeros((4, m)),
        np.zeros((4, n, m)),
        np.zeros(m),
        np.zeros(m),
        np.zeros((m, m)),
        point(field),
        quick.inner(n, m),
    )


def output(lanes: int, K: int, n: int, m: int) -> Output:
    """Nothing yet: nan, and no peaks."""

    def blank(*shape: int) -> Array:
        return np.full((lanes, *shape), np.nan)

    return Output(
        blank(K, n),
        blank(K, m),
        blank(K, m),
        blank(K, m),
        blank(K, m),
        blank(K, n),
        blank(K),
        np.zeros((lanes, len(PEAKS))),
        np.zeros((lanes, len(PEAKS))),
        np.zeros(lanes, dtype=np.int64),
        np.full(lanes, np.nan),
    )


@compiled
def run(first: int, last: int, loop: Any, starts: Any, work: Any, out: Any) -> None:
    """Runs the lanes first..last-1 from `starts` (N, n)."""
    for lane in range(first, last):
        work.x[:] = starts[lane]
        work.y[:] = 0.0
        work.point.curve.a[:] = 0.0
        _lane(lane, loop, work, out)


@compiled
def _lane(lane: int, loop: Any, work: Any, out: Any) -> None:
    grid, fast = loop.grid, loop.fast
    last, ticks = grid.t.shape[0] - 1, 0
    for s in range(last + 1):
        status, energy = evaluate(
            loop.field, loop.force, lane, grid.t[s], work.x, grid.plan, s, 0, work.point
        )
        if status == FOUND and not _near(work.x, grid.plan.x[s, 0]):
            status = DIVERGED
        if status != FOUND:
            out.status[lane], out.stop[lane] = status, grid.t[s]
            return
        if grid.tick[s]:
            if loop.computer.holds:
                u = grid.plan.u[s, 0]
                control(fast, loop.computer, ticks, work.x, u, work.point, work.y, work.held, work.gram)
            elif fast.kind == SAMPLED:
                adapt(fast, loop.computer, work.point.B, work.y, work.gram)
            ticks += 1
        _record(lane, s, np.sqrt(max(energy, 0.0)), loop, work, out)
        if s < last:
            status = _step(lane, s, loop, work)
            if status != FOUND:
                out.status[lane], out.stop[lane] = status, grid.t[s]
                return


@compiled
def _near(x: Any, plan: Any) -> bool:
    for i in range(x.shape[0]):
        if not abs(x[i] - plan[i]) <= _FAR * (1.0 + abs(plan[i])):
            return False
    return True


@compiled
def _step(lane: int, s: int, loop: Any, work: Any) -> int:
    """One step of x and y; the evaluation at its start is already in `work.point`."""
    grid, n = loop.grid, loop.field.n
    length, which = grid.length[s], grid.which[s]
    flows = loop.fast.kind != NONE and not loop.computer.holds
    v = work.y.shape[0] - n
    held_xhat = not flows
    _keep(0, s, 0, loop, work)
    for stage in range(1, 4):
        half = 1 if stage == 3 else 0
        share = length if half else 0.5 * length
        if flows:
            _line(work, stage - 1, 2.0 if half else 1.0)
            advance(loop.fast, share, which, half, work.y, work.inner, v, work.y_end)
        for i in range(n):
            gained = 0.0 if held_xhat else work.y_end[v + i]
            work.at[i] = work.x[i] + share * work.w[stage - 1, i] + gained
        t = grid.t[s] + share
        if loop.computer.holds and loop.force.push[lane] == 0.0:
            without_feedback(loop.field, loop.force, lane, t, work.at, work.point)
        else:
            status, _ = evaluate(loop.field, loop.force, lane, t, work.at, grid.plan, s, 1 + half, work.point)
            if status != FOUND:
                return DIVERGED if not _near(work.at, grid.plan.x[s, 1 + half]) else status
        _keep(stage, s, 1 + half, loop, work)
    if flows:
        _parabola(work)
        advance(loop.fast, length, which, 1, work.y, work.inner, 0, work.y_end)
    for i in range(n):
        gained = 0.0 if held_xhat else work.y_end[v + i]
        slope = work.w[0, i] + 2 * work.w[1, i] + 2 * work.w[2, i] + work.w[3, i]
        work.x[i] += length / 6 * slope + gained
    if flows:
        work.y[:v] = work.y_end[:v]
    return FOUND


@compiled
def _keep(stage: int, s: int, side: int, loop: Any, work: Any) -> None:
    """w = f + B(u* + k + h) of the stage, without u_a; h and B."""
    n, m, point = loop.field.n, loop.field.m, work.point
    for j in range(m):
        work.h[stage, j] = point.h[j]
        u = work.held[j] if loop.computer.holds else loop.grid.plan.u[s, side, j] + point.k[j]
        work.u_now[j] = u + point.h[j]
    for i in range(n):
        work.w[stage, i] = point.f[i]
        for j in range(m):
            work.B[stage, i, j] = point.B[i, j]
            work.w[stage, i] += point.B[i, j] * work.u_now[j]


@compiled
def _line(work: Any, stage: int, slope: float) -> None:
    """h and B run from those of the first stage to those of another, which lies at 1/slope of the time."""
    inner = work.inner
    inner.h[0], inner.h[2] = work.h[0], 0.0
    inner.B[0], inner.B[2] = work.B[0], 0.0
    for j in range(work.h.shape[1]):
        inner.h[1, j] = slope * (work.h[stage, j] - work.h[0, j])
        for i in range(work.B.shape[1]):
            inner.B[1, i, j] = slope * (work.B[stage, i, j] - work.B[0, i, j])


@compiled
def _parabola(work: Any) -> None:
    """h and B through start, the mean of the two stages in the middle, and the end."""
    inner = work.inner
    for j in range(work.h.shape[1]):
        a, b, c = work.h[0, j], 0.5 * (work.h[1, j] + work.h[2, j]), work.h[3, j]
        inner.h[0, j], inner.h[1, j], inner.h[2, j] = a, -3 * a + 4 * b - c, 2 * (a - 2 * b + c)
        for i in range(work.B.shape[1]):
            a, b, c = work.B[0, i, j], 0.5 * (work.B[1, i, j] + work.B[2, i, j]), work.B[3, i, j]
            inner.B[0, i, j], inner.B[1, i, j], inner.B[2, i, j] = a, -3 * a + 4 * b - c, 2 * (a - 2 * b + c)


@compiled
def _record(lane: int, s: int, distance: float, loop: Any, work: Any, out: Any) -> None:
    """Peaks at the start of the step, and the values if it is an output time."""
    n, m, fast, point, y = loop.field.n, loop.field.m, loop.fast, work.point, work.y
    plan_x, plan_u = loop.grid.plan.x[s, 0], loop.grid.plan.u[s, 0]
    k = work.u_now
    deviation, u, sigma_error = 0.0, 0.0, 0.0
    for i in range(n):
        deviation += (work.x[i] - plan_x[i]) ** 2
    for j in range(m):
        k[j] = work.held[j] - plan_u[j] - y[n + m + j] if loop.computer.holds else point.k[j]
        u += (plan_u[j] + k[j] + y[n + m + j]) ** 2
        sigma_error += (y[n + j] - point.h[j]) ** 2
    if fast.kind == NONE or fast.kind == quick.REFERENCE:
        sigma_error = 0.0
    _peak(lane, 0, distance, loop.grid.t[s], out)
    _peak(lane, 1, np.sqrt(deviation), loop.grid.t[s], out)
    _peak(lane, 2, np.sqrt(u), loop.grid.t[s], out)
    _peak(lane, 3, np.sqrt(dot(k, k)), loop.grid.t[s], out)
    _peak(lane, 4, np.sqrt(dot(y[:n], y[:n])), loop.grid.t[s], out)
    _peak(lane, 5, np.sqrt(sigma_error), loop.grid.t[s], out)
    _peak(lane, 6, np.sqrt(dot(point.h, point.h)), loop.grid.t[s], out)
    place = loop.grid.output[s]
    if place >= 0:
        out.x[lane, place], out.xtilde[lane, place] = work.x, y[:n]
        out.k[lane, place], out.h[lane, place] = k, point.h
        out.sigma_hat[lane, place], out.u_a[lane, place] = y[n : n + m], y[n + m : n + 2 * m]
        out.distance[lane, place] = distance


@compiled
def _peak(lane: int, which: int, value: float, t: float, out: Any) -> None:
    if value > out.peak[lane, which]:
        out.peak[lane, which], out.peak_time[lane, which] = value, t

"""One lane from start to end: RK4 on the slow part, with the flow of the fast part inside every stage.

x' = f + B(u* + k + h) + B u_a. The stages are those of the exponential Runge-Kutta method of Krogstad: between
them h (and a moving B) are the polynomials of time through the stages so far, and the fast part flows under these.
Without a fast part this is classical RK4. Source: S. Krogstad, Generalized integrating factor methods for stiff
PDEs, J. Comput. Phys. 203, 2005.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled, entry
from tubecert.simulate.computer import Computer, adapt, control
from tubecert.simulate.fast import ADAPTIVE, NONE, SAMPLED, Fast, Inner, advance, inner, size
from tubecert.simulate.feedback import Field, Force, Point, evaluate
from tubecert.simulate.geodesic import FOUND, Curve
from tubecert.simulate.program import Index
from tubecert.simulate.small import dot

DIVERGED = 20
_FAR = 1e6
PEAKS = ("distance", "deviation", "u", "k", "xtilde", "sigma_error", "h")


class Grid(NamedTuple):
    """Steps: `times` (S + 1, 2) are start and length in s, the last of length 0.

    `marks` (S + 1, 3): the number of the length, 1 where a computer samples, and the number of the output time at
    which the step starts, or -1. `plan` (S + 1, 3, 2 n + m): x*, f(x*) + B(x*)u* and u* at start, middle and end of
    every step.
    """

    times: Array
    marks: Index
    plan: Array


class Loop(NamedTuple):
    """Everything that a compiled lane reads."""

    field: Field
    force: Force
    fast: Fast
    computer: Computer
    grid: Grid


class Work(NamedTuple):
    """What a compiled lane writes to while it runs.

    `vectors` (6, n): x, where a stage is, and the four slopes w = f + B(u* + k + h); `h` (4, m) and `B` (4, n, m) of
    the stages; `y` (2, Y): the fast part at the start and at the end of a flow; `inputs` (2, m): u as held, and
    scratch.
    """

    vectors: Array
    h: Array
    B: Array
    y: Array
    inputs: Array
    gram: Array
    point: Point
    inner: Inner


class Output(NamedTuple):
    """What lanes leave behind; nan where they did not come.

    `values` (N, K, 2 n + 4 m + 1): x, xtilde, k, u_a, sigma_hat, h, distance at the output times; `peaks` (N, 7, 2):
    the largest values and their times; `ends` (N, 2): why (0: it did not) and when a lane stopped.
    """

    values: Array
    peaks: Array
    ends: Array


def work(point: Point) -> Work:
    """Fresh working memory of one thread; that of an evaluation is copied."""
    n, m = point.B.shape
    fresh = Point(
        point.memory.copy(),
        np.zeros(n),
        np.zeros((n, m)),
        np.zeros((3, m)),
        Curve(*(part.copy() for part in point.curve)),
    )
    return Work(
        np.zeros((6, n)),
        np.zeros((4, m)),
        np.zeros((4, n, m)),
        np.zeros((2, size(n, m))),
        np.zeros((2, m)),
        np.zeros((m, m)),
        fresh,
        inner(n, m),
    )


def output(lanes: int, K: int, n: int, m: int) -> Output:
    """Nothing yet."""
    ends = np.full((lanes, 2), np.nan)
    ends[:, 0] = FOUND
    return Output(np.full((lanes, K, 2 * n + 4 * m + 1), np.nan), np.zeros((lanes, len(PEAKS), 2)), ends)


@entry
def run(first: int, last: int, loop: Any, starts: Any, work: Any, out: Any) -> None:
    """Runs the lanes first..last-1 from `starts` (N, n)."""
    grid, fast, field = loop.grid, loop.fast, loop.field
    final = grid.times.shape[0] - 1
    flows = fast.kind != NONE and not loop.computer.holds
    x, at, y, v = work.vectors[0], work.vectors[1], work.y[0], work.y.shape[1] - work.vectors.shape[1]
    for lane in range(first, last):
        x[:] = starts[lane]
        work.y[:] = 0.0
        work.point.curve.a[:] = 0.0
        ticks, status = 0, FOUND
        for s in range(final + 1):
            t, length = grid.times[s]
            for stage in range(5):
                half = 0.5 if 0 < stage < 3 else 1.0
                share = 0.0 if stage == 0 else half * length
                side = 0 if stage == 0 else (1 if half == 0.5 else 2)
                if stage > 0 and flows:
                    _polynomials(work.h, work.B, stage, work.inner)
                    which, first_entry = 2 * grid.marks[s, 0] + side - 1, 0 if stage == 4 else v
                    advance(fast, share, which, y, work.inner, first_entry, work.y[1])
                if stage == 4:
                    break
                _stage_state(work, stage, share, flows)
                whole = stage == 0 or not loop.computer.holds
                plan = grid.plan[s, side]
                status, energy = evaluate(field, loop.force, lane, t + share, at, plan, whole, work.point)
                if not _near(at, plan):
                    status = DIVERGED
                if status != FOUND:
                    break
                if stage == 0:
                    if grid.marks[s, 1] == 1 and loop.computer.holds:
                        control(fast, loop.computer, ticks, x, plan, work.point, y, work.inputs[0], work.gram)
                    elif grid.marks[s, 1] == 1 and fast.kind == SAMPLED:
                        adapt(fast, loop.computer, work.point.B, y, work.gram)
                    ticks += grid.marks[s, 1]
                    _record(lane, grid.marks[s, 2], t, np.sqrt(max(energy, 0.0)), plan, loop, work, out)
                _keep(stage, plan, loop.computer.holds, work)
            if status != FOUND:
                out.ends[lane, 0], out.ends[lane, 1] = status, t
                break
            _finish(work, length, flows)


@compiled
def _near(x: Any, plan: Any) -> bool:
    near = True  # not for nan
    for i in range(x.shape[0]):
        near = near and abs(x[i] - plan[i]) <= _FAR * (1.0 + abs(plan[i]))
    return near


@compiled
def _stage_state(work: Any, stage: int, share: float, flows: bool) -> None:
    """Where the stage is: x, the slope of the stage before, and what u_a has added meanwhile."""
    n, v = work.vectors.shape[1], work.y.shape[1] - work.vectors.shape[1]
    for i in range(n):
        work.vectors[1, i] = work.vectors[0, i]
        if stage > 0:
            work.vectors[1, i] += share * work.vectors[1 + stage, i]
            if flows:
                work.vectors[1, i] += work.y[1, v + i]


@compiled
def _finish(work: Any, length: float, flows: bool) -> None:
    """The end of the step becomes the start of the next."""
    n, v = work.vectors.shape[1], work.y.shape[1] - work.vectors.shape[1]
    for i in range(n):
        slope = work.vectors[2, i] + 2 * work.vectors[3, i] + 2 * work.vectors[4, i] + work.vectors[5, i]
        work.vectors[0, i] += length / 6 * slope + (work.y[1, v + i] if flows else 0.0)
    if flows:
        work.y[0, :v] = work.y[1, :v]


@compiled
def _keep(stage: int, plan: Any, holds: bool, work: Any) -> None:
    """w = f + B(u* + k + h) of the stage, without u_a; h and B."""
    point, n, m = work.point, work.vectors.shape[1], work.h.shape[1]
    u = work.inputs[1]
    for j in range(m):
        work.h[stage, j] = point.inputs[0, j]
        u[j] = point.inputs[0, j] + (work.inputs[0, j] if holds else plan[2 * n + j] + point.inputs[1, j])
    for i in range(n):
        for j in range(m):
            work.B[stage, i, j] = point.B[i, j]
        work.vectors[2 + stage, i] = point.f[i] + dot(point.B[i], u)


@compiled
def _polynomials(h: Any, B: Any, stage: int, inner: Any) -> None:
    """h and B as polynomials of the time over the length of the flow.

    Before the last stage they are lines from the first stage whose mean is the stage before, as in classical RK4; at
    last they run through start, the mean of the two stages in the middle, and end.
    """
    for j in range(h.shape[1]):
        inner.h[0, j], inner.h[1, j], inner.h[2, j] = _through(h[0, j], h[1, j], h[2, j], h[3, j], stage)
        for i in range(B.shape[1]):
            inner.B[0, i, j], inner.B[1, i, j], inner.B[2, i, j] = _through(
                B[0, i, j], B[1, i, j], B[2, i, j], B[3, i, j], stage
            )


@compiled
def _through(a: float, b: float, c: float, d: float, stage: int) -> tuple[float, float, float]:
    if stage == 1:
        return a, 0.0, 0.0
    if stage == 2:
        return a, 2 * (b - a), 0.0
    if stage == 3:
        return a, 2 * (c - a), 0.0
    return a, -3 * a + 2 * (b + c) - d, 2 * (a - b - c + d)


@compiled
def _record(
    lane: int, place: int, t: float, distance: float, plan: Any, loop: Any, work: Any, out: Any
) -> None:
    """Peaks at the start of the step, and the values if it is an output time."""
    n, m, kind, holds = work.vectors.shape[1], work.h.shape[1], loop.fast.kind, loop.computer.holds
    x, y, h, k, u = work.vectors[0], work.y[0], work.point.inputs[0], work.point.inputs[1], work.inputs[1]
    sizes = np.zeros(7)
    sizes[0] = distance * distance
    for i in range(n):
        sizes[1] += (x[i] - plan[i]) ** 2
    for j in range(m):
        if holds:
            k[j] = work.inputs[0, j] - plan[2 * n + j] - y[n + m + j]
        u[j] = plan[2 * n + j] + k[j] + y[n + m + j]
        if kind >= ADAPTIVE:  # or sampled
            sizes[5] += (y[n + j] - h[j]) ** 2
    sizes[2], sizes[3], sizes[4], sizes[6] = dot(u, u), dot(k, k), dot(y[:n], y[:n]), dot(h, h)
    for q in range(7):
        value = np.sqrt(sizes[q])
        if value > out.peaks[lane, q, 0]:
            out.peaks[lane, q, 0], out.peaks[lane, q, 1] = value, t
    if place >= 0:
        values = out.values[lane, place]
        values[:n], values[n : 2 * n] = x, y[:n]
        for j in range(m):
            values[2 * n + j], values[2 * n + m + j] = k[j], y[n + m + j]
            values[2 * n + 2 * m + j], values[2 * n + 3 * m + j] = y[n + j], h[j]
        values[2 * n + 4 * m] = distance

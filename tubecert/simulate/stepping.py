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
from tubecert.simulate.computer import Computer, sample
from tubecert.simulate.fast import ADAPTIVE, NONE, Fast, Inner, advance, inner, size
from tubecert.simulate.feedback import Field, Force, Point, evaluate
from tubecert.simulate.geodesic import FOUND, copied, forget
from tubecert.simulate.program import Index
from tubecert.simulate.small import copy, dot

DIVERGED = 20
_FAR = 1e6
PEAKS = ("distance", "deviation", "u", "k", "xtilde", "sigma_error", "h")


class Grid(NamedTuple):
    """Steps: `times` (S + 1, 2) are start and length in s, the last of length 0.

    `marks` (S + 1, 3): the number of the length, and those of the computer's sample and of the output time at which the
    step starts, or -1. `plan` (S + 1, 3, 2 n + m): x*, f(x*) + B(x*)u* and u* at start, middle and end of
    every step.
    """

    times: Array
    marks: Index
    plan: Array


class Loop(NamedTuple):
    """Everything that a compiled lane reads; `holds`: the computer holds the whole controller.

    A lane is stopped where |x - x*| exceeds `limit`.
    """

    field: Field
    force: Force
    fast: Fast
    computer: Computer | None
    holds: bool
    limit: float
    grid: Grid


class Work(NamedTuple):
    """What a compiled lane writes to while it runs.

    `vectors` (6, n): x, where a stage is, and the four slopes w = f + B(u* + k + h); `h` (4, m) and `B` (4, n, m) of
    the stages; `y` (2, Y): the fast part at the start and at the end of a flow; `inputs` (2, m): what is held, and u;
    `sizes` (7,): what the peaks are taken of; `stop` (1,): not 0 if all lanes shall end now.
    """

    vectors: Array
    h: Array
    B: Array
    y: Array
    inputs: Array
    gram: Array
    sizes: Array
    stop: Array
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


def work(point: Point, stop: Array) -> Work:
    """Fresh working memory of one thread; that of an evaluation is copied, `stop` (1,) is shared."""
    n, m = point.B.shape
    fresh = Point(
        point.memory.copy(),
        np.zeros(n),
        np.zeros((n, m)),
        np.zeros((3, m)),
        copied(point.curve),
    )
    return Work(
        np.zeros((6, n)),
        np.zeros((4, m)),
        np.zeros((4, n, m)),
        np.zeros((2, size(n, m))),
        np.zeros((2, m)),
        np.zeros((m, m)),
        np.zeros(len(PEAKS)),
        stop,
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
    grid, fast, point, holds = loop.grid, loop.fast, work.point, loop.holds
    flows = fast.kind != NONE and not holds
    x, at, y, end, v = (
        work.vectors[0],
        work.vectors[1],
        work.y[0],
        work.y[1],
        work.y.shape[1] - starts.shape[1],
    )
    for lane in range(first, last):
        copy(x, starts[lane])
        work.y[:] = 0.0
        forget(point.curve.bend)
        status = FOUND
        for s in range(grid.times.shape[0]):
            t, length = grid.times[s]
            for stage in range(5):
                half = 0.5 if 0 < stage < 3 else 1.0
                share = 0.0 if stage == 0 else half * length
                side = 0 if stage == 0 else (1 if half == 0.5 else 2)
                if stage > 0 and flows:
                    _polynomials(work.h, work.B, stage, work.inner)
                    which, first_entry = 2 * grid.marks[s, 0] + side - 1, 0 if stage == 4 else v
                    advance(fast, share, which, y, work.inner, first_entry, end)
                if stage == 4:
                    break
                if work.stop[0] != 0.0:
                    return
                _stage_state(work.vectors, end, stage, share, flows)
                plan = grid.plan[s, side]
                if not _near(at, plan, loop.limit):
                    status = DIVERGED
                    break
                whole = stage == 0 or not holds
                status, energy = evaluate(loop.field, loop.force, lane, t + share, at, plan, whole, point)
                if status != FOUND:
                    break
                f, B, inputs, held = point.f, point.B, point.inputs, work.inputs[0]
                if stage == 0:
                    count, place, distance = grid.marks[s, 1], grid.marks[s, 2], np.sqrt(max(energy, 0.0))
                    if count >= 0:
                        sample(fast, loop.computer, count, x, plan, f, B, inputs, y, held, work.gram)
                    _sizes(fast.kind, holds, x, plan, y, inputs, work.inputs, work.sizes)
                    _record(lane, place, t, distance, x, y, inputs, work.sizes, out)
                _keep(plan, holds, held, f, B, inputs, work.h[stage], work.B[stage], work.vectors[2 + stage])
            if status != FOUND:
                out.ends[lane, 0], out.ends[lane, 1] = status, t
                break
            _finish(work.vectors, work.y, length, flows)


@compiled
def _near(x: Any, plan: Any, limit: float) -> bool:
    """Whether the state is anywhere near the plan: not if it is beyond the limit, or not finite."""
    near, square = True, 0.0
    for i in range(x.shape[0]):
        near = near and abs(x[i] - plan[i]) <= _FAR * (1.0 + abs(plan[i]))  # not for nan
        square += (x[i] - plan[i]) ** 2
    return near and square <= limit * limit


@compiled
def _stage_state(vectors: Any, y: Any, stage: int, share: float, flows: bool) -> None:
    """Where the stage is: x, the slope of the stage before, and what u_a has added meanwhile."""
    n = vectors.shape[1]
    v = y.shape[0] - n
    for i in range(n):
        vectors[1, i] = vectors[0, i]
        if stage > 0:
            vectors[1, i] += share * vectors[1 + stage, i]
            if flows:
                vectors[1, i] += y[v + i]


@compiled
def _finish(vectors: Any, y: Any, length: float, flows: bool) -> None:
    """The end of the step becomes the start of the next."""
    n = vectors.shape[1]
    v = y.shape[1] - n
    for i in range(n):
        slope = vectors[2, i] + 2 * vectors[3, i] + 2 * vectors[4, i] + vectors[5, i]
        vectors[0, i] += length / 6 * slope + (y[1, v + i] if flows else 0.0)
    for i in range(v if flows else 0):
        y[0, i] = y[1, i]


@compiled
def _keep(
    plan: Any, holds: bool, held: Any, f: Any, B: Any, inputs: Any, stage_h: Any, stage_B: Any, slope: Any
) -> None:
    """h and B of the stage, and its slope w = f + B(u* + k + h), without u_a."""
    n, m = B.shape
    for i in range(n):
        slope[i] = f[i]
        for j in range(m):
            stage_h[j], stage_B[i, j] = inputs[0, j], B[i, j]
            u = held[j] if holds else plan[2 * n + j] + inputs[1, j]
            slope[i] += B[i, j] * (u + inputs[0, j])


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
def _sizes(kind: int, holds: bool, x: Any, plan: Any, y: Any, inputs: Any, own: Any, sizes: Any) -> None:
    """What the peaks are taken of, but for the distance; k becomes what acts if a computer holds it."""
    n, m = x.shape[0], inputs.shape[1]
    h, k, u = inputs[0], inputs[1], own[1]
    sizes[:] = 0.0
    for i in range(n):
        sizes[1] += (x[i] - plan[i]) ** 2
    for j in range(m):
        if holds:
            k[j] = own[0, j] - plan[2 * n + j] - y[n + m + j]
        u[j] = plan[2 * n + j] + k[j] + y[n + m + j]
        if kind >= ADAPTIVE:  # or sampled
            sizes[5] += (y[n + j] - h[j]) ** 2
    sizes[2], sizes[3], sizes[4], sizes[6] = dot(u, u), dot(k, k), dot(y[:n], y[:n]), dot(h, h)
    for q in range(1, 7):
        sizes[q] = np.sqrt(sizes[q])


@compiled
def _record(
    lane: int, place: int, t: float, distance: float, x: Any, y: Any, inputs: Any, sizes: Any, out: Any
) -> None:
    """Peaks at the start of the step, and the values if it is an output time."""
    n, m = x.shape[0], inputs.shape[1]
    sizes[0] = distance
    for q in range(7):
        if sizes[q] > out.peaks[lane, q, 0]:
            out.peaks[lane, q, 0], out.peaks[lane, q, 1] = sizes[q], t
    if place >= 0:
        values = out.values[lane, place]
        copy(values[:n], x)
        copy(values[n : 2 * n], y[:n])
        for j in range(m):
            values[2 * n + j], values[2 * n + m + j] = inputs[1, j], y[n + m + j]
            values[2 * n + 2 * m + j], values[2 * n + 3 * m + j] = y[n + j], inputs[0, j]
        values[2 * n + 4 * m] = distance

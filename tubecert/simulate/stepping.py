"""One lane from start to end: RK4 on the slow part, with the flow of the fast part inside every stage.

x' = f + B(u* + k + h) + E w + B u_a, (0.1) with (0.4). The stages are those of the exponential Runge-Kutta method of
Krogstad: between them h (and a moving B) are the polynomials of time through the stages so far, and the fast part flows
under these. Without a fast part this is classical RK4. Source: S. Krogstad, Generalized integrating factor methods for
stiff PDEs, J. Comput. Phys. 203, 2005.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled, entry, folded, inlined
from tubecert.simulate.fast import Fast, Inner, advance, inner
from tubecert.simulate.feedback import Field, Force, Moment, Point, Reference, evaluate, point
from tubecert.simulate.geodesic import FOUND, copied, forget
from tubecert.simulate.layout import Layout, blocks
from tubecert.simulate.pointed import pointed
from tubecert.simulate.program import Index
from tubecert.simulate.small import copy, dot

DIVERGED = 20
STOPPED = 21
_FAR = 1e6
PEAKS = ("distance", "deviation", "u", "k", "xtilde", "sigma_error", "h", "speed")
_DISTANCE, _DEVIATION, _U, _K, _XTILDE, _SIGMA_ERROR, _H, _SPEED = range(8)  # their places
START, MIDDLE, END = range(3)  # of a step: the places of its plans


class Grid(NamedTuple):
    """Steps: `start` and `length` (S + 1,) in s, the last of length 0.

    `which` (S + 1,) is the number of the length, `output` that of the output time at which the step starts, or -1.
    `plan`: x* (S + 1, 3, n), f(x*) + B(x*)u* (S + 1, 3, n) and u* (S + 1, 3, m) at start, middle and end of every step.
    """

    start: Array
    length: Array
    which: Index
    output: Index
    plan: Reference


class Lane(NamedTuple):
    """Everything that a compiled lane reads; `flows`: there is a fast part. It is stopped where |x - x*| > `limit`."""

    field: Field
    force: Force
    fast: Fast
    flows: bool
    limit: float
    grid: Grid


class Stages(NamedTuple):
    """Of the four stages of a step: h (4, forces) as in `fast.Inner`, B (4, n, m), and the slopes (4, n)."""

    h: Array
    B: Array
    slope: Array


class Work(NamedTuple):
    """What a compiled lane writes to while it runs.

    `x` (n,) at the start of the step, `state` (n,) where a stage is. `y`, `end` (Y,): the fast part at the start and at
    the end of a flow. `u` (m,): the input that acts, but for a u_a that flows. `sizes` (8,): what the peaks are taken
    of. `stop` (1,): not 0 if all lanes shall end now.
    """

    x: Array
    state: Array
    y: Array
    end: Array
    u: Array
    sizes: Array
    stop: Array
    stages: Stages
    point: Point
    inner: Inner


class Output(NamedTuple):
    """What N lanes leave behind at K output times; nan where they did not come.

    x and xtilde (N, K, n), k, u_a, sigma_hat and h (N, K, m), distance (N, K). `peak` and `peak_time` (N, 8): the
    largest values and when they were met; `least` and `greatest` (N, m): of the inputs; `status` and `ended` (N,): why
    (0: it was not) and when a lane was stopped.
    """

    x: Array
    xtilde: Array
    k: Array
    u_a: Array
    sigma_hat: Array
    h: Array
    distance: Array
    peak: Array
    peak_time: Array
    least: Array
    greatest: Array
    status: Index
    ended: Array


def work(fast: Fast, shared: Point, stop: Array) -> Work:
    """Fresh working memory of one thread; that of an evaluation is copied, `stop` (1,) is shared."""
    at, forces = fast.at, fast.forces
    n, m, Y = at.n, at.m, at.size
    sizes = n, m, shared.E.shape[1]
    return Work(
        x=np.zeros(n),
        state=np.zeros(n),
        y=np.zeros(Y),
        end=np.zeros(Y),
        u=np.zeros(m),
        sizes=np.zeros(len(PEAKS)),
        stop=stop,
        stages=Stages(np.zeros((4, forces)), np.zeros((4, n, m)), np.zeros((4, n))),
        point=point(shared.memory.copy(), copied(shared.curve), sizes),
        inner=inner(at, forces),
    )


def output(lanes: int, K: int, at: Layout) -> Output:
    """Nothing yet."""

    def nothing(*shape: int) -> Array:
        return np.full((lanes, K, *shape), np.nan)

    return Output(
        x=nothing(at.n),
        xtilde=nothing(at.n),
        k=nothing(at.m),
        u_a=nothing(at.m),
        sigma_hat=nothing(at.m),
        h=nothing(at.m),
        distance=nothing(),
        peak=np.zeros((lanes, len(PEAKS))),
        peak_time=np.zeros((lanes, len(PEAKS))),
        least=np.full((lanes, at.m), np.inf),
        greatest=np.full((lanes, at.m), -np.inf),
        status=np.full(lanes, FOUND),
        ended=np.full(lanes, np.nan),
    )


@entry
def run(first: int, last: int, own: Lane, starts: Array, work: Work, out: Output) -> None:
    """Runs the lanes first..last-1 from `starts` (N, n)."""
    _run(first, last, pointed(own), starts, pointed(work), pointed(out))


@compiled
def _run(first: int, last: int, own: Lane, starts: Array, work: Work, out: Output) -> None:
    """The same for what is pointed to."""
    for lane in range(first, last):
        copy(work.x, starts[lane])
        work.y[:] = 0.0
        forget(work.point.curve.bend)
        for s in range(own.grid.start.shape[0]):
            status = _step(own, lane, s, work, out)
            if status == STOPPED:
                return
            if status != FOUND:
                out.status[lane], out.ended[lane] = status, own.grid.start[s]
                break


@inlined  # a level of calls less: what is linked is optimised again at each of them
def _step(own: Lane, lane: int, s: int, work: Work, out: Output) -> int:
    """One step of a lane, and what it leaves behind at the step's start; why it is stopped, if it is."""
    grid, fast, v = own.grid, own.fast, own.fast.at.v
    t, length = grid.start[s], grid.length[s]
    for stage in range(4):
        share = 0.0 if stage == 0 else (length if stage == 3 else 0.5 * length)
        side = START if stage == 0 else (END if stage == 3 else MIDDLE)
        if stage > 0 and own.flows:
            _polynomials(work.stages, stage, work.inner)
            advance(fast, share, 2 * grid.which[s] + side - 1, work.y, work.inner, v, work.end)
        if work.stop[0] != 0.0:
            return STOPPED
        _reach(work.x, work.stages.slope, work.end[v:], stage, share, own.flows, work.state)
        plan = Reference(grid.plan.x[s, side], grid.plan.speed[s, side], grid.plan.u[s, side])
        if not _near(work.state, plan.x, own.limit):
            return DIVERGED
        now = Moment(lane, t + share, work.state, plan)
        status, energy = evaluate(own.field, own.force, now, work.point)
        if status != FOUND:
            return int(status)
        if stage == 0:
            work.sizes[_DISTANCE] = np.sqrt(max(energy, 0.0))
            _begin(own, s, now, work, out)
        for j in range(work.u.shape[0]):
            work.u[j] = work.point.k[j] + plan.u[j]
        _keep(stage, work.point, work.u, work.stages)
        if stage == 0:
            _hurry(own, lane, t, work, out)
    if own.flows:
        _polynomials(work.stages, 4, work.inner)
        advance(fast, length, 2 * grid.which[s] + END - 1, work.y, work.inner, 0, work.end)
    _finish(work.x, work.stages.slope, work.y, work.end, length, v, own.flows)
    return FOUND


@inlined
def _begin(own: Lane, s: int, now: Moment, work: Work, out: Output) -> None:
    """What the lane leaves behind at the start of a step."""
    _measure_sizes(own, now, work)
    _peaks(now, work, out)
    if own.grid.output[s] >= 0:
        _record(own.fast, now, own.grid.output[s], work, out)


@folded
def _near(x: Array, plan: Reference, limit: float) -> bool:
    """Whether the state is anywhere near the plan: not if it is beyond the limit, or not finite."""
    near, square = True, 0.0
    for i in range(x.shape[0]):
        near = near and abs(x[i] - plan[i]) <= _FAR * (1.0 + abs(plan[i]))  # not for nan
        square += (x[i] - plan[i]) ** 2
    return near and square <= limit * limit


@folded
def _reach(x: Array, slope: Array, v: Array, stage: int, share: float, flows: bool, state: Array) -> None:
    """Where the stage is: x, the slope of the stage before, and v, what u_a has added meanwhile."""
    for i in range(x.shape[0]):
        state[i] = x[i]
        if stage > 0:
            state[i] += share * slope[stage - 1, i]
            if flows:
                state[i] += v[i]


@folded
def _finish(x: Array, slope: Array, y: Array, end: Array, length: float, v: int, flows: bool) -> None:
    """The end of the step becomes the start of the next: x by RK4 and v, and y but for v."""
    for i in range(x.shape[0]):
        mean = slope[0, i] + 2 * slope[1, i] + 2 * slope[2, i] + slope[3, i]
        x[i] += length / 6 * mean + (end[v + i] if flows else 0.0)
    for i in range(v if flows else 0):
        y[i] = end[i]


@folded
def _keep(stage: int, point: Point, u: Array, stages: Stages) -> None:
    """h and B of the stage, and its slope f + B(u + h) + E w, where u is without a u_a that flows."""
    n, m = point.plant.B.shape
    for i in range(n):
        stages.slope[stage, i] = point.plant.f[i]
        for j in range(m):
            stages.h[stage, j], stages.B[stage, i, j] = point.h[j], point.plant.B[i, j]
            stages.slope[stage, i] += point.plant.B[i, j] * (u[j] + point.h[j])
        stages.slope[stage, i] += point.wind[i]
        if stages.h.shape[1] > m:
            stages.h[stage, m + i] = point.wind[i]


@compiled
def _polynomials(stages: Stages, stage: int, inner: Inner) -> None:
    """h and B as polynomials of the time over the length of the flow.

    Before the last stage they are lines from the first stage whose mean is the stage before, as in classical RK4; at
    last they run through start, the mean of the two stages in the middle, and end.
    """
    h, B = stages.h, stages.B
    for j in range(h.shape[1]):
        inner.h[0, j], inner.h[1, j], inner.h[2, j] = _through(h[0, j], h[1, j], h[2, j], h[3, j], stage)
    for j in range(B.shape[2]):
        for i in range(B.shape[1]):
            inner.B[0, i, j], inner.B[1, i, j], inner.B[2, i, j] = _through(
                B[0, i, j], B[1, i, j], B[2, i, j], B[3, i, j], stage
            )


@compiled
def _through(a: float, b: float, c: float, d: float, stage: int) -> tuple[float, float, float]:
    """Coefficients of 1, s and s^2 of the polynomial before a stage, from the values a, b, c, d of the stages."""
    if stage == 1:
        return a, 0.0, 0.0
    if stage == 2:
        return a, 2 * (b - a), 0.0
    if stage == 3:
        return a, 2 * (c - a), 0.0
    return a, -3 * a + 2 * (b + c) - d, 2 * (a - b - c + d)


@compiled
def _length(P: Array, a: Array, b: Array) -> float:
    """|S (a - b)|."""
    square = 0.0
    for i in range(a.shape[0]):
        for k in range(a.shape[0]):
            square += P[i, k] * (a[i] - b[i]) * (a[k] - b[k])
    return float(np.sqrt(max(square, 0.0)))


@folded
def _measure_sizes(own: Lane, now: Moment, work: Work) -> None:
    """What the peaks are taken of, but for distance and speed."""
    fast, sizes, k, h = own.fast, work.sizes, work.point.k, work.point.h
    y, error = blocks(work.y, fast.at), 0.0
    for j in range(fast.at.m):
        work.u[j] = now.plan.u[j] + k[j] + y.u_a[j]
        if fast.terms.predicts:
            error += (y.sigma_hat[j] - h[j]) ** 2
    sizes[_DEVIATION] = _length(fast.P, now.x, now.plan.x)
    sizes[_U], sizes[_SIGMA_ERROR] = np.sqrt(dot(work.u, work.u)), np.sqrt(error)
    sizes[_K], sizes[_H] = np.sqrt(dot(k, k)), np.sqrt(dot(h, h))
    square = 0.0
    for i in range(fast.at.n):
        square += y.xtilde[i] * dot(fast.P[i], y.xtilde)
    sizes[_XTILDE] = np.sqrt(max(square, 0.0))


@compiled
def _peaks(now: Moment, work: Work, out: Output) -> None:
    """Peaks, and the extremes of the inputs, which are in `work.u`."""
    lane, sizes = now.lane, work.sizes
    for q in range(_SPEED):
        if sizes[q] > out.peak[lane, q]:
            out.peak[lane, q], out.peak_time[lane, q] = sizes[q], now.t
    for j in range(work.u.shape[0]):
        out.least[lane, j] = min(out.least[lane, j], work.u[j])
        out.greatest[lane, j] = max(out.greatest[lane, j], work.u[j])


@folded
def _hurry(own: Lane, lane: int, t: float, work: Work, out: Output) -> None:
    """The peak of the speed |S x'|, from the slope at the start of a step."""
    fast, speed = own.fast, work.stages.slope[0]
    u_a, P, square = blocks(work.y, fast.at).u_a, fast.P, 0.0
    for i in range(fast.at.n):
        work.state[i] = speed[i] + (dot(work.point.plant.B[i], u_a) if own.flows else 0.0)
    for i in range(fast.at.n):
        square += work.state[i] * dot(P[i], work.state)
    if square > out.peak[lane, _SPEED] ** 2:
        out.peak[lane, _SPEED], out.peak_time[lane, _SPEED] = np.sqrt(square), t


@folded
def _record(fast: Fast, now: Moment, place: int, work: Work, out: Output) -> None:
    """The values at an output time."""
    lane, own, point = now.lane, blocks(work.y, fast.at), work.point
    copy(out.x[lane, place], now.x)
    copy(out.xtilde[lane, place], own.xtilde)
    copy(out.k[lane, place], point.k)
    copy(out.u_a[lane, place], own.u_a)
    copy(out.sigma_hat[lane, place], own.sigma_hat)
    copy(out.h[lane, place], point.h)
    out.distance[lane, place] = work.sizes[_DISTANCE]

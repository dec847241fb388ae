"""One lane from start to end: RK4 on the slow part, with the flow of the fast part inside every stage.

x' = f + B(u* + k + h) + B u_a, (0.1) with (0.4). The stages are those of the exponential Runge-Kutta method of
Krogstad: between them h (and a moving B) are the polynomials of time through the stages so far, and the fast part flows
under these. Without a fast part this is classical RK4. Source: S. Krogstad, Generalized integrating factor methods for
stiff PDEs, J. Comput. Phys. 203, 2005.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled, entry
from tubecert.simulate.computer import Computer, Registers, sample
from tubecert.simulate.fast import Fast, Inner, advance, inner
from tubecert.simulate.feedback import Field, Force, Moment, Point, Reference, evaluate, point
from tubecert.simulate.geodesic import FOUND, copied, forget
from tubecert.simulate.layout import Layout, blocks
from tubecert.simulate.program import Index
from tubecert.simulate.small import copy, dot

DIVERGED = 20
STOPPED = 21
_FAR = 1e6
PEAKS = ("distance", "deviation", "u", "k", "xtilde", "sigma_error", "h")
_DISTANCE, _DEVIATION, _U, _K, _XTILDE, _SIGMA_ERROR, _H = range(7)  # their places
START, MIDDLE, END = range(3)  # of a step: the places of its plans


class Grid(NamedTuple):
    """Steps: `start` and `length` (S + 1,) in s, the last of length 0.

    `which` (S + 1,) is the number of the length, `sample` and `output` those of the computer's sample and of the output
    time at which the step starts, or -1. `plan`: x* (S + 1, 3, n), f(x*) + B(x*)u* (S + 1, 3, n) and u* (S + 1, 3, m)
    at start, middle and end of every step.
    """

    start: Array
    length: Array
    which: Index
    sample: Index
    output: Index
    plan: Reference


class Lane(NamedTuple):
    """Everything that a compiled lane reads.

    `holds`: the computer holds the whole controller; `flows`: the fast part moves between the samples; `exact`: the
    controller knows the state itself, else what is in `Work.measured`. A lane is stopped where |x - x*| exceeds
    `limit`.
    """

    field: Field
    force: Force
    fast: Fast
    computer: Computer | None
    holds: bool
    flows: bool
    exact: bool
    limit: float
    grid: Grid


class Stages(NamedTuple):
    """Of the four stages of a step: h (4, m), B (4, n, m), and the slopes w = f + B(u* + k + h) (4, n)."""

    h: Array
    B: Array
    slope: Array


class Work(NamedTuple):
    """What a compiled lane writes to while it runs.

    `x` (n,) at the start of the step, `state` (n,) where a stage is, `measured` (n,) what the controller knows of it:
    the same memory as long as it knows the state exactly. `y`, `end` (Y,): the fast part at the start and at the end of
    a flow. `u` (m,): the input that acts, but for a u_a that flows. `sizes` (7,): what the peaks are taken of. `stop`
    (1,): not 0 if all lanes shall end now.
    """

    x: Array
    state: Array
    measured: Array
    y: Array
    end: Array
    u: Array
    sizes: Array
    stop: Array
    stages: Stages
    kept: Registers
    point: Point
    inner: Inner


class Output(NamedTuple):
    """What N lanes leave behind at K output times; nan where they did not come.

    x and xtilde (N, K, n), k, u_a, sigma_hat and h (N, K, m), distance (N, K). `peak` and `peak_time` (N, 7): the
    largest values and when they were met; `status` and `ended` (N,): why (0: it was not) and when a lane was stopped.
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
    status: Index
    ended: Array


def work(at: Layout, shared: Point, stop: Array) -> Work:
    """Fresh working memory of one thread; that of an evaluation is copied, `stop` (1,) is shared."""
    n, m, Y = at.n, at.m, at.size
    state = np.zeros(n)
    return Work(
        x=np.zeros(n),
        state=state,
        measured=state,
        y=np.zeros(Y),
        end=np.zeros(Y),
        u=np.zeros(m),
        sizes=np.zeros(len(PEAKS)),
        stop=stop,
        stages=Stages(np.zeros((4, m)), np.zeros((4, n, m)), np.zeros((4, n))),
        kept=Registers(np.zeros(m), np.zeros(n), np.zeros((m, m))),
        point=point(shared.memory.copy(), copied(shared.curve), n, m),
        inner=inner(at),
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
        status=np.full(lanes, FOUND),
        ended=np.full(lanes, np.nan),
    )


@entry
def run(first: int, last: int, own: Any, starts: Any, work: Any, out: Any) -> None:
    """Runs the lanes first..last-1 from `starts` (N, n)."""
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


@compiled
def _step(own: Any, lane: int, s: int, work: Any, out: Any) -> int:
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
        now = Moment(lane, t + share, work.state, work.measured, plan)
        whole = stage == 0 or not own.holds
        status, energy = evaluate(own.field, own.force, own.exact, now, whole, work.point)
        if status != FOUND:
            return int(status)
        if stage == 0:
            if grid.sample[s] >= 0:
                sample(fast, own.computer, grid.sample[s], now, work.point, work.y, work.kept)
            work.sizes[_DISTANCE] = np.sqrt(max(energy, 0.0))
            if own.holds:
                _what_acts(fast, plan, work.point, work.y, work.kept)
            _measure_sizes(fast, now, work.point, work.y, work.sizes)
            _record(fast, now, grid.output[s], work.point, work.y, work.sizes, out)
        for j in range(work.u.shape[0]):
            work.u[j] = work.kept.u[j] if own.holds else plan.u[j] + work.point.k[j]
        _keep(stage, work.point, work.u, work.stages)
    if own.flows:
        _polynomials(work.stages, 4, work.inner)
        advance(fast, length, 2 * grid.which[s] + END - 1, work.y, work.inner, 0, work.end)
    _finish(work.x, work.stages.slope, work.y, work.end, length, v, own.flows)
    return FOUND


@compiled
def _near(x: Any, plan: Any, limit: float) -> bool:
    """Whether the state is anywhere near the plan: not if it is beyond the limit, or not finite."""
    near, square = True, 0.0
    for i in range(x.shape[0]):
        near = near and abs(x[i] - plan[i]) <= _FAR * (1.0 + abs(plan[i]))  # not for nan
        square += (x[i] - plan[i]) ** 2
    return near and square <= limit * limit


@compiled
def _reach(x: Any, slope: Any, v: Any, stage: int, share: float, flows: bool, state: Any) -> None:
    """Where the stage is: x, the slope of the stage before, and v, what u_a has added meanwhile."""
    for i in range(x.shape[0]):
        state[i] = x[i]
        if stage > 0:
            state[i] += share * slope[stage - 1, i]
            if flows:
                state[i] += v[i]


@compiled
def _finish(x: Any, slope: Any, y: Any, end: Any, length: float, v: int, flows: bool) -> None:
    """The end of the step becomes the start of the next: x by RK4 and v, and y but for v."""
    for i in range(x.shape[0]):
        mean = slope[0, i] + 2 * slope[1, i] + 2 * slope[2, i] + slope[3, i]
        x[i] += length / 6 * mean + (end[v + i] if flows else 0.0)
    for i in range(v if flows else 0):
        y[i] = end[i]


@compiled
def _keep(stage: int, point: Any, u: Any, stages: Any) -> None:
    """h and B of the stage, and its slope w = f + B(u + h), where u is without a u_a that flows."""
    n, m = point.plant.B.shape
    for i in range(n):
        stages.slope[stage, i] = point.plant.f[i]
        for j in range(m):
            stages.h[stage, j], stages.B[stage, i, j] = point.h[j], point.plant.B[i, j]
            stages.slope[stage, i] += point.plant.B[i, j] * (u[j] + point.h[j])


@compiled
def _polynomials(stages: Any, stage: int, inner: Any) -> None:
    """h and B as polynomials of the time over the length of the flow.

    Before the last stage they are lines from the first stage whose mean is the stage before, as in classical RK4; at
    last they run through start, the mean of the two stages in the middle, and end.
    """
    h, B = stages.h, stages.B
    for j in range(h.shape[1]):
        inner.h[0, j], inner.h[1, j], inner.h[2, j] = _through(h[0, j], h[1, j], h[2, j], h[3, j], stage)
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
def _what_acts(fast: Any, plan: Any, point: Any, y: Any, kept: Any) -> None:
    """k becomes what acts while a computer holds u: with u* and u_a it adds up to that."""
    u_a = blocks(y, fast.at).u_a
    for j in range(fast.at.m):
        point.k[j] = kept.u[j] - plan.u[j] - u_a[j]


@compiled
def _measure_sizes(fast: Any, now: Any, point: Any, y: Any, sizes: Any) -> None:
    """What the peaks are taken of, but for the distance."""
    own, k, h = blocks(y, fast.at), point.k, point.h
    deviation, u, error = 0.0, 0.0, 0.0
    for i in range(fast.at.n):
        for k2 in range(fast.at.n):
            deviation += fast.P[i, k2] * (now.x[i] - now.plan.x[i]) * (now.x[k2] - now.plan.x[k2])
    for j in range(fast.at.m):
        acting = now.plan.u[j] + k[j] + own.u_a[j]
        u += acting * acting
        if fast.terms.predicts:
            error += (own.sigma_hat[j] - h[j]) ** 2
    sizes[_DEVIATION], sizes[_U], sizes[_SIGMA_ERROR] = (
        np.sqrt(max(deviation, 0.0)),
        np.sqrt(u),
        np.sqrt(error),
    )
    sizes[_K], sizes[_H] = np.sqrt(dot(k, k)), np.sqrt(dot(h, h))
    square = 0.0
    for i in range(fast.at.n):
        square += own.xtilde[i] * dot(fast.P[i], own.xtilde)
    sizes[_XTILDE] = np.sqrt(max(square, 0.0))


@compiled
def _record(fast: Any, now: Any, place: int, point: Any, y: Any, sizes: Any, out: Any) -> None:
    """Peaks at the start of the step, and the values if it is an output time."""
    lane, own = now.lane, blocks(y, fast.at)
    for q in range(sizes.shape[0]):
        if sizes[q] > out.peak[lane, q]:
            out.peak[lane, q], out.peak_time[lane, q] = sizes[q], now.t
    if place >= 0:
        copy(out.x[lane, place], now.x)
        copy(out.xtilde[lane, place], own.xtilde)
        copy(out.k[lane, place], point.k)
        copy(out.u_a[lane, place], own.u_a)
        copy(out.sigma_hat[lane, place], own.sigma_hat)
        copy(out.h[lane, place], point.h)
        out.distance[lane, place] = sizes[_DISTANCE]

"""What the machine of theorem H does at its instants, (H.2)-(H.5), and what its adversaries do there.

At t_k it measures y_k = x + n_k, and computes kappa_k of (0.5) at (x*(t_k), y_k) and the estimate

    sigma_k = B^+(y_k) ((y_k - y_(k-1))/Ts - (f(y_(k-1)) + f(y_k))/2) - ubar_k,    q_k = (1 - th) q_(k-1) + th sigma_k,

where ubar_k is the mean of the input that was applied since t_(k-1); a delay later u = u0 + kappa_k - q^_k acts, q^_k
being q_k clipped. A machine that predicts (H-P) integrates yp' = f + B(u0 + kappa) from y_k until then, and computes
kappa_k at (x*, yp) there. In coordinates z = S x of the tube B^+ is that of z, as in `computer`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled, folded
from tubecert.simulate.computer import explain
from tubecert.simulate.feedback import model, steer
from tubecert.simulate.geodesic import FOUND
from tubecert.simulate.layout import blocks
from tubecert.simulate.program import Index
from tubecert.simulate.small import boxed, clip, copy, dot

if TYPE_CHECKING:
    from tubecert.simulate.fast import Fast
    from tubecert.simulate.feedback import Force, Moment, Point, Reference
    from tubecert.simulate.problem import Beside
    from tubecert.simulate.stepping import Lane, Work

EVENTS = ("sample", "act", "look", "feed")  # of the estimate: measured, acts; of the feedback: measured, acts
SAMPLE, ACT, LOOK, FEED = range(4)
_SQUARE, _GREEDY = 1.0, 2.0  # choices of noise, see `problem.Beside`
_MIXED, _ADDED, _MODULUS = 1103515245, 12345, 2**31  # a linear congruential generator


class Machine(NamedTuple):
    """`Ts` in s and `th` = 1 - e^(-omega Ts) of the estimate, its `box` (2, m) and `radius`.

    `predicts`: theorem H-P; `plays`: u* acts in continuous time, else it is held with the feedback. `waiting`: how many
    feedbacks may wait for their delay to end; `raised`: what kappa is multiplied by, 1 where B is known.
    """

    Ts: float
    th: float
    waiting: int
    predicts: bool
    plays: bool
    box: Array
    radius: float
    raised: float


class Notes(NamedTuple):
    """What a machine keeps between its instants.

    `y` what it measured, `before` and `drift` the measurement of the last estimate and f there, `predicted`, `noise`,
    `rate` (n,). `q`; `estimate` its clipped value; `fed` (waiting, m) is the feedback to come, with u* where that is
    held, and `acting` what it is; `total` = int u since the last estimate; `push` = c at the state (m,). `error` (1,)
    = |q - h|; `then` (1,) the time of the last measurement; `tally` (2,): measurements, and the state of the draws.
    """

    tally: Index
    y: Array
    before: Array
    drift: Array
    predicted: Array
    noise: Array
    rate: Array
    q: Array
    estimate: Array
    fed: Array
    acting: Array
    total: Array
    push: Array
    error: Array
    then: Array


def notes(n: int, m: int, waiting: int) -> Notes:
    """Nothing yet."""
    shapes = (n,) * 6 + (m, m, (waiting, m), m, m, m, 1, 1)
    return Notes(np.zeros(2, dtype=np.int64), *(np.zeros(shape) for shape in shapes))


@compiled
def begin(force: Force, lane: int, work: Work) -> None:
    """Forgets the lane before."""
    kept, point = work.notes, work.point
    for part in (kept.y, kept.before, kept.drift, kept.predicted, kept.noise, kept.q, kept.estimate):
        part[:] = 0.0
    kept.fed[:] = 0.0
    for part in (kept.acting, kept.total, kept.error, kept.then, point.since, work.kept.u):
        part[:] = 0.0
    kept.tally[0], kept.tally[1] = 0, lane + 1
    copy(point.signal[0], force.beside.begin[lane])
    point.signal[1] = 0.0


@folded
def attend(machine: Machine | None, own: Lane, s: int, now: Moment, work: Work) -> int:
    """What happens at the start of a step: the older sample acts first, what was just measured after that."""
    status = FOUND
    if machine is not None:
        event, kept = own.grid.event, work.notes
        looks, samples = event[LOOK, s] >= 0, event[SAMPLE, s] >= 0
        if looks or samples:
            copy(kept.push, work.point.push)
            if samples:
                _turn(own.force.beside, now, work)
            status = _measure(own, now, looks, work)
        if event[FEED, s] >= 0 and event[FEED, s] != event[LOOK, s]:
            status = max(status, _feed(machine, own, event[FEED, s], now, work))
        if looks:
            status = max(status, _look(machine, own, event[LOOK, s], now, work))
            if event[LOOK, s] == 0 or event[FEED, s] == event[LOOK, s]:
                status = max(status, _feed(machine, own, event[LOOK, s], now, work))
        if event[ACT, s] >= 0 and event[ACT, s] != event[SAMPLE, s]:
            _act(own.fast, work)
        if samples:
            _estimate(machine, own, event[SAMPLE, s], now, work)
            if event[ACT, s] == event[SAMPLE, s]:
                _act(own.fast, work)
        u_a = blocks(work.y, own.fast.at).u_a
        for j in range(u_a.shape[0]):
            work.kept.u[j] = kept.acting[j] + u_a[j]
    return int(status)


@folded
def _turn(beside: Beside, now: Moment, work: Work) -> None:
    """From here the signal of the adversary moves along c, or along its direction."""
    lane, point, c = now.lane, work.point, work.notes.push
    rate, turning, along = beside.ramp[lane], beside.turning[lane], beside.along[lane]
    if rate > 0.0:
        aims = dot(along, along) == 0.0
        size = np.sqrt(dot(c, c) if aims else dot(along, along))
        forwards = np.sin(turning[0] * now.t + turning[1]) >= 0.0
        for j in range(c.shape[0]):
            point.signal[0, j] = point.h[j]
            step = (c[j] if aims else along[j]) / max(size, 1e-300)
            if aims:
                step = decide(beside.decided[lane], work.notes.tally[0], 1 + j, step)
            point.signal[1, j] = rate * step if forwards else -rate * step
        point.since[0] = now.t


@compiled
def decide(decided: Array, count: int, place: int, value: float) -> float:
    """What was decided at a measurement when the run had longer steps, or now: runs of other steps are comparable."""
    if count >= decided.shape[0]:
        return value
    if np.isnan(decided[count, place]):
        decided[count, place] = value
    return float(decided[count, place])


@folded
def _measure(own: Lane, now: Moment, looks: bool, work: Work) -> int:
    """y = x + n, n of the lane's table and within its rate of the noise before."""
    beside, kept, lane, status = own.force.beside, work.notes, now.lane, FOUND
    table, y = beside.table[lane], kept.y
    kept.tally[1] = (_MIXED * kept.tally[1] + _ADDED) % _MODULUS
    place, sign = (kept.tally[1] // 65536) % table.shape[0], 1.0
    if beside.choice[lane] == _SQUARE:
        place, sign = 0, 1.0 if (kept.tally[0] // int(beside.period[lane])) % 2 == 0 else -1.0
    elif beside.choice[lane] == _GREEDY and looks:
        decided, count = beside.decided[lane], kept.tally[0]
        if count >= decided.shape[0] or np.isnan(decided[count, 0]):  # else it is known from longer steps
            most = -np.inf
            for q in range(table.shape[0]):
                for i in range(y.shape[0]):
                    y[i] = now.x[i] + table[q, i]
                status = max(status, _law(own, now.t, now.plan, y, work.point))
                loss = dot(kept.push, work.point.k)  # c'kappa at the state, of (H.14)
                if loss > most:
                    most, place = loss, q
        place = int(decide(decided, count, 0, float(place)))
    square, room = 0.0, beside.most[lane] * (now.t - kept.then[0])
    for i in range(y.shape[0]):
        square += (sign * table[place, i] - kept.noise[i]) ** 2
    share = 1.0 if kept.tally[0] == 0 or square <= room * room else room / np.sqrt(square)
    for i in range(y.shape[0]):
        kept.noise[i] += share * (sign * table[place, i] - kept.noise[i])
        y[i] = now.x[i] + kept.noise[i]
    kept.tally[0] += 1
    kept.then[0] = now.t
    return int(status)


@compiled
def _law(own: Lane, t: float, plan: Reference, x: Array, point: Point) -> int:
    """k of (0.5) at what a machine believes to be the state."""
    model(own.field.program, t, x, point.memory, point.seen)
    return int(steer(own.field, plan, x, point.seen, point)[0])


@compiled
def _look(machine: Machine, own: Lane, count: int, now: Moment, work: Work) -> int:
    """kappa_k at (x*(t_k), y_k), to act later; a prediction begins instead, if there is one."""
    kept, status, fed = work.notes, FOUND, work.notes.fed[count % machine.waiting]
    for j in range(fed.shape[0]):
        fed[j] = 0.0 if machine.plays else now.plan.u[j]
    if machine.predicts:
        copy(kept.predicted, kept.y)
    else:
        status = _law(own, now.t, now.plan, kept.y, work.point)
        for j in range(fed.shape[0]):
            fed[j] += machine.raised * work.point.k[j]
    return status


@compiled
def _feed(machine: Machine, own: Lane, count: int, now: Moment, work: Work) -> int:
    """The feedback acts."""
    status, kept, fed = FOUND, work.notes, work.notes.fed[count % machine.waiting]
    copy(kept.acting, fed)
    if machine.predicts:
        status = _law(own, now.t, now.plan, kept.predicted, work.point)
        for j in range(fed.shape[0]):
            kept.acting[j] += machine.raised * work.point.k[j]
    return status


@compiled
def _act(fast: Fast, work: Work) -> None:
    """The estimate acts."""
    now = blocks(work.y, fast.at)
    for j in range(fast.at.m):
        now.sigma_hat[j], now.u_a[j] = work.notes.estimate[j], -work.notes.estimate[j]


@folded
def _estimate(machine: Machine, own: Lane, count: int, now: Moment, work: Work) -> None:
    """(H.5) at sample `count`."""
    kept, seen, n = work.notes, work.point.seen, own.fast.at.n
    model(own.field.program, now.t, kept.y, work.point.memory, seen)
    if count > 0:
        for i in range(n):
            kept.rate[i] = (kept.y[i] - kept.before[i]) / machine.Ts - 0.5 * (kept.drift[i] + seen.f[i])
        explain(own.fast, seen.B, kept.rate, work.kept.gram, kept.estimate)
        for j in range(own.fast.at.m):
            sigma = kept.estimate[j] - kept.total[j] / machine.Ts
            kept.q[j] += machine.th * (sigma - kept.q[j])
            kept.estimate[j] = kept.q[j]
        boxed(kept.estimate, machine.box)
        clip(kept.estimate, machine.radius)
    copy(kept.before, kept.y)
    copy(kept.drift, seen.f)
    kept.total[:] = 0.0
    square = 0.0
    for j in range(own.fast.at.m):
        square += (kept.q[j] - work.point.h[j]) ** 2
    kept.error[0] = np.sqrt(square)


@folded
def carry(machine: Machine | None, own: Lane, s: int, work: Work) -> None:
    """Over a step: the integral of the input, and the prediction, by RK4 with the steps of the plant."""
    if machine is not None:
        kept, plan, length = work.notes, own.grid.plan.u, own.grid.length[s]
        for j in range(kept.total.shape[0]):
            mean = (plan[s, 0, j] + 4 * plan[s, 1, j] + plan[s, 2, j]) / 6 if machine.plays else 0.0
            kept.total[j] += length * (work.kept.u[j] + mean)
        if machine.predicts:
            _predict(machine, own, s, work)


@compiled
def _predict(machine: Machine, own: Lane, s: int, work: Work) -> None:
    """yp' = f(yp) + B(yp)(u0 + kappa) over a step."""
    kept, seen, grid, slope = work.notes, work.point.seen, own.grid, work.stages.slope
    start, length = grid.start[s], grid.length[s]
    for stage in range(4):
        share = 0.0 if stage == 0 else (length if stage == 3 else 0.5 * length)
        for i in range(kept.rate.shape[0]):
            kept.rate[i] = kept.predicted[i] + (share * slope[stage - 1, i] if stage else 0.0)
        model(own.field.program, start + share, kept.rate, work.point.memory, seen)
        for i in range(kept.rate.shape[0]):
            slope[stage, i] = seen.f[i]
            for j in range(kept.acting.shape[0]):
                u0 = grid.plan.u[s, (stage + 1) // 2, j] if machine.plays else 0.0
                slope[stage, i] += seen.B[i, j] * (u0 + kept.acting[j])
    for i in range(kept.rate.shape[0]):
        mean = slope[0, i] + 2 * slope[1, i] + 2 * slope[2, i] + slope[3, i]
        kept.predicted[i] += length / 6 * mean

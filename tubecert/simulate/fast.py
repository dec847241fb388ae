"""The fast part of a loop over one step, under a disturbance that is a polynomial of time.

y (`layout`) has the predictor's error, the estimates and the filter, and v = int B u_a, all that the slow part needs of
it. With a constant B and the projection idle y' is linear: the flow is a matrix, exact however fast (xtilde, sigma_hat)
oscillates. Otherwise RK4 resolves the oscillation, and finds the moments at which the hard projection sets in and lets
go.

Whether the projection stays idle is known beforehand: |sigma_hat - h|^2 + Gamma |xtilde|^2 decays but for the drift of
h (the V of 2.6, times Gamma).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled
from tubecert.simulate.layout import Layout, blocks, slices
from tubecert.simulate.loops import Terms
from tubecert.simulate.small import clip, copy, dot

_ON_BOUNDARY = 1e-12
_CROSSINGS = 40  # bisections of one step at a crossing
_CLOSE = 1e-7  # of a step: how near a crossing is found


class Fast(NamedTuple):
    """Terms and gains of the fast part; `layer` nu 0 is the hard projection, `radius` is R_H.

    `forces`: what drives it, h (m,) and where a wind blows E w (n,) after that.

    `exact` says that B is constant: then `flow` (2 Q, Y, Y) and `forced` (2 Q, 3, Y, m) are the exact flows over half
    and whole steps of Q lengths, for y and for the coefficients of h. `turn` is the angle in rad that RK4 may step
    over. `A` (n, n) is A_m in 1/s, `omega` in rad/s; `P` (n, n) is S'S in the tube's coordinates z = S x, where the
    law of (0.7) has its identity.
    """

    terms: Terms
    at: Layout
    forces: int
    A: Array
    P: Array
    Gamma: float
    omega: float
    radius: float
    layer: float
    exact: bool
    flow: Array
    forced: Array
    turn: float


class Inner(NamedTuple):
    """h, with E w after it where a wind blows, and B while the fast part flows, and working memory.

    `h` (4, forces), `B` (4, n, m): the coefficients by powers of the time over the step's length, then the values at a
    time. `rates` (4, Y), `trial` (Y,) and `end` (Y,): of RK4 the rates, where they are taken, and the end of a step.
    """

    h: Array
    B: Array
    rates: Array
    trial: Array
    end: Array


def inner(at: Layout, forces: int) -> Inner:
    """Fresh working memory."""
    n, m, Y = at.n, at.m, at.size
    return Inner(np.zeros((4, forces)), np.zeros((4, n, m)), np.zeros((4, Y)), np.zeros(Y), np.zeros(Y))


def generator(fast: Fast, B: Array) -> tuple[Array, Array]:
    """L (Y, Y) and E (Y, forces) with y' = L y + E h, for a constant B (n, m) and an idle projection."""
    terms, y, Y, m = fast.terms, slices(fast.at), fast.at.size, fast.at.m
    L, E = np.zeros((Y, Y)), np.zeros((Y, fast.forces))
    L[y.v, y.u_a] = B  # v' = B u_a
    if terms.filters:
        L[y.u_a, y.u_a] = -fast.omega * np.eye(m)  # (0.8) u_a' = -omega (u_a + ...
        if terms.knows:
            E[y.u_a, :m] = -fast.omega * np.eye(m)  # ... h)
        else:
            L[y.u_a, y.sigma_hat] = -fast.omega * np.eye(m)  # ... sigma_hat)
    if terms.predicts:
        L[y.xtilde, y.xtilde], E[y.xtilde, :m] = fast.A, -B  # (0.6) - (0.1): xtilde' = A_m xtilde - B h ...
        E[y.xtilde, m:] = -np.eye(fast.at.n, fast.forces - m)  # ... - E w
    if terms.adapts:
        L[y.xtilde, y.sigma_hat] = B  # (0.6) ... + B sigma_hat
        L[y.sigma_hat, y.xtilde] = -fast.Gamma * B.T @ fast.P  # (0.7) sigma_hat' = -Gamma B'P xtilde
    return L, E


def exact_flows(fast: Fast, B: Array, lengths: Array) -> Fast:
    """The same with the exact flows over half and whole steps of the lengths (Q,), for a constant B (n, m).

    A flow under h = c_0 + c_1 s + c_2 s^2, s the share of the step, is one exponential of the block matrix [L, E, 0,
    0; 0, 0, I, 0; 0, 0, 0, I; 0, 0, 0, 0].
    """
    from scipy.linalg import expm

    L, E = generator(fast, B)
    # xtilde is of the size sigma_hat/sqrt(Gamma): without this the matrices are ill-scaled
    scale = np.ones(len(L))
    scale[slices(fast.at).xtilde] = max(1.0, np.sqrt(fast.Gamma))
    Y, m = E.shape
    block = np.zeros((Y + 3 * m, Y + 3 * m))
    block[:Y, :Y], block[:Y, Y : Y + m] = scale[:, None] * L / scale, scale[:, None] * E
    halves = np.stack([lengths / 2, lengths], axis=1).ravel()
    stack = np.tile(block, (len(halves), 1, 1)) * halves[:, None, None]
    stack[..., Y : Y + 2 * m, Y + m :] = np.eye(2 * m)
    whole = expm(stack)
    flow = whole[..., :Y, :Y] / scale[:, None] * scale
    forced = np.stack([whole[..., :Y, Y + i * m : Y + (i + 1) * m] for i in range(3)], axis=-3)
    forced = (
        forced / scale[:, None] * np.array([1.0, 1.0, 2.0])[:, None, None]
    )  # s^2/2 is what the exponential has
    return fast._replace(exact=True, flow=np.ascontiguousarray(flow), forced=np.ascontiguousarray(forced))


@compiled
def advance(fast: Any, length: float, index: int, y: Any, inner: Any, first: int, out: Any) -> None:
    """y after a length; of an exact flow, whose number is `index`, only the entries from `first` on."""
    if fast.exact and (not fast.terms.adapts or _idle(fast, length, y, inner.h)):
        _exact(fast.flow[index], fast.forced[index], y, inner.h, first, fast.at.v, out)
    else:
        copy(out, y)
        _resolve(fast, length, out, inner)


@compiled
def _exact(flow: Any, forced: Any, y: Any, h: Any, first: int, v: int, out: Any) -> None:
    """The exact flow; v, the last entries of y, is 0 at the start of a step."""
    for i in range(first, y.shape[0]):
        total = 0.0
        for j in range(v):
            total += flow[i, j] * y[j]
        for p in range(3):
            total += dot(forced[p, i], h[p])
        out[i] = total


@compiled
def _idle(fast: Any, length: float, y: Any, h: Any) -> bool:
    """Whether sigma_hat provably stays where the projection does nothing, up to the rounding.

    While it is idle, |sigma_hat - h|^2 + Gamma xtilde'P xtilde grows by the drift of h only: |sigma_hat| is at most the
    root of that at the start, plus |h| and twice what h moves, plus what a wind has moved xtilde.
    """
    now = blocks(y, fast.at)
    amplitude, reach = 0.0, 0.0
    for i in range(fast.at.n):
        amplitude += fast.Gamma * now.xtilde[i] * dot(fast.P[i], now.xtilde)
    for j in range(fast.at.m):
        amplitude += (now.sigma_hat[j] - h[0, j]) ** 2
    for p in range(3):  # |h| and its drift
        square, blown = 0.0, 0.0
        for j in range(fast.at.m):
            square += h[p, j] * h[p, j]
        for i in range(fast.forces - fast.at.m):
            blown += fast.Gamma * h[p, fast.at.m + i] * dot(fast.P[i], h[p, fast.at.m :])
        reach += (1 + p) * np.sqrt(square) + length * np.sqrt(blown)
    return bool(np.sqrt(amplitude) + reach <= fast.radius / np.sqrt(1.0 + fast.layer))  # 2.5: where F <= 0


@compiled
def _place(inner: Any, s: float) -> None:
    """h and B at the share s of the step."""
    h, B = inner.h, inner.B
    for j in range(h.shape[1]):
        h[3, j] = h[0, j] + s * (h[1, j] + s * h[2, j])
    for j in range(B.shape[2]):
        for i in range(B.shape[1]):
            B[3, i, j] = B[0, i, j] + s * (B[1, i, j] + s * B[2, i, j])


@compiled
def _outward(fast: Any, y: Any, B: Any) -> float:
    """-sigma_hat'B'P xtilde: positive while the adaptation pushes sigma_hat outward."""
    now = blocks(y, fast.at)
    total = 0.0
    for i in range(fast.at.n):
        total -= dot(fast.P[i], now.xtilde) * dot(B[i], now.sigma_hat)
    return total


@compiled
def _rate(fast: Any, sliding: bool, y: Any, h: Any, B: Any, dy: Any) -> None:
    """y' for given h (forces,) and B (n, m), term by term; `sliding`: along the ball of the hard projection."""
    terms, now, rate = fast.terms, blocks(y, fast.at), blocks(dy, fast.at)
    dy[:] = 0.0
    if terms.filters:
        for j in range(fast.at.m):
            estimate = h[j] if terms.knows else now.sigma_hat[j]
            rate.u_a[j] = -fast.omega * (now.u_a[j] + estimate)  # (0.8)
    for i in range(fast.at.n):
        rate.v[i] = dot(B[i], now.u_a)  # v' = B u_a
        if terms.predicts:
            rate.xtilde[i] = dot(fast.A[i], now.xtilde) - dot(B[i], h)  # (0.6) - (0.1): A_m xtilde - B h ...
            if fast.forces > fast.at.m:
                rate.xtilde[i] -= h[fast.at.m + i]  # ... - E w
        if terms.adapts:
            rate.xtilde[i] += dot(B[i], now.sigma_hat)  # (0.6) ... + B sigma_hat
            weighed = dot(fast.P[i], now.xtilde)
            for j in range(fast.at.m):
                rate.sigma_hat[j] -= fast.Gamma * B[i, j] * weighed  # (0.7) -Gamma B'P xtilde
    if terms.adapts:
        _project(fast, sliding, now.sigma_hat, rate.sigma_hat)


@compiled
def _project(fast: Any, sliding: bool, sigma: Any, rate: Any) -> None:
    """Proj of 2.5: takes out of sigma_hat' what does not pass; hard only while `sliding` along the ball."""
    square, outward = dot(sigma, sigma), dot(sigma, rate)
    share = 1.0 if sliding else 0.0
    if fast.layer > 0.0:
        limit = fast.radius * fast.radius
        share = max(0.0, ((1.0 + fast.layer) * square - limit) / (fast.layer * limit))  # F of 2.5
    if share > 0.0 and (sliding or outward > 0.0):
        for j in range(fast.at.m):
            rate[j] -= share * outward * sigma[j] / square


@compiled
def _leap(fast: Any, sliding: bool, s: float, ds: float, length: float, y: Any, inner: Any) -> None:
    """One RK4 step from the share s of the whole step to s + ds; h and B are left at its end."""
    rates, trial, end = inner.rates, inner.trial, inner.end
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        _place(inner, s + share * ds)
        for i in range(y.shape[0]):
            trial[i] = y[i] + (share * ds * length * rates[stage - 1, i] if stage else 0.0)
        _rate(fast, sliding, trial, inner.h[3], inner.B[3], rates[stage])
    for i in range(y.shape[0]):
        slope = rates[0, i] + 2 * rates[1, i] + 2 * rates[2, i] + rates[3, i]
        end[i] = y[i] + ds * length / 6 * slope


@compiled
def _resolve(fast: Any, length: float, y: Any, inner: Any) -> None:
    """Takes y over the whole step by RK4; a step in which the projection sets in or lets go ends there."""
    hard = fast.terms.adapts and fast.layer == 0.0
    count = _count(fast, length, inner)
    _place(inner, 0.0)
    edge = (fast.radius * (1 - _ON_BOUNDARY)) ** 2
    sigma = blocks(y, fast.at).sigma_hat
    sliding = hard and dot(sigma, sigma) >= edge and _outward(fast, y, inner.B[3]) > 0.0
    s = 0.0
    while s < 1.0:
        ds = min(1.0 / count, 1.0 - s)
        ds = 1.0 - s if s + ds > 1.0 - 1e-9 / count else ds
        before, after, trial, ends = 0.0, ds, ds, False
        for _ in range(_CROSSINGS):
            _leap(fast, sliding, s, trial, length, y, inner)
            over = hard and _over(fast, sliding, inner)
            ends = ends or over
            if not ends or (over and after - before <= _CLOSE * ds):
                break
            before, after = (before, trial) if over else (trial, after)
            trial = 0.5 * (before + after) if after - before > _CLOSE * ds else after
        copy(y, inner.end)
        s += trial
        sliding = sliding != ends
        if hard:
            clip(sigma, fast.radius)


@compiled
def _over(fast: Any, sliding: bool, inner: Any) -> bool:
    """Whether a step has ended beyond its mode: outside of the ball, or no longer pushed outward."""
    if sliding:
        return bool(_outward(fast, inner.end, inner.B[3]) < 0.0)
    sigma = blocks(inner.end, fast.at).sigma_hat
    return bool(dot(sigma, sigma) > (fast.radius * (1 + _ON_BOUNDARY)) ** 2)


@compiled
def _count(fast: Any, length: float, inner: Any) -> int:
    """Steps such that none turns further than `turn`: the speeds are omega, |A_m| and sqrt(Gamma) |S B|."""
    largest = 0.0
    for k in range(3):  # B at both ends and in the middle
        _place(inner, 0.5 * k)
        square = 0.0
        for i in range(fast.at.n):
            for k2 in range(fast.at.n):
                square += fast.P[i, k2] * dot(inner.B[3, i], inner.B[3, k2])
        largest = max(largest, square)
    speed = fast.omega
    for i in range(fast.at.n):
        speed = max(speed, np.sqrt(dot(fast.A[i], fast.A[i]) * fast.at.n))
    if fast.terms.adapts:
        speed = max(speed, np.sqrt(fast.Gamma * largest))
        if fast.layer > 0.0:
            speed *= max(1.0, 0.5 / fast.layer)  # within the layer sigma_hat slows down over a part of a turn
    return max(1, int(np.ceil(length * speed / fast.turn)))

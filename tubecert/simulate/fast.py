"""The fast part of a loop over one step, under a disturbance that is a polynomial of time.

y = (xtilde (n), sigma_hat (m), u_a (m), s_hat (n), v (n)) with v = int B u_a, all that the slow part needs of it.
With a constant B and the projection idle y' is linear: the flow is a matrix, exact however fast (xtilde, sigma_hat)
oscillates. Otherwise RK4 resolves the oscillation, and finds the moments at which the hard projection sets in and
lets go.

Whether the projection stays idle is known beforehand: |sigma_hat - h|^2 + Gamma |xtilde|^2 decays but for the
drift of h.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled
from tubecert.simulate.small import clip, copy, dot

NONE, REFERENCE, ADAPTIVE, SAMPLED = range(4)
KINDS = {"nominal": NONE, "ccm": NONE, "reference": REFERENCE, "l1": ADAPTIVE, "sampled": SAMPLED}
_ON_BOUNDARY = 1e-12
_CROSSINGS = 40  # bisections of one step at a crossing
_CLOSE = 1e-7  # of a step: how near a crossing is found


class Fast(NamedTuple):
    """Gains of the fast part; `layer` 0 is the hard projection.

    `exact` says that B is constant: then `flow` (2 Q, Y, Y) and `forced` (2 Q, 3, Y, m) are the exact flows over half
    and whole steps of Q lengths, for y and for the coefficients of h. `turn` is the angle in rad that RK4 may step
    over.
    """

    kind: int
    n: int
    m: int
    A: Array
    Gamma: float
    omega: float
    radius: float
    layer: float
    exact: bool
    flow: Array
    forced: Array
    turn: float


class Inner(NamedTuple):
    """h and B while the fast part flows, and working memory.

    `h` (4, m), `B` (4, n, m): the coefficients by powers of the time over the step's length, then the values at a
    time. `stages` (6, Y): four rates, where they are taken, and the end of a step.
    """

    h: Array
    B: Array
    stages: Array


def size(n: int, m: int) -> int:
    """Entries of y."""
    return 3 * n + 2 * m


def inner(n: int, m: int) -> Inner:
    """Fresh working memory."""
    return Inner(np.zeros((4, m)), np.zeros((4, n, m)), np.zeros((6, size(n, m))))


def generator(kind: int, A: Array, Gamma: float, omega: float, B: Array) -> tuple[Array, Array]:
    """L (Y, Y) and E (Y, m) with y' = L y + E h, for a constant B and an idle projection."""
    n, m = B.shape
    L, E = np.zeros((size(n, m), size(n, m))), np.zeros((size(n, m), m))
    x, s, u = slice(0, n), slice(n, n + m), slice(n + m, n + 2 * m)
    held, v = slice(n + 2 * m, 2 * n + 2 * m), slice(2 * n + 2 * m, None)
    L[v, u] = B
    L[u, u] = -omega * np.eye(m)
    if kind == REFERENCE:
        E[u] = -omega * np.eye(m)
        return L, E
    L[u, s] = -omega * np.eye(m)
    L[x, x], E[x] = A, -B
    if kind == ADAPTIVE:
        L[x, s], L[s, x] = B, -Gamma * B.T
    else:
        L[x, held] = np.eye(n)
    return L, E


def exact_flows(fast: Fast, B: Array, lengths: Array) -> Fast:
    """The same with the exact flows over half and whole steps of the lengths (Q,), for a constant B (n, m)."""
    from scipy.linalg import expm

    L, E = generator(fast.kind, fast.A, fast.Gamma, fast.omega, B)
    scale = np.ones(
        len(L)
    )  # xtilde is of the size sigma_hat/sqrt(Gamma): without this the matrices are ill-scaled
    scale[: fast.n] = max(1.0, np.sqrt(fast.Gamma))
    Y, m = E.shape
    block = np.zeros((Y + 3 * m, Y + 3 * m))
    block[:Y, :Y], block[:Y, Y : Y + m] = scale[:, None] * L / scale, scale[:, None] * E
    halves = np.stack([lengths / 2, lengths], axis=1).ravel()
    stack = np.tile(block, (len(halves), 1, 1)) * halves[:, None, None]
    stack[..., Y : Y + 2 * m, Y + m :] = np.eye(2 * m)
    whole = expm(stack)
    flow = whole[..., :Y, :Y] / scale[:, None] * scale
    forced = np.stack([whole[..., :Y, Y + i * m : Y + (i + 1) * m] for i in range(3)], axis=-3)
    forced = forced / scale[:, None] * np.array([1.0, 1.0, 2.0])[:, None, None]
    return fast._replace(exact=True, flow=np.ascontiguousarray(flow), forced=np.ascontiguousarray(forced))


@compiled
def advance(fast: Any, length: float, index: int, y: Any, inner: Any, first: int, out: Any) -> None:
    """y after a length; of an exact flow, whose number is `index`, only the entries from `first` on."""
    if fast.exact and (fast.kind != ADAPTIVE or _idle(fast, y, inner.h)):
        _exact(fast.flow[index], fast.forced[index], y, inner.h, first, fast.n, out)
    else:
        copy(out, y)
        _resolved(fast, length, out, inner)


@compiled
def _exact(flow: Any, forced: Any, y: Any, h: Any, first: int, n: int, out: Any) -> None:
    for i in range(first, y.shape[0]):
        total = 0.0
        for j in range(y.shape[0] - n):  # v is 0 at the start of a step
            total += flow[i, j] * y[j]
        for p in range(3):
            total += dot(forced[p, i], h[p])
        out[i] = total


@compiled
def _idle(fast: Any, y: Any, h: Any) -> bool:
    """Whether sigma_hat provably stays where the projection does nothing, up to the rounding."""
    amplitude, reach = 0.0, 0.0
    for i in range(fast.n):
        amplitude += fast.Gamma * y[i] * y[i]
    for j in range(fast.m):
        amplitude += (y[fast.n + j] - h[0, j]) ** 2
    for p in range(3):  # |h| and its drift
        reach += (1 + p) * np.sqrt(dot(h[p], h[p]))
    return bool(np.sqrt(amplitude) + reach <= fast.radius / np.sqrt(1.0 + fast.layer))


@compiled
def _at(inner: Any, s: float) -> None:
    """h and B at the share s of the step."""
    h, B = inner.h, inner.B
    for j in range(h.shape[1]):
        h[3, j] = h[0, j] + s * (h[1, j] + s * h[2, j])
        for i in range(B.shape[1]):
            B[3, i, j] = B[0, i, j] + s * (B[1, i, j] + s * B[2, i, j])


@compiled
def _outward(fast: Any, y: Any, B: Any) -> float:
    """-sigma_hat'B'xtilde: positive while the adaptation pushes sigma_hat outward."""
    total = 0.0
    for i in range(fast.n):
        total -= y[i] * dot(B[i], y[fast.n : fast.n + fast.m])
    return total


@compiled
def _rate(fast: Any, sliding: bool, y: Any, h: Any, B: Any, dy: Any) -> None:
    """y' for given h and B."""
    n, m = fast.n, fast.m
    u, held, v = n + m, n + 2 * m, 2 * n + 2 * m
    dy[:] = 0.0
    for j in range(m):
        drive = h[j] if fast.kind == REFERENCE else y[n + j]
        dy[u + j] = -fast.omega * (y[u + j] + drive)
    for i in range(n):
        dy[v + i] = dot(B[i], y[u : u + m])
        if fast.kind != REFERENCE:
            dy[i] = dot(fast.A[i], y[:n]) - dot(B[i], h)
        if fast.kind == SAMPLED:
            dy[i] += y[held + i]
        if fast.kind == ADAPTIVE:
            dy[i] += dot(B[i], y[n:u])
            for j in range(m):
                dy[n + j] -= fast.Gamma * B[i, j] * y[i]
    if fast.kind == ADAPTIVE:
        _project(fast, sliding, y[n:u], dy[n:u])


@compiled
def _project(fast: Any, sliding: bool, sigma: Any, rate: Any) -> None:
    """Takes out of sigma_hat' what the projection does not let pass."""
    square, outward = dot(sigma, sigma), dot(sigma, rate)
    share = 1.0 if sliding else 0.0
    if fast.layer > 0.0:
        limit = fast.radius * fast.radius
        share = max(0.0, ((1.0 + fast.layer) * square - limit) / (fast.layer * limit))
    if share > 0.0 and (sliding or outward > 0.0):
        for j in range(fast.m):
            rate[j] -= share * outward * sigma[j] / square


@compiled
def _leap(fast: Any, sliding: bool, s: float, ds: float, length: float, y: Any, inner: Any) -> None:
    """One RK4 step from the share s of the whole step to s + ds; h and B are left at its end."""
    stages = inner.stages
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        _at(inner, s + share * ds)
        for i in range(y.shape[0]):
            stages[4, i] = y[i] + (share * ds * length * stages[stage - 1, i] if stage else 0.0)
        _rate(fast, sliding, stages[4], inner.h[3], inner.B[3], stages[stage])
    for i in range(y.shape[0]):
        slope = stages[0, i] + 2 * stages[1, i] + 2 * stages[2, i] + stages[3, i]
        stages[5, i] = y[i] + ds * length / 6 * slope


@compiled
def _resolved(fast: Any, length: float, y: Any, inner: Any) -> None:
    """y over the whole step by RK4; a step in which the projection sets in or lets go ends there."""
    n, u = fast.n, fast.n + fast.m
    hard = fast.kind == ADAPTIVE and fast.layer == 0.0
    count = _count(fast, length, inner)
    _at(inner, 0.0)
    edge = (fast.radius * (1 - _ON_BOUNDARY)) ** 2
    sliding = hard and dot(y[n:u], y[n:u]) >= edge and _outward(fast, y, inner.B[3]) > 0.0
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
        copy(y, inner.stages[5])
        s += trial
        sliding = sliding != ends
        if hard:
            clip(y[n:u], fast.radius)


@compiled
def _over(fast: Any, sliding: bool, inner: Any) -> bool:
    """Whether a step has ended beyond its mode: outside of the ball, or no longer pushed outward."""
    y = inner.stages[5]
    if sliding:
        return bool(_outward(fast, y, inner.B[3]) < 0.0)
    sigma = y[fast.n : fast.n + fast.m]
    return bool(dot(sigma, sigma) > (fast.radius * (1 + _ON_BOUNDARY)) ** 2)


@compiled
def _count(fast: Any, length: float, inner: Any) -> int:
    """Steps such that none turns further than `turn`."""
    largest = 0.0
    for k in range(3):  # B at both ends and in the middle
        _at(inner, 0.5 * k)
        square = 0.0
        for i in range(fast.n):
            square += dot(inner.B[3, i], inner.B[3, i])
        largest = max(largest, square)
    speed = fast.omega
    for i in range(fast.n):
        speed = max(speed, np.sqrt(dot(fast.A[i], fast.A[i]) * fast.n))
    if fast.kind == ADAPTIVE:
        speed = max(speed, np.sqrt(fast.Gamma * largest))
        if fast.layer > 0.0:
            speed *= max(1.0, 0.5 / fast.layer)  # within the layer sigma_hat slows down over a part of a turn
    return max(1, int(np.ceil(length * speed / fast.turn)))

"""The fast part of a loop over one step, under a disturbance that is a polynomial of time.

y = (xtilde (n), sigma_hat (m), u_a (m), s_hat (n), v (n)) with v = int B u_a, all that the slow part needs of it. With a
constant B and the projection idle y' is linear: the flow is a matrix, exact however fast (xtilde, sigma_hat) oscillates.
Otherwise RK4 resolves the oscillation, and finds the moments at which the hard projection sets in and lets go.

Whether the projection stays idle is known beforehand: |sigma_hat - h|^2 + Gamma |xtilde|^2 decays but for the drift of h.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled
from tubecert.simulate.small import clip, dot

NONE, REFERENCE, ADAPTIVE, SAMPLED = range(4)
KINDS = {"nominal": NONE, "ccm": NONE, "reference": REFERENCE, "l1": ADAPTIVE, "sampled": SAMPLED}
_FREE, _SLIDING = 0, 1
_ON_BOUNDARY = 1e-12
_CROSSINGS = 60  # bisections of one step at a crossing


class Fast(NamedTuple):
    """Gains of the fast part; `layer` 0 is the hard projection.

    `exact` says that B is constant: then `flow` (Q, 2, Y, Y) and `forced` (Q, 2, 3, Y, m) are the exact flows over half
    and whole steps of Q lengths, for y and for the coefficients of h. `turn` is the angle in rad that RK4 may step over.
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
    """Coefficients of h (3, m) and B (3, n, m) by powers of the time over the step's length, and working memory."""

    h: Array
    B: Array
    h_now: Array
    B_now: Array
    stages: Array
    y: Array


def size(n: int, m: int) -> int:
    """Entries of y."""
    return 3 * n + 2 * m


def inner(n: int, m: int) -> Inner:
    """Fresh working memory."""
    Y = size(n, m)
    return Inner(
        np.zeros((3, m)), np.zeros((3, n, m)), np.zeros(m), np.zeros((n, m)), np.zeros((5, Y)), np.zeros(Y)
    )


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
    halves = np.stack([lengths / 2, lengths], axis=1)
    stack = np.tile(block, (*halves.shape, 1, 1)) * halves[..., None, None]
    stack[..., Y : Y + 2 * m, Y + m :] = np.eye(2 * m)
    whole = expm(stack)
    flow = whole[..., :Y, :Y] / scale[:, None] * scale
    forced = np.stack([whole[..., :Y, Y + i * m : Y + (i + 1) * m] for i in range(3)], axis=-3)
    forced = forced / scale[:, None] * np.array([1.0, 1.0, 2.0])[:, None, None]
    return fast._replace(exact=True, flow=np.ascontiguousarray(flow), forced=np.ascontiguousarray(forced))


@compiled
def advance(
    fast: Any, length: float, which: int, half: int, y: Any, inner: Any, first: int, out: Any
) -> None:
    """y after a half or whole step (`half` 0 or 1) of a length; only the entries from `first` on are needed."""
    if fast.exact and (fast.kind != ADAPTIVE or _idle(fast, y, inner)):
        _exact(fast, which, half, y, inner, first, out)
    else:
        out[:] = y
        _resolved(fast, length, out, inner)


@compiled
def _exact(fast: Any, which: int, half: int, y: Any, inner: Any, first: int, out: Any) -> None:
    Y, m = y.shape[0], fast.m
    flow, forced = fast.flow[which, half], fast.forced[which, half]
    for i in range(first, Y):
        total = 0.0
        for j in range(Y - fast.n):  # v is 0 at the start of a step
            total += flow[i, j] * y[j]
        for p in range(3):
            for j in range(m):
                total += forced[p, i, j] * inner.h[p, j]
        out[i] = total


@compiled
def _idle(fast: Any, y: Any, inner: Any) -> bool:
    """Whether sigma_hat provably stays where the projection does nothing, up to the rounding."""
    n, m = fast.n, fast.m
    amplitude, size, drift = 0.0, 0.0, 0.0
    for i in range(n):
        amplitude += fast.Gamma * y[i] * y[i]
    for j in range(m):
        amplitude += (y[n + j] - inner.h[0, j]) ** 2
    for p in range(3):
        length = np.sqrt(dot(inner.h[p], inner.h[p]))
        size += length
        drift += p * length
    return bool(np.sqrt(amplitude) + drift + size <= fast.radius / np.sqrt(1.0 + fast.layer))


@compiled
def _interpolate(inner: Any, s: float) -> None:
    """h and B at the share s of the step."""
    for j in range(inner.h_now.shape[0]):
        inner.h_now[j] = inner.h[0, j] + s * (inner.h[1, j] + s * inner.h[2, j])
        for i in range(inner.B_now.shape[0]):
            inner.B_now[i, j] = inner.B[0, i, j] + s * (inner.B[1, i, j] + s * inner.B[2, i, j])


@compiled
def _outward(fast: Any, y: Any, inner: Any) -> float:
    """-sigma_hat'B'xtilde: positive while the adaptation pushes sigma_hat outward."""
    total = 0.0
    for j in range(fast.m):
        for i in range(fast.n):
            total -= y[fast.n + j] * inner.B_now[i, j] * y[i]
    return total


@compiled
def _rate(fast: Any, mode: int, y: Any, inner: Any, dy: Any) -> None:
    """y' with h and B as interpolated."""
    n, m = fast.n, fast.m
    u, held, v = n + m, n + 2 * m, 2 * n + 2 * m
    for i in range(n):
        dy[i] = dy[held + i] = dy[v + i] = 0.0
        for j in range(m):
            dy[v + i] += inner.B_now[i, j] * y[u + j]
    for j in range(m):
        drive = inner.h_now[j] if fast.kind == REFERENCE else y[n + j]
        dy[u + j] = -fast.omega * (y[u + j] + drive)
        dy[n + j] = 0.0
    if fast.kind == REFERENCE:
        return
    for i in range(n):
        for j in range(n):
            dy[i] += fast.A[i, j] * y[j]
        for j in range(m):
            dy[i] -= inner.B_now[i, j] * inner.h_now[j]
        if fast.kind == SAMPLED:
            dy[i] += y[held + i]
        else:
            for j in range(m):
                dy[i] += inner.B_now[i, j] * y[n + j]
                dy[n + j] -= fast.Gamma * inner.B_now[i, j] * y[i]
    if fast.kind == ADAPTIVE:
        _project(fast, mode, y, inner, dy)


@compiled
def _project(fast: Any, mode: int, y: Any, inner: Any, dy: Any) -> None:
    """Takes out of sigma_hat' what the projection does not let pass."""
    n, m = fast.n, fast.m
    square = dot(y[n : n + m], y[n : n + m])
    share = 1.0 if mode == _SLIDING else 0.0
    if fast.layer > 0.0:
        limit = fast.radius * fast.radius
        share = max(0.0, ((1.0 + fast.layer) * square - limit) / (fast.layer * limit))
    if share == 0.0 or square == 0.0:
        return
    outward = dot(y[n : n + m], dy[n : n + m])
    if outward > 0.0 or mode == _SLIDING:
        for j in range(m):
            dy[n + j] -= share * outward * y[n + j] / square


@compiled
def _leap(fast: Any, mode: int, s: float, ds: float, length: float, y: Any, inner: Any, out: Any) -> None:
    """One RK4 step from the share s of the step to s + ds; h and B are left at its end."""
    Y = y.shape[0]
    k, at = inner.stages, inner.stages[4]
    step = ds * length
    _interpolate(inner, s)
    _rate(fast, mode, y, inner, k[0])
    for i in range(Y):
        at[i] = y[i] + 0.5 * step * k[0, i]
    _interpolate(inner, s + 0.5 * ds)
    _rate(fast, mode, at, inner, k[1])
    for i in range(Y):
        at[i] = y[i] + 0.5 * step * k[1, i]
    _rate(fast, mode, at, inner, k[2])
    for i in range(Y):
        at[i] = y[i] + step * k[2, i]
    _interpolate(inner, s + ds)
    _rate(fast, mode, at, inner, k[3])
    for i in range(Y):
        out[i] = y[i] + step / 6 * (k[0, i] + 2 * k[1, i] + 2 * k[2, i] + k[3, i])


@compiled
def _switched(fast: Any, mode: int, y: Any, inner: Any) -> bool:
    """Whether the mode has ended: sigma_hat has left the ball, or is no longer pushed outward."""
    if mode == _SLIDING:
        return bool(_outward(fast, y, inner) < 0.0)
    s = y[fast.n : fast.n + fast.m]
    return bool(dot(s, s) > (fast.radius * (1 + _ON_BOUNDARY)) ** 2)


@compiled
def _resolved(fast: Any, length: float, y: Any, inner: Any) -> None:
    """y over the whole step by RK4."""
    hard = fast.kind == ADAPTIVE and fast.layer == 0.0
    steps = _step_count(fast, length, inner)
    _interpolate(inner, 0.0)
    s_hat = y[fast.n : fast.n + fast.m]
    mode, s = _FREE, 0.0
    if (
        hard
        and dot(s_hat, s_hat) >= (fast.radius * (1 - _ON_BOUNDARY)) ** 2
        and _outward(fast, y, inner) > 0.0
    ):
        mode = _SLIDING
    while s < 1.0:
        ds = min(1.0 / steps, 1.0 - s)
        if s + ds > 1.0 - 1e-9 / steps:
            ds = 1.0 - s
        _leap(fast, mode, s, ds, length, y, inner, inner.y)
        if hard and _switched(fast, mode, inner.y, inner):
            ds = _crossing(fast, mode, s, ds, length, y, inner)
            mode = _FREE if mode == _SLIDING else _SLIDING
        y[:] = inner.y
        s += ds
        if hard:
            clip(s_hat, fast.radius)


@compiled
def _crossing(fast: Any, mode: int, s: float, ds: float, length: float, y: Any, inner: Any) -> float:
    """The part of the step after which the mode ends (at most by the rounding); its end goes into `inner.y`."""
    before, after = 0.0, ds
    for _ in range(_CROSSINGS):
        middle = 0.5 * (before + after)
        if middle == before or middle == after or after - before <= 1e-12 * ds:
            break
        _leap(fast, mode, s, middle, length, y, inner, inner.y)
        if _switched(fast, mode, inner.y, inner):
            after = middle
        else:
            before = middle
    _leap(fast, mode, s, after, length, y, inner, inner.y)
    return after


@compiled
def _step_count(fast: Any, length: float, inner: Any) -> int:
    """Steps such that none turns further than `turn`."""
    n, m = fast.n, fast.m
    largest = 0.0
    for s in range(3):  # B at both ends and in the middle
        _interpolate(inner, 0.5 * s)
        square = 0.0
        for i in range(n):
            square += dot(inner.B_now[i], inner.B_now[i])
        largest = max(largest, square)
    speed = fast.omega
    if fast.kind != REFERENCE:
        for i in range(n):
            speed = max(speed, np.sqrt(dot(fast.A[i], fast.A[i]) * n))
    if fast.kind == ADAPTIVE:
        speed = max(speed, np.sqrt(fast.Gamma * largest))
        if fast.layer > 0.0:
            speed *= max(1.0, 0.5 / fast.layer)  # within the layer sigma_hat slows down over a part of a turn
    return max(1, int(np.ceil(length * speed / fast.turn)))

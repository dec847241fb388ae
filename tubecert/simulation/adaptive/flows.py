"""The fast part of loops over one step, under a disturbance that is a polynomial of time.

y holds xi = sqrt(Gamma) xtilde (n,), the estimate sigma_hat (m,), the filter's output u_a (m,) and V = int u_a since
the start of the step (m,), all that the slow part needs of it. While the projection is idle y' is linear: the flow is a
matrix, exact however fast (xtilde, sigma_hat) oscillates; of a B that moves, that of the middle of the step. Powers of
the flow over a short time show which lanes come to the ball of the projection. These go on in short times, each a flow
and the nearest point of the ball (Moreau's catching-up), of which half was missing from xtilde and u_a on the way.
Source: J. J. Moreau, Evolution problem associated with a moving convex set in a Hilbert space, J. Diff. Eq. 26, 1977.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.loops import LoopGains

_TURN: Final = 1.0  # rad between two looks at the projection on the first level, half as far on the next
_MOST_HALVINGS: Final = 12  # of a step
_ORDER: Final = 7  # of Taylor's polynomial
_LAYERED: Final = 0.5  # within a smooth layer of this or less sigma_hat slows down over a part of a turn


class Blocks(NamedTuple):
    """Where the blocks of y are, for n states and m inputs; its size Y is `end`."""

    xi: slice
    sigma_hat: slice
    u_a: slice
    V: slice
    end: int


def blocks(n: int, m: int) -> Blocks:
    """The blocks of y."""
    first, second, third = n + m, n + 2 * m, n + 3 * m
    return Blocks(slice(0, n), slice(n, first), slice(first, second), slice(second, third), third)


class Flow(NamedTuple):
    """Flows of (y, p, p', p'') for B (n, m) or (n, m, N), where p is h, with E w after it where a wind blows.

    The time is in shares of the step for p. (.., Y, Z) over `half` and `whole` of it; (.., Z, Z) over a `part`, of
    which `parts` make a step; `rows` (.., 2 parts m, Z): sigma_hat after every half of a part.
    """

    half: Array
    whole: Array
    part: Array
    rows: Array
    parts: int
    length: float
    B: Array


class Fast:
    """The fast part of loops with the same gains; those that do not adapt know h."""

    def __init__(self, adapts: bool, gains: LoopGains, P: Array, m: int, forces: int) -> None:
        self.adapts, self.gains, self.P, self.forces = adapts, gains, P, forces
        self.at, self._m = blocks(len(P), m), m
        self.root = np.sqrt(gains.adaptation_rate or 1.0)
        layer = gains.smooth or 0.0
        self.limit = gains.projection_radius / np.sqrt(1 + layer)  # 2.5: within this F <= 0

    def flow(self, B: Array, length: float, level: int) -> Flow:
        """The flows over a step of a level."""
        G = np.moveaxis(self._generator(B if B.ndim == 3 else B[..., None], length), -1, 0)
        turns = length * self._speed(B) / _TURN * 2**level
        halvings = 2 + int(np.clip(np.ceil(np.log2(max(turns, 1.0))), 0, _MOST_HALVINGS))
        powers = [_exponential(G / 2**halvings)]
        rows = powers[0][:, self.at.sigma_hat]
        for _ in range(halvings):
            if self.adapts:
                rows = np.concatenate([rows, rows @ powers[-1]], axis=1)
            powers.append(powers[-1] @ powers[-1])
        own = (powers[-2][:, : self.at.end], powers[-1][:, : self.at.end], powers[1], rows)
        half, whole, part, rows = own if B.ndim == 3 else [flow[0] for flow in own]
        return Flow(half, whole, part, rows, 2 ** (halvings - 1), length, B)

    def _speed(self, B: Array) -> float:
        """How fast y turns, in rad/s: omega, g and sqrt(Gamma) |S B|."""
        square = (B * np.einsum("ij,j...->i...", self.P, B)).sum(axis=(0, 1)).max()
        speed = max(self.gains.bandwidth, self.gains.predictor_gain)
        if self.adapts:
            speed = max(speed, self.root * np.sqrt(square))
            speed *= max(1.0, _LAYERED / self.gains.smooth) if self.gains.smooth else 1.0
        return float(speed)

    def _generator(self, B: Array, length: float) -> Array:
        """G with (y, p, p', p'')' = G (y, p, p', p''), (Z, Z, N), of the time in shares of the step."""
        gains, at, F = self.gains, self.at, self.forces
        n, m, N = B.shape
        G = np.zeros((at.end + 3 * F, at.end + 3 * F, N))
        h, wind = slice(at.end, at.end + m), slice(at.end + m, at.end + F)
        one, all_states = np.eye(m)[..., None], np.eye(n)[..., None]
        G[at.V, at.u_a] = one
        G[at.u_a, at.u_a] = -gains.bandwidth * one  # (0.8) u_a' = -omega (u_a + ...
        G[at.u_a, at.sigma_hat if self.adapts else h] = -gains.bandwidth * one  # ... sigma_hat or h)
        if self.adapts:
            G[at.xi, at.xi] = -gains.predictor_gain * all_states  # (0.6) - (0.1): xtilde' = A_m xtilde ...
            G[at.xi, at.sigma_hat] = self.root * B  # ... + B sigma_hat ...
            G[at.xi, h] = -self.root * B  # ... - B h ...
            G[at.xi, wind] = -self.root * all_states[:, : F - m]  # ... - E w
            pull = np.einsum("ikN,ij->kjN", B, self.P)
            G[at.sigma_hat, at.xi] = -self.root * pull  # (0.7): -Gamma B'P xtilde
        G *= length
        shift = np.arange(at.end, at.end + 2 * F)
        G[shift, shift + F] = 1.0
        return G

    def idle(self, flow: Flow, z: Array, whole: bool) -> Array:
        """V (m, N) after the whole step or half of it, from z = (y, p, p', p'') (Z, N), were the projection idle."""
        return _applied((flow.whole if whole else flow.half)[..., self.at.V, :], z)

    def advance(self, flow: Flow, z: Array) -> Array:
        """y (Y, N) after the whole step, from z = (y, p, p', p'') (Z, N)."""
        y = _applied(flow.whole, z)
        if self.adapts:
            seen = _applied(flow.rows, z).reshape(-1, self._m, z.shape[1])
            touching = np.flatnonzero((seen**2).sum(axis=1).max(axis=0) > self.limit**2)
            if len(touching):
                y[:, touching] = self._caught(flow, z, touching)
        return y

    def _caught(self, flow: Flow, z: Array, lanes: NDArray[np.intp]) -> Array:
        """y of some lanes after all parts of the step, with the projection."""
        at, dt = self.at, flow.length / flow.parts
        shared = flow.part.ndim == 2
        part, B = (flow.part, flow.B) if shared else (flow.part[lanes], flow.B[..., lanes])
        missing = np.zeros((len(z), self._m, *B.shape[2:]))  # what a cut was missing from, on the way to it
        missing[at.xi] = dt / 2 * self.root * B
        one = np.eye(self._m).reshape(self._m, self._m, *[1] * (B.ndim - 2))
        missing[at.sigma_hat], missing[at.u_a] = one, -dt / 2 * self.gains.bandwidth * one
        z = z[:, lanes]
        for _ in range(flow.parts):
            before, z = z[at.sigma_hat], _applied(part, z)
            z -= times(missing, self._cut(before, z[at.sigma_hat]))
        return z[: at.end]

    def _cut(self, before: Array, after: Array) -> Array:
        """What Proj of 2.5 takes out of sigma_hat (m, N) that goes from before to after, along its middle."""
        radius, nu, left = self.gains.projection_radius, self.gains.smooth, self._held(after)
        if self._m == 1 and not nu:
            return after - left
        for _ in range(2 if nu else 1):
            middle = (before + left) / 2
            square = np.maximum((middle**2).sum(axis=0), radius**2 / 4)
            taken = (middle * (after - self._held(after))).sum(axis=0)
            if nu:
                share = np.clip(((1 + nu) * square - radius**2) / (nu * radius**2), 0.0, 1.0)  # F of 2.5
                taken = share * np.maximum((middle * (after - before)).sum(axis=0), 0.0)
            left = self._held(after - taken / square * middle)
        return np.asarray(after - left)

    def _held(self, sigma: Array) -> Array:
        """The nearest point of the ball."""
        if self._m == 1:
            R = self.gains.projection_radius
            return np.minimum(np.maximum(sigma, -R), R)  # np.clip takes three times as long
        size, radius = np.sqrt((sigma**2).sum(axis=0)), self.gains.projection_radius
        return np.asarray(sigma * (radius / np.maximum(size, radius)))


def times(B: Array, u: Array) -> Array:
    """B u (n, N) for B (n, m) or (n, m, N) and u (m, N)."""
    return np.asarray(B @ u if B.ndim == 2 else np.einsum("ijn,jn->in", B, u))


def _applied(M: Array, z: Array) -> Array:
    """M z for M (r, Z) or (N, r, Z) and z (Z, N)."""
    return np.asarray(M @ z if M.ndim == 2 else np.matmul(M, z.T[..., None])[..., 0].T)


def _exponential(G: Array) -> Array:
    """exp(G), (N, Z, Z), of a G that is small: Taylor's polynomial."""
    one = np.eye(G.shape[-1])
    found = one + G / _ORDER
    for k in range(_ORDER - 1, 0, -1):
        found = one + G @ found / k
    return np.asarray(found)

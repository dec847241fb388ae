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
_WINDOW: Final = 6  # log2 of the half parts that are looked at together, for memory: five turns or more
_ORDER: Final = 7  # of Taylor's polynomial
_LAYERED: Final = 0.5  # within a smooth layer of this or less sigma_hat slows down over a part of a turn
_POLYNOMIALS: Final = (  # p, p', p'' at the start of a step by h at its stages so far
    ((1,), (0,), (0,)),
    ((1, 0), (-4, 4), (0, 0)),  # a line whose mean over half of the step is the stage before
    ((1, 0, 0), (-2, 0, 2), (0, 0, 0)),  # ... over the whole step
    ((1, 0, 0, 0), (-3, 2, 2, -1), (4, -4, -4, 4)),
)


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

    The time is in shares of the step for p. `powers` (.., Z, Z): over half of a part of the step, over a part, over
    two and so on; the last one is over all of the step. `rows` (.., L (n + 2 m), Z) are xi, sigma_hat and h after
    every one of L half parts, a window, and `held` (.., L m, Z) sigma_hat alone.
    """

    powers: list[Array]
    rows: Array
    held: Array
    length: float
    B: Array


class Fast:
    """The fast part of loops with the same gains; those that do not adapt know h."""

    def __init__(self, adapts: bool, gains: LoopGains, P: Array, m: int, forces: int) -> None:
        self.adapts, self.gains, self.P, self.forces = adapts, gains, P, forces
        self.at, self._m = blocks(len(P), m), m
        self._ahead, Y = list[Array](), self.at.end
        for own in _POLYNOMIALS:
            self._ahead.append(np.eye(Y + 3 * forces, Y + len(own[0]) * forces))
            self._ahead[-1][Y:, Y:] = np.kron(own, np.eye(forces))
        self.root = np.sqrt(gains.adaptation_rate or 1.0)
        self.limit = gains.projection_radius / np.sqrt(1 + (gains.smooth or 0.0))  # 2.5: within this F <= 0

    def flow(self, B: Array, length: float, level: int) -> Flow:
        """The flows over a step of a level."""
        G = np.moveaxis(self._generator(B if B.ndim == 3 else B[..., None], length), -1, 0)
        turns = length * self._speed(B) / _TURN * 2**level
        halvings = 2 + int(np.clip(np.ceil(np.log2(max(turns, 1.0))), 0, _MOST_HALVINGS))
        powers, n, m = [_exponential(G / 2**halvings)], len(self.P), self._m
        rows = powers[0][:, [*range(n + m), *range(self.at.end, self.at.end + m)]]
        for halving in range(halvings):
            if halving < _WINDOW and self.adapts:
                rows = np.concatenate([rows, rows @ powers[-1]], axis=1)
            powers.append(powers[-1] @ powers[-1])
        held = rows.reshape(len(G), -1, n + 2 * m, len(G[0]))[:, :, n : n + m].reshape(len(G), -1, len(G[0]))
        if B.ndim == 3:
            return Flow(powers, rows, held, length, B)
        return Flow([power[0] for power in powers], rows[0], held[0], length, B)

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

    def ahead(self, known: Array) -> Array:
        """(y, p, p', p'') at the start of a step, from y and h at its stages so far."""
        stages = (len(known) - self.at.end) // self.forces
        return np.asarray(self._ahead[stages - 1] @ known)

    def idle(self, flow: Flow, z: Array, whole: bool) -> Array:
        """V (m, N) after the whole step or half of it, from z = (y, p, p', p'') (Z, N), were the projection idle."""
        return _applied(flow.powers[-1 if whole else -2][..., self.at.V, :], z)

    def advance(self, flow: Flow, z: Array) -> tuple[Array, Array]:
        """y (Y, N) after the whole step, from z = (y, p, p', p'') (Z, N).

        Beside it the largest |S xtilde| and |sigma_hat - h| in the first window of the step, (2, N).
        """
        y = _applied(flow.powers[-1], z)[: self.at.end]
        if not self.adapts:
            return y, np.zeros((2, z.shape[1]))
        most, size, later = self._most(_applied(flow.rows, z)), np.zeros(z.shape[1]), z
        for window in range(2 ** max(0, len(flow.powers) - 1 - _WINDOW)):
            later = _applied(flow.powers[_WINDOW], later) if window else z
            held = _applied(flow.held, later).reshape(-1, self._m, z.shape[1])
            size = np.maximum(size, (held**2).sum(axis=1).max(axis=0))
        touching = np.flatnonzero(size > self.limit**2)
        if len(touching):
            y[:, touching], most[:, touching] = self._caught(flow, z[:, touching], touching)
        return y, most

    def _most(self, seen: Array) -> Array:
        """The largest |S xtilde| and |sigma_hat - h|, (2, N), of L times xi, sigma_hat and h, (L (n + 2 m), N)."""
        n, m = len(self.P), self._m
        seen = seen.reshape(-1, n + 2 * m, seen.shape[-1])
        xi, error = seen[:, :n], seen[:, n : n + m] - seen[:, n + m :]
        squares = (xi * (self.P @ xi)).sum(axis=1).max(axis=0), (error**2).sum(axis=1).max(axis=0)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / [[self.root], [1.0]])

    def _caught(self, flow: Flow, z: Array, lanes: NDArray[np.intp]) -> tuple[Array, Array]:
        """y of some lanes after all parts of the step, with the projection, and what is largest as in `advance`."""
        at, part, B = self.at, flow.powers[1], flow.B
        if B.ndim == 3:
            part, B = part[lanes], B[..., lanes]
        parts = 2 ** (len(flow.powers) - 2)
        seen, dt = list[Array](), flow.length / parts
        missing = np.zeros((len(z), self._m, *B.shape[2:]))  # what a cut was missing from, on the way to it
        missing[at.xi] = dt / 2 * self.root * B
        one = np.eye(self._m).reshape(self._m, self._m, *[1] * (B.ndim - 2))
        missing[at.sigma_hat], missing[at.u_a] = one, -dt / 2 * self.gains.bandwidth * one
        for i in range(parts):
            before, z = z[at.sigma_hat], _applied(part, z)
            z -= driven(missing, self._cut(before, z[at.sigma_hat]))
            if 2 * i < 2**_WINDOW:
                seen += [z[: at.u_a.start], z[at.end : at.end + self._m]]
        return z[: at.end], self._most(np.concatenate(seen))

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


def driven(B: Array, u: Array) -> Array:
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

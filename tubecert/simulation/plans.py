"""Random plans of a family, as lanes: square waves as inputs, steered back where x* comes near the edge of P.

In: the linear model about the middle of boxes P (n, 2) and Q (m, 2), draws in [0, 1). Whether a plan
keeps to P is looked at by who draws it. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np

from tubecert.enclosure.interval import Array

Slope: TypeAlias = Callable[[float, Array], Array]
SHARES: Final = (0.0, 0.5, 0.5, 1.0)  # of a step of the classical Runge-Kutta method, stage by stage
_WEIGHTS: Final = (1.0, 2.0, 2.0, 1.0)
_RICCATI: Final = 2000  # steps of the recursion
_FULL: Final = 0.7  # of all waves are as large as they may be
_EDGE: Final = (0.5, 0.9)  # of the ellipsoid: from where to where a plan turns back
_TINY: Final = 1e-9  # a box that is a point


def waves(draws: Array, samples: int, k: float) -> Array:
    """Square waves (c, N) of draws (3 c, N): periods from a sample to the run, most of size 1, others smaller."""
    period, phase, size = np.split(draws, 3)
    sign = np.sign(np.sin(2 * np.pi * (k / (2 * float(samples) ** period) + phase)))
    return np.asarray(np.where(size < _FULL, 1.0, (size - _FULL) / (1 - _FULL)) * sign)


def stepped(at: Callable[[int, Array], Array], x: Array, length: float, slope: Array) -> Array:
    """x after a step of the classical Runge-Kutta method, from the slopes `at` stages; that of the first is given."""
    total = slope
    for stage in (1, 2, 3):
        slope = at(stage, x + SHARES[stage] * length * slope)
        total = total + _WEIGHTS[stage] * slope
    return np.asarray(x + length / 6 * total)


def integrated(slope: Slope, t: float, x: Array, length: float, count: int) -> Array:
    """The states (n, N) a `length` later, by `count` Runge-Kutta steps."""
    h = length / count
    for s in (t + i * h for i in range(count)):

        def at(stage: int, z: Array, s: float = s) -> Array:
            return slope(s + SHARES[stage] * h, z)

        x = stepped(at, x, h, slope(s, x))
    return x


class Steering:
    """What keeps plans in P: inputs in Q as wished, held for Ts, but more and more a linear feedback near its edge.

    Near the edge is where off' `value` off, by the linear-quadratic problem of x' = A x + B u with these boxes as
    weights, nears 1, which it has where its ellipsoid leaves P.
    """

    def __init__(self, A: Array, B: Array, Ts: float, P: Array, Q: Array) -> None:
        from scipy.linalg import expm

        n, m = B.shape
        block = expm(np.vstack([np.hstack([A, B]), np.zeros((m, n + m))]) * Ts)
        A, B = block[:n, :n], block[:n, n:]
        (self.x, self.half), (self.u, self.reach) = (
            (box.mean(axis=1)[:, None], np.ptp(box, axis=1)[:, None] / 2) for box in (P, Q)
        )
        size, reach = (np.maximum(half[:, 0], _TINY) for half in (self.half, self.reach))
        weight, cost = np.diag(1 / size**2), np.diag(1 / reach**2)
        value: Array = weight
        for _ in range(_RICCATI):
            self.gain = np.asarray(np.linalg.solve(cost + B.T @ value @ B, B.T @ value @ A), dtype=float)
            value = np.asarray(weight + A.T @ value @ (A - B @ self.gain))
        free = size > _TINY
        level = (size[free] ** 2 / np.diag(np.linalg.inv(value))[free]).min(initial=np.inf)
        self.value = value / level

    def within(self, x: Array) -> Array:
        """Which lanes are in P, (N,)."""
        return np.asarray((abs(x - self.x) <= self.half).all(axis=0))

    def inside(self, draws: Array, wide: Array | float = 1.0) -> Array:
        """Where plans start, (n, N), in an ellipsoid that is wider by sqrt(`wide`)."""
        off = np.asarray((2 * draws - 1) * self.half, dtype=float)
        return np.asarray(self.x + off * np.sqrt(_EDGE[0] / np.maximum(self._out(off) / wide, _EDGE[0])))

    def input(self, x: Array, wish: Array, wide: Array | float = 1.0) -> Array:
        """u* (m, N) in Q for wishes (m, N) from -1 to 1 of it."""
        off = x - self.x
        near = np.clip((self._out(off) / wide - _EDGE[0]) / (_EDGE[1] - _EDGE[0]), 0, 1)
        pushed = (1 - near) * wish * self.reach - near * _times(self.gain, off)
        return np.asarray(self.u + np.clip(pushed, -self.reach, self.reach))

    def _out(self, off: Array) -> Array:
        """How far out points (n, N) off the middle are: 1 where the ellipsoid ends."""
        return np.asarray(sum(off * _times(self.value, off)))


def _times(matrix: Array, x: Array) -> Array:
    """The product with x (n, N), column by column: no lane depends on how many there are."""
    return np.asarray(sum(matrix[:, j, None] * row for j, row in enumerate(x)))

"""The dynamics in floats: batches of steps by RK4 and their derivatives. Untrusted: nothing here is a bound."""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import free_symbols
from tubecert.expression.matrix import jacobian
from tubecert.model import TIME, ControlAffineModel

_STAGES = (
    (0.0, 0.0),
    (0.5, 0.5),
    (0.5, 0.5),
    (1.0, 1.0),
)  # RK4: time of the stage, share of the slope before
_WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)
_ANY = np.zeros(())


class Dynamics:
    """x' = f(t, x) + B(x) u for N states at once: x has shape (n, N), u (m, N), t is a number or (N,)."""

    def __init__(self, model: ControlAffineModel) -> None:
        drift = [row[0] for row in model.drift_on_plan()]
        names, moved = (*model.states, *model.inputs, TIME), (*model.states, *model.inputs)
        self.n, self.m = len(model.states), len(model.inputs)
        self._rate = Tape(drift, names)
        slopes = jacobian(drift, moved)
        self._slopes = Tape([e for row in slopes for e in row], names)
        self._moves = TIME in free_symbols(drift)

    @np.errstate(all="ignore")
    def rate(self, t: Array | float, x: Array, u: Array) -> Array:
        """f + B u, (n, N)."""
        return self._rate_at(t, x, u)

    def _rate_at(self, t: Array | float, x: Array, u: Array) -> Array:
        now = np.broadcast_to(t, x.shape[1:]) if self._moves else _ANY
        return self._rate.run_floats_silenced([*x, *u, now], x.shape[1:])

    @np.errstate(all="ignore")
    def step(self, t: Array | float, x: Array, left: Array, right: Array, dt: float, *, count: int) -> Array:
        """The states a time dt after t, in `count` equal steps; u runs linearly from `left` to `right`."""
        h = dt / count
        for i in range(count):
            total, k = _ANY, _ANY
            for (c, a), weight in zip(_STAGES, _WEIGHTS, strict=True):
                share = (i + c) / count
                at = x + a * h * k if a else x
                k = self._rate_at(t + share * dt, at, (1 - share) * left + share * right)
                total = total + weight * k
            x = x + h * total
        return x

    @np.errstate(all="ignore")
    def step_slopes(self, t: Array, x: Array, left: Array, right: Array, dt: float, *, count: int) -> Array:
        """The derivatives of `step` by x, left and right: (N, n, n + 2 m)."""
        n, m = self.n, self.m
        h = dt / count
        N = x.shape[1]
        D = np.zeros((N, n, n + 2 * m))
        D[:, :, :n] = np.eye(n)
        for i in range(count):
            total, k = np.zeros_like(x), np.zeros_like(x)
            total_d, k_d = np.zeros_like(D), np.zeros_like(D)
            for (c, a), weight in zip(_STAGES, _WEIGHTS, strict=True):
                share = (i + c) / count
                at, u = x + a * h * k, (1 - share) * left + share * right
                now = np.broadcast_to(t + share * dt, (N,))
                both = self._slopes.run_floats_silenced([*at, *u, now], (N,)).T.reshape(N, n, n + m)
                k = self._rate_at(now, at, u)
                k_d = both[:, :, :n] @ (D + a * h * k_d)
                k_d[:, :, n : n + m] += (1 - share) * both[:, :, n:]
                k_d[:, :, n + m :] += share * both[:, :, n:]
                total, total_d = total + weight * k, total_d + weight * k_d
            x, D = x + h * total, D + h * total_d
        return D

"""The error equation of a sampled loop about its plan, and the size of all that acts on it, as floats.

In: a loop with its suprema. Out: `Plant`. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.remainders import Remainders

_FEW: Final = 48  # windows for a search
_SHARE: Final = 0.1  # of the safe set: where the remainder is fitted
_ROOM: Final = 1.0  # of an input without limits, there


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """e' = A e + B delta + H eta + E w + [I, B] rho, with y = e + n at every sample and delta held, `delay` late.

    A (n, n), B (n, m), H (n, r), E (n, k); `sample_time` and `delay` in s. Bounds: |n_i| <= noise_i (n,), or the
    length of n_i / noise_i <= 1 if `noise_ball`; |eta_i| <= magnitude_i, |eta_i'| <= rate_i (r,); |w_i| <= wind_i
    (k,), or the length of w_i / wind_i <= 1 if `wind_ball`; at the start |e_i| <= start_i (n,), |eta_i| <= eta_start_i
    (r,). `room` (m,): how far delta may go, inf where nothing limits it; `space` (n,): how far e may go at all;
    `wishes` (n,): half-widths asked for, inf where nothing is. `remainder`: W (n,), U (m,) -> the bound of |rho|
    (n + m,) while |e| < W, |delta| <= U; it grows with both.
    """

    A: Array
    B: Array
    H: Array
    E: Array
    sample_time: float
    delay: float
    noise: Array
    noise_ball: bool
    magnitude: Array
    rate: Array
    wind: Array
    wind_ball: bool
    room: Array
    wishes: Array
    space: Array
    start: Array
    eta_start: Array
    remainder: Callable[[Array, Array], Array]


def plant_of(remainders: Remainders, narrow: Array) -> Plant:
    """The error equation in floats, with `narrow` (m,) of the room that the inputs have."""
    loop, winds = remainders.loop, remainders.loop.sudden
    room = np.where(remainders.room > 0, remainders.room * narrow, 0.0)
    sizes, asked = remainders.sizes(np.zeros(loop.states)), dict(loop.spec.tube.half_widths)
    low, high = np.array(loop.spec.safe_set, dtype=float).T
    reach = np.where(np.isfinite(room) & (room > 0), room, _ROOM)
    return Plant(
        A=loop.A,
        B=loop.B,
        H=loop.H,
        E=np.hstack([loop.E[:, :0], *(columns for columns, _ in winds)]),
        sample_time=float(loop.sample_time),
        delay=float(loop.hardware.delayed),
        noise=loop.noise.each,
        noise_ball=loop.noise.length,
        magnitude=sizes.size,
        rate=sizes.rate,
        eta_start=sizes.first,
        wind=np.concatenate([np.zeros(0), *(size.each for _, size in winds)]),
        wind_ball=len(winds) == 1 and winds[0][1].length,
        room=room,
        wishes=np.array([float(asked.get(name, np.inf)) for name in loop.model.states]),
        space=space_of(remainders),
        start=loop.start.reach,
        remainder=fitted(Remainders(loop, _FEW), np.concatenate([_SHARE * (high - low), reach])),
    )


def space_of(remainders: Remainders) -> Array:
    """How far the plan is from the ends of the safe set, (n,)."""
    low, high = np.array(remainders.loop.spec.safe_set, dtype=float).T
    x = remainders.cells.x
    return np.asarray(np.maximum(np.minimum(high - x.hi.max(axis=0), x.lo.min(axis=0) - low), 1e-300))


def fitted(remainders: Remainders, reach: Array) -> Callable[[Array, Array], Array]:
    """rho(W, U) (n + m,) as c + V z + z'Q z, z = (W, U): exact where `reach` (n + m,) says, on axes and in pairs."""
    n, k = remainders.loop.states, len(reach)

    def bound(z: Array) -> Array:
        return remainders.rho(z[:n], z[n:], remainders.sizes(z[:n]).size)

    steps = np.diag(reach)
    base = bound(np.zeros(k))
    near = np.array([bound(0.5 * step) for step in steps]) - base
    far = np.array([bound(step) for step in steps]) - base
    bent = np.maximum(2 * far - 4 * near, 0.0)  # of reach_j^2
    slope = np.maximum(far - bent, 0.0)
    linear = slope / reach[:, None]
    square = np.zeros((k, k, len(base)))
    for i in range(k):
        square[i, i] = bent[i] / reach[i] ** 2
        for j in range(i):
            both = bound(steps[i] + steps[j]) - base - far[i] - far[j]
            square[i, j] = np.maximum(both, 0.0) / (reach[i] * reach[j])
    flat = np.nan_to_num(square.reshape(k, -1), posinf=1e30)
    linear = np.nan_to_num(linear, posinf=1e30)

    def rho(W: Array, U: Array) -> Array:
        z = np.concatenate([W, U])
        return np.asarray(base + z @ linear + z @ (z @ flat).reshape(k, -1))

    return rho

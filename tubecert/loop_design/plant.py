"""The error equation of a sampled loop about its plan, and the size of all that acts on it, as floats.

In: a loop with its suprema. Out: `Plant`. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import expm

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.remainders import Remainders

CLEAN: Final = 1e-12  # what is smaller, relative to what stands beside it, is of rounding alone
_QUIET: Final = 1e-300  # what is smaller is a 0 that was rounded outward
_FEW: Final = 48  # windows for a search
_SHARE: Final = 0.1  # of the safe set: where the remainder is fitted
_ROOM: Final = 1.0  # of an input without limits, there
_HORIZON: Final = 3.0  # sample times and delays after which a signal's effect is the unit of a state
_DOUBLED: Final = 10  # how often at most these are doubled, until inputs can undo a start


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """e' = A e + B delta + H eta + E w + [I, B] rho, with y = e + n at every sample and delta held, `delay` late.

    A (n, n), B (n, m), H (n, r), E (n, k); `sample_time` and `delay` in s. Bounds: |n_i| <= noise_i (n,), or the
    length of n_i / noise_i <= 1 if `noise_ball`; |eta_i| <= magnitude_i, |eta_i'| <= rate_i (r,); |w_i| <= 1, or the
    length of w <= 1 if `wind_ball`; at the start |e_i| <= start_i (n,), |eta_i| <= eta_start_i (r,). `room` (m,): how
    far delta may go, inf where nothing limits it; `space` (n,): how far e may go at all; `wishes` (n,): half-widths
    asked for, inf where nothing is. `remainder`: W (n,), U (m,) -> the bound of |rho| (n + m,) while |e| < W,
    |delta| <= U; it grows with both. States, inputs and eta are counted in `units` of what they were given in.
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
    wind_ball: bool
    room: Array
    wishes: Array
    space: Array
    start: Array
    eta_start: Array
    remainder: Callable[[Array, Array], Array]
    units: tuple[Array, Array, Array]

    @property
    def pushed(self) -> bool:
        """Whether anything acts but noise and the start."""
        return bool(self.magnitude.any() or self.E.any())


def plant_of(remainders: Remainders, narrow: Array) -> Plant:
    """The error equation in floats, with `narrow` (m,) of the room that the inputs have."""
    loop, winds, space = remainders.loop, remainders.loop.sudden, space_of(remainders)
    room = np.where(remainders.room > 0, remainders.room * narrow, 0.0)
    sizes, asked = remainders.sizes(np.zeros(loop.states)), dict(loop.spec.tube.half_widths)
    pushed = np.max(np.abs(loop.H) / space[:, None], axis=0, initial=0.0) * sizes.size
    acts = 1.0 * (pushed > CLEAN)  # on the safe set, in a second
    low, high = np.array(loop.spec.safe_set, dtype=float).T
    reach = np.where(np.isfinite(room) & (room > 0), room, _ROOM)
    return Plant(
        A=loop.A,
        B=loop.B,
        H=loop.H,
        E=np.hstack([loop.E[:, :0], *(columns * size.each for columns, size in winds)]),
        sample_time=float(loop.sample_time),
        delay=float(loop.hardware.delayed),
        noise=loop.noise.each,
        noise_ball=loop.noise.length,
        magnitude=sizes.size * acts,
        rate=sizes.rate * acts,
        eta_start=sizes.first * acts,
        wind_ball=len(winds) == 1 and winds[0][1].length,
        room=room,
        wishes=np.array([float(asked.get(name, np.inf)) for name in loop.model.states]),
        space=space,
        start=np.where(loop.start.reach > CLEAN * space, loop.start.reach, 0.0),
        remainder=fitted(Remainders(loop, _FEW), np.concatenate([_SHARE * (high - low), reach])),
        units=(np.ones(loop.states), np.ones(loop.inputs), np.ones(loop.H.shape[1])),
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

    steps, base = np.diag(reach), bound(np.zeros(k))
    near, far = (np.array([bound(share * step) for step in steps]) - base for share in (0.5, 1.0))
    bent = np.maximum(2 * far - 4 * near, 0.0)  # of reach_j^2
    linear = np.nan_to_num(np.maximum(far - bent, 0.0) / reach[:, None], posinf=1e30)
    square = np.zeros((k, k, len(base)))
    square[range(k), range(k)] = bent / reach[:, None] ** 2
    for i in range(k):
        for j in range(i):
            both = bound(steps[i] + steps[j]) - base - far[i] - far[j]
            square[i, j] = np.maximum(both, 0.0) / (reach[i] * reach[j])
    flat = np.nan_to_num(square.reshape(k, -1), posinf=1e30)

    def rho(W: Array, U: Array) -> Array:
        z = np.concatenate([W, U])
        return np.asarray(base + z @ linear + z @ (z @ flat).reshape(k, -1))

    return rho


def flow(A: Array, columns: Array, time: float) -> tuple[Array, Array]:
    """e^(A t) (n, n), and the integral of e^(A r) over [0, t] times the columns."""
    n, width = columns.shape
    block = np.zeros((n + width, n + width))
    block[:n, :n], block[:n, n:] = A, columns
    whole = expm(block * time)
    return whole[:n, :n], whole[:n, n:]


def in_units(plant: Plant) -> Plant:
    """The same plant, counted in what signals do to it before feedback answers: no result depends on the user's units.

    A start that inputs cannot undo so fast has more time. Units are not finite where too much happens within a sample.
    """
    horizon, room = _HORIZON * (plant.sample_time + plant.delay), np.minimum(plant.room, 1 / _QUIET)
    with np.errstate(all="ignore"):
        for _ in range(1 if plant.pushed else _DOUBLED):
            most = np.where(plant.rate > 0, plant.rate * horizon, np.inf)
            turned = np.minimum(plant.magnitude, most)
            a = np.where(turned > 0, turned, 1.0)  # a rate may be what rounding leaves
            columns = np.hstack([plant.H * a, plant.E, plant.B])
            pushed = np.max([np.abs(flow(plant.A, columns, horizon * i / 8)[1]) for i in range(1, 9)], axis=0)
            signals, moved = np.split(pushed, [-plant.B.shape[1]], axis=1)
            if not ((plant.start > moved @ room) & (moved > 0).any(axis=1)).any():
                break
            horizon *= 2
        s = np.max([signals.sum(axis=1), plant.noise, plant.start], axis=0)
        s = np.where(s > _QUIET, s, 0.0)
        answers = (moved / np.where(s > 0, s, np.inf)[:, None]).max(axis=0)
        u = np.where(np.isfinite(plant.room), plant.room, 10 / np.where(answers > 0, answers, 10))
        s = np.maximum(s, 0.1 * moved @ u)
        s = np.maximum(s, 1e-9 * (s.max() or 1.0))
    return replace(
        plant,
        A=plant.A * s / s[:, None], B=plant.B * u / s[:, None], H=plant.H * a / s[:, None], E=plant.E / s[:, None],
        noise=plant.noise / s, magnitude=plant.magnitude / a, rate=plant.rate / a, room=plant.room / u,
        wishes=plant.wishes / s, space=plant.space / s, start=plant.start / s, eta_start=plant.eta_start / a,
        remainder=lambda W, U: plant.remainder(W * s, U * u) / np.r_[s, u], units=(s, u, a),
    )  # fmt: skip

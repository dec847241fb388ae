"""The error equation of a sampled loop about its plan, and the size of all that acts on it, as floats.

In: numbers that somebody else has bounded. Out: `Plant`. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from tubecert.enclosure.interval import Array


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

"""Whether adaptation that a computer steps by Euler is stable by itself: before anything is simulated, and in words.

One period dt of (xtilde, s~ = sigma_hat - h) at a constant B, without projection: xtilde+ = (I + dt A_m) xtilde +
dt B s~, then s~+ = s~ - dt Gamma B' xtilde+. The projection bounds sigma_hat: an unstable adaptation does not diverge,
it bounces, and no two runs are alike.
"""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array

_HIGHEST = 1e12  # Hz; nobody has a faster computer
_DIGITS = 1e-3  # of the least rate


def growth(A: Array, B: Array, Gamma: float, dt: float) -> float:
    """The spectral radius of one period of dt s, for A (n, n) and B (n, m): above 1 the adaptation is unstable.

    A and B are those of the coordinates in which the adaptation is designed.
    """
    n, m = B.shape
    predicted = np.hstack([np.eye(n) + dt * A, dt * B])
    adapted = np.hstack([np.zeros((m, n)), np.eye(m)]) - dt * Gamma * B.T @ predicted
    return float(np.abs(np.linalg.eigvals(np.vstack([predicted, adapted]))).max())


def least_rate(A: Array, B: Array, Gamma: float, rate: float) -> float:
    """A control rate in Hz, above the given one, at which the adaptation is stable, to 0.1 %; inf if there is none."""
    high = rate
    while growth(A, B, Gamma, 1 / high) > 1:
        high *= 2
        if high > _HIGHEST:
            return np.inf
    low = high / 2
    while high - low > _DIGITS * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if growth(A, B, Gamma, 1 / middle) > 1 else (low, middle)
    return high

"""The length of a vector in the metric, sqrt(v' W^-1 v), without an inverse or a factor of W.

With any T: v' W^-1 v = (Tv)' (T W T')^-1 (Tv), between |Tv|^2/lmax(T W T') and |Tv|^2/lmin(T W T'); T is proposed in
floats such that T W T' is nearly the identity. Being linear in v, the bound stays sharp where v nearly vanishes.
"""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues_midrad,
    midrad,
    norm_bound,
    product,
    spectral_norm_midrad,
    whitening,
)
from tubecert.enclosure.objective import Estimate, Target
from tubecert.enclosure.taylor import Matrix, MatrixFunction


class MetricNorm:
    """|Theta v| for a column v(x) and a dual metric W(x) > 0, where Theta' Theta = W^-1."""

    def __init__(self, v: Matrix, W: Matrix, fixed: frozenset[str] = frozenset()) -> None:
        self._function = MatrixFunction([v, W], fixed=fixed)
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """|T v| at the vertices plus what the rest adds, over the root of the least eigenvalue of T W T'."""
        e = self._function.expand(lo, hi)
        v, W = e.mid
        t = whitening(W.mean(axis=1))[:, None]
        spread = [e.over_vertices(e.filled(k)) for k in range(2)]
        least = _least(t, W, spread[1])
        length = spectral_norm_midrad(*product((t, np.zeros_like(t)), (v, spread[0]))).hi
        value = (Interval.exact(length) / sqrt(Interval.exact(least))).hi
        value = np.where(np.isnan(value), np.inf, value)
        best = np.argmax(value, axis=1)
        signs = e.signs[best]
        corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
        of_v, of_W = (
            np.tile(norm_bound(rest), len(e.signs) // rest.shape[2])
            for rest in (np.abs(t) @ e.rest[0], e.rest[1])
        )
        caused = (of_v + length * of_W).max(axis=2).T
        caused = np.where(np.isfinite(caused), caused, np.finfo(float).max)
        return Estimate(value.max(axis=1), corner, caused, caused)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Lengths at points, rounded down."""
        v, W = (midrad(g) for g in self._function.at(lo, hi))
        t = whitening(W[0])
        most = eigenvalues_midrad(*congruence(t, *W)).hi[..., -1]
        length = spectral_norm_midrad(*product((t, np.zeros_like(t)), v)).lo
        value = (Interval.exact(length) / sqrt(Interval.exact(most))).lo
        return np.where(np.isnan(value), -np.inf, np.maximum(value, 0.0))


def _least(t: Array, mid: Array, rad: Array) -> Array:
    """A lower bound of the eigenvalues of T W T'; NaN where none is positive."""
    least = eigenvalues_midrad(*congruence(t, mid, rad)).lo[..., 0]
    return np.where(least > 0, least, np.nan)

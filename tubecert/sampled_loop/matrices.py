"""Interval matrices: products, blocks, exponentials and their integrals; sums of what is not negative.

What is not negative is added and multiplied in floats, and is off by as many units as there are roundings, one after
the other, but for what underflows; that is made good once, where it is compared (`theorem`).

Trusted: yes. Implements: theory of the sampled loop, section 2.
References: S. M. Rump, Acta Numerica 2010; N. J. Higham, Accuracy and Stability, 2002, eq. 3.13.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from functools import lru_cache
from math import factorial
from typing import Final

import numpy as np

from tubecert.enclosure import linalg
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.outward import down, up

UNIT: Final = 2.0**-53
ROUNDED: Final = 1e-11  # 90 000 roundings, one after the other, of numbers that are not negative
_TINY: Final = 1e-300  # covers what underflows in a product
_ROOT_TINY: Final = 1e-150  # the same below a root
_TERMS: Final = 18
_MOST: Final = Fraction(1, 2)
_E: Final = 1.7  # > e^(1/2)


def product(a: Interval, b: Interval) -> Interval:
    """A B for all A (p, k) and B (k, q), (p, q)."""
    if not a.lo.shape[-1]:  # a sum of no terms
        return nothing(len(a.lo), b.lo.shape[1])
    mid, rad = linalg.product(linalg.midrad(a), linalg.midrad(b))
    return Interval(down(mid - rad), up(mid + rad))


def nothing(rows: int, columns: int) -> Interval:
    """A matrix of zeros."""
    return Interval.exact(np.zeros((rows, columns)))


def stacked(rows: Sequence[Sequence[Interval]]) -> Interval:
    """Blocks side by side and one above the other."""
    return Interval(*(np.block([[getattr(own, end) for own in row] for row in rows]) for end in ("lo", "hi")))


def lengths(rows: Array) -> Array:
    """Euclidean lengths of rows of numbers that are not negative, (.., 1), but for roundings."""
    return np.asarray(np.sqrt(np.sum(rows * rows, axis=-1, keepdims=True)) + _ROOT_TINY)


def total(values: Array, weights: Array) -> Array:
    """sum_j values[..., j] weights[j] of numbers that are not negative, but for roundings."""
    return np.asarray(values @ weights + _TINY)


class Exponential:
    """Phi(s) = e^(A s) and J(s) = int_0^s Phi of one matrix of floats A (n, n) at exact times, each enclosed once.

    J(s) = s (I + A s/2 (I + A s/3 (..))) by Horner's rule, then Phi = I + A J exactly. What the series leaves out is at
    most s v^(K+1)/(K+2)! e^v in every entry, where v = |A| s in the norm of row sums, which no power exceeds (theory,
    section 2; entry by entry with |A|^(K+1) it would be false). Longer times are halved until v <= 1/2, then doubled:
    J(2 s) = (I + Phi(s)) J(s), Phi(2 s) = Phi(s)^2.
    """

    def __init__(self, A: Array) -> None:
        self.A, self._one = Interval.exact(A), Interval.exact(np.eye(len(A)))
        self._norm = Fraction(float(np.max(np.abs(A).sum(axis=1), initial=0.0) * (1 + ROUNDED)))
        self.at = lru_cache(maxsize=None)(self._at)

    def _at(self, s: Fraction) -> tuple[Interval, Interval]:
        """Phi(s) and J(s), each (n, n), for s >= 0."""
        if self._norm * s > _MOST:
            phi, whole = self.at(s / 2)
            return product(phi, phi), product(self._one + phi, whole)
        step, series = s * self.A, self._one
        for k in range(_TERMS, 0, -1):
            series = self._one + Fraction(1, k + 1) * product(step, series)
        left = _E * float(_MOST) ** (_TERMS + 1) / factorial(_TERMS + 2) * (1 + 1e-12)
        whole = s * (series + Interval(-left, left))
        return self._one + product(self.A, whole), whole

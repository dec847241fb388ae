"""Matrices that are known up to a radius, with sums and products that stay enclosures.

Trusted: yes. References: S. M. Rump, Acta Numerica 2010; N. J. Higham, Accuracy and Stability, 2002, eq. 3.13.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.enclosure.linalg import midrad, product

UNIT: Final = 2.0**-53
TINY: Final = 1e-300  # covers what underflows in a product
_ROOT_TINY: Final = 1e-150  # the same below a root
_ROUNDED: Final = 4 * UNIT  # more than twice the error of one operation
SUMMED: Final = 1 + 1e-12  # a sum of at most 4000 terms, none negative: 4000 u < 5e-13


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """All matrices within `rad` of `mid`, entry by entry; shapes (p, q)."""

    mid: Array
    rad: Array

    @classmethod
    def exact(cls, value: Array) -> Known:
        """Floats that are exact numbers."""
        return cls(value, np.zeros_like(value))

    @classmethod
    def zero(cls, rows: int, columns: int) -> Known:
        """Nothing."""
        return cls.exact(np.zeros((rows, columns)))

    @classmethod
    def of(cls, interval: Interval) -> Known:
        """An interval matrix."""
        return cls(*midrad(interval))

    @classmethod
    def stacked(cls, rows: Sequence[Sequence[Known]]) -> Known:
        """Blocks side by side and one above the other."""
        return cls(
            *(np.block([[getattr(own, name) for own in row] for row in rows]) for name in ("mid", "rad"))
        )

    @property
    def above(self) -> Array:
        """sup |x| of every entry."""
        return np.asarray((np.abs(self.mid) + self.rad) * (1 + _ROUNDED))

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return int(self.mid.shape[0])

    def __getitem__(self, index: tuple[slice, slice]) -> Known:
        return Known(self.mid[index], self.rad[index])

    def __matmul__(self, other: Known) -> Known:
        if not self.mid.shape[-1]:  # a sum of no terms
            zero = np.zeros((self.rows, other.mid.shape[1]))
            return Known(zero, zero)
        return Known(*product((self.mid, self.rad), (other.mid, other.rad)))

    def __add__(self, other: Known) -> Known:
        mid = self.mid + other.mid
        return Known(mid, (self.rad + other.rad) * (1 + _ROUNDED) + _ROUNDED * np.abs(mid))

    def __sub__(self, other: Known) -> Known:
        return self + Known(-other.mid, other.rad)

    def times(self, q: Fraction) -> Known:
        """The product with an exact number."""
        low, high = fraction_bounds(q)
        mid = self.mid * low
        rad = self.above * (high - low) + self.rad * abs(low)
        return Known(mid, rad * (1 + 2 * _ROUNDED) + _ROUNDED * np.abs(mid) + TINY)


def lengths(rows: Array) -> Array:
    """Euclidean lengths of rows of numbers that are not negative, (.., 1), from above."""
    return np.asarray(np.sqrt(np.sum(rows * rows, axis=-1, keepdims=True)) * SUMMED + _ROOT_TINY)


def total(values: Array, weights: Array) -> Array:
    """sum_j values[..., j] weights[j] of numbers that are not negative, from above."""
    return np.asarray(values @ weights * SUMMED + TINY)

"""The state predictor A_m as the conditions see it: three norms, with P = I.

Verified for a general matrix; closed for -g I, which every search uses. Implements: theory section 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

import numpy as np

from tubecert.conditions.arithmetic import T, absolute, quiet
from tubecert.enclosure.interval import Interval

Matrix = tuple[tuple[Fraction, ...], ...]


def scalar_gain(A_m: Matrix) -> Fraction | None:
    """The g of A_m = -g I, or None."""
    g = -A_m[0][0]
    same = all(entry == (-g if i == j else 0) for i, row in enumerate(A_m) for j, entry in enumerate(row))
    return g if same else None


def _enclosed_matrix(A: Matrix) -> Interval:
    bounds = np.array([[(float(x.lo), float(x.hi)) for x in map(Interval.of, row)] for row in A])
    return Interval(bounds[..., 0], bounds[..., 1])


def damping(A_m: Matrix) -> Interval:
    """lmin(Q) for Q = -(A_m + A_m'), q of (2.11)."""
    g = scalar_gain(A_m)
    if g is not None:
        return Interval.of(2 * g)
    from tubecert.enclosure.linalg import eigenvalues

    n = len(A_m)
    Q = tuple(tuple(-(A_m[i][j] + A_m[j][i]) for j in range(n)) for i in range(n))
    return eigenvalues(_enclosed_matrix(Q))[..., 0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Predictor(Generic[T]):
    """What the conditions need of A_m: |A_m|, |A_m + omega I| and q = lmin(Q); P = I. `scalar`: A_m = -g I."""

    norm: T
    shifted: T
    q: T
    scalar: bool = False

    @staticmethod
    def of_gain(g: T, omega: T) -> Predictor[T]:
        """A_m = -g I, as in theory 2.7: omega + |g - omega| in (2.12)."""
        return Predictor(norm=g, shifted=absolute(omega - g), q=2 * g, scalar=True)


@quiet
def predictor_of_matrix(A_m: Matrix, omega: Interval) -> Predictor[Interval]:
    """The same for any matrix, with verified norms; `omega` may be an array, (2.11)-(2.13)."""
    from tubecert.enclosure.linalg import spectral_norm

    A = _enclosed_matrix(A_m)
    n = len(A_m)
    diagonal = Interval(omega.lo[..., None, None] * np.eye(n), omega.hi[..., None, None] * np.eye(n))
    return Predictor(norm=spectral_norm(A), shifted=spectral_norm(A + diagonal), q=damping(A_m))


def predictor(A_m: Matrix | None, omega: T, g: T | None) -> Predictor[T]:
    """The predictor of the loop: -g I, or the matrix A_m if g is None."""
    if g is not None:
        return Predictor.of_gain(g, omega)
    if A_m is None:
        raise ValueError("`auto` needs a gain")
    if isinstance(omega, Interval):
        return predictor_of_matrix(A_m, omega)
    # the search is in floats: it proposes, the verified norms above decide
    A = np.array([[float(x) for x in row] for row in A_m])
    moved = A + np.asarray(omega)[..., None, None] * np.eye(len(A))
    shifted = np.asarray(np.linalg.norm(moved, 2, axis=(-2, -1)))
    q = np.asarray(np.linalg.eigvalsh(-(A + A.T))[0])
    return Predictor(norm=np.asarray(np.linalg.norm(A, 2)), shifted=shifted, q=q)

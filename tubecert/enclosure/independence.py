"""Whether the columns of a matrix B(x) are independent on a box, without minors or B'B.

If |I - R B| < 1 for any matrix R, then R B is invertible (by its Neumann series), so B v = 0 for v = 0 only. R is
proposed in floats, box by box: the pseudo-inverse in its middle.
"""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import finite, norm_bound, product, spectral_norm_midrad
from tubecert.enclosure.objective import Estimate, Target, estimate_of
from tubecert.enclosure.outward import up
from tubecert.enclosure.taylor import Matrix, MatrixFunction


class Dependence:
    """|I - R B(x)| with an R of its own for every box: below 1 where the columns of B are independent.

    It proves; a value of 1 or more says nothing about B, so that it never refutes.
    """

    def __init__(self, matrix: Matrix) -> None:
        self._function = MatrixFunction([matrix])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The norm is convex in B: that of the affine part at its vertices, plus what the rest adds."""
        e = self._function.expand(lo, hi)
        R = _left_inverse(e.mid[0].mean(axis=1))[:, None]
        exact = np.zeros_like(R)
        mid, rad = product((R, exact), (e.mid[0], e.over_vertices(e.rad[0])))
        departure = np.eye(R.shape[-2]) - mid
        rad = up(rad + 2.0**-52 * np.abs(departure))  # the subtraction is rounded once, by half of that
        rest, slack = product((np.abs(R), exact), (e.rest[0].sum(axis=0), np.zeros_like(e.rad[0])))
        added = e.over_vertices(norm_bound(up(rest + slack)))
        value = up(spectral_norm_midrad(departure, rad).hi + added)
        caused = norm_bound(np.abs(R[None]) @ e.rest[0]).max(axis=2)
        return estimate_of(value, caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Nothing is known from below."""
        return np.full(len(lo), -np.inf)


def _left_inverse(middle: Array) -> Array:
    """Floats R with R B close to the identity: a proposal, 0 where there is none."""
    ok = finite(middle)[..., None, None]
    inverse = np.linalg.pinv(np.where(ok, middle, 0.0))
    return np.where(finite(inverse)[..., None, None], inverse, 0.0)

"""Coordinates in which a constant metric is nearly the identity: norms become those of plain matrices. Trusted."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.bounds.constants import Constant
from tubecert.coordinates import Coordinates
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.enclosure.pencil import Pencil
from tubecert.expression.matrix import (
    Matrix,
    identity,
    multiply,
    transpose,
)


@dataclass(frozen=True, kw_only=True)
class Whitened:
    """Coordinates y = T x in which a constant W is nearly the identity: `least` I <= T W T' <= `most` I."""

    coordinates: Coordinates
    least: float
    most: float

    def vector(self, a: Matrix) -> Matrix:
        """T a."""
        return multiply(self.coordinates.S, a)

    def map(self, a: Matrix) -> Matrix:
        """T A T^-1."""
        return self.vector(multiply(a, self.coordinates.S_inverse))

    def form(self, a: Matrix) -> Matrix:
        """T A T'."""
        return multiply(self.vector(a), transpose(self.coordinates.S))

    def of_form(self, found: Constant) -> Constant:
        """|Theta A Theta'| from |T A T'|, theory 8.2."""
        return _scaled(found, 1 / Interval(self.least, self.most))

    def length(self, found: Constant) -> Constant:
        """|Theta a| from |T a|: M = T'(T W T')^-1 T, theory 8.2."""
        return _scaled(found, 1 / sqrt(Interval(self.least, self.most)))

    def norm(self, found: Constant) -> Constant:
        """|Theta A Theta^-1| from |T A T^-1|, theory 8.2."""
        root = sqrt(Interval(self.least, self.most))
        return _scaled(found, root / root)


def _scaled(found: Constant, factor: Interval) -> Constant:
    value = Interval(found.below, found.above) * factor
    return Constant(below=max(0.0, float(value.lo)), above=float(value.hi), at=found.at)


def whitened(W: Matrix) -> Whitened | None:
    """Such coordinates, if W is a matrix of rational numbers."""
    if not all(e.is_constant for row in W for e in row):
        return None
    factor = np.linalg.inv(np.linalg.cholesky(np.array([[float(e.fraction) for e in row] for row in W])))
    T = Coordinates(tuple(tuple(Fraction(float(x)) for x in row) for row in factor))
    scaled = multiply(multiply(T.S, W), transpose(T.S))
    unit, nowhere = identity(len(W)), BoxDomain({})
    most = supremum(Pencil(scaled, unit), nowhere, Effort()).above
    least = -supremum(Pencil([[-e for e in row] for row in scaled], unit), nowhere, Effort()).above
    return Whitened(coordinates=T, least=least, most=most)

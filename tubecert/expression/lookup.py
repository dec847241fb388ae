"""Functions given by a table: piecewise cubic, C1 by construction, exact.

Between the knots x_i and x_{i+1}, of values y and slopes d, with s = x - x_i and h = x_{i+1} - x_i, the function is
Hermite's cubic y_i + d_i s + (3 D - 2 d_i - d_{i+1})/h s^2 + (d_i + d_{i+1} - 2 D)/h^2 s^3, D = (y_{i+1} - y_i)/h. Two
pieces agree in value and slope at the knot that they share, whatever the numbers are: no rounding can part them. The
first and the last piece go on for `MARGIN` of the length of the table, so that a safe set may end where the table does.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import Final

MARGIN: Final = Fraction(1, 10**6)
ROUGH: Final = 4  # the order from which all derivatives are the same: 0 inside of a piece, none at a knot


@dataclass(frozen=True, slots=True)
class Lookup:
    """The derivative of some `order` of the function through the knots with these values and slopes.

    The second derivative is what it is on either side of a knot; from the third on there is none at a knot.
    """

    name: str
    knots: tuple[Fraction, ...]
    values: tuple[Fraction, ...]
    slopes: tuple[Fraction, ...]
    order: int = 0

    def __hash__(self) -> int:
        """Of what is short."""
        return hash((self.name, len(self.knots), self.order))

    def __str__(self) -> str:
        return self.name + "'" * self.order

    @property
    def derivative(self) -> Lookup:
        """The derivative; from the order `ROUGH` on it is of the same kind."""
        return replace(self, order=min(self.order + 1, ROUGH))

    @property
    def start(self) -> Fraction:
        """Where it begins to be defined (an open end)."""
        return self.knots[0] - MARGIN * (self.knots[-1] - self.knots[0])

    @property
    def end(self) -> Fraction:
        """Where it ends (an open end)."""
        return self.knots[-1] + MARGIN * (self.knots[-1] - self.knots[0])

    @property
    def pieces(self) -> tuple[tuple[Fraction, ...], ...]:
        """The coefficients of every piece in powers of x - x_i, ascending, of this derivative; at least one each."""
        return _pieces(self)

    def at(self, x: Fraction) -> Fraction | None:
        """The exact value; None beyond the ends, and at a knot of what jumps there."""
        if not self.start < x < self.end or (self.order > 1 and x in self.knots[1:-1]):
            return None
        i = min(max(bisect_right(self.knots, x) - 1, 0), len(self.knots) - 2)
        total = Fraction(0)
        for c in reversed(self.pieces[i]):
            total = total * (x - self.knots[i]) + c
        return total


_FAR: Final = Fraction(10**200)
UNKNOWN: Final = Lookup("unknown", (-_FAR, _FAR), 2 * (Fraction(1),), 2 * (Fraction(0),))
"""In the place of a table that is not known: 1 everywhere."""


@cache
def _pieces(table: Lookup) -> tuple[tuple[Fraction, ...], ...]:
    rows = zip(table.knots, table.values, table.slopes, strict=True)
    return tuple(_derived(_cubic(left, right), table.order) for left, right in pairwise(rows))


def _cubic(left: Sequence[Fraction], right: Sequence[Fraction]) -> tuple[Fraction, ...]:
    (x, y, d), (x1, y1, d1) = left, right
    h = x1 - x
    mean = (y1 - y) / h
    return y, d, (3 * mean - 2 * d - d1) / h, (d + d1 - 2 * mean) / h**2


def _derived(coefficients: Sequence[Fraction], order: int) -> tuple[Fraction, ...]:
    for _ in range(order):
        coefficients = [k * c for k, c in enumerate(coefficients)][1:]
    return tuple(coefficients) or (Fraction(0),)

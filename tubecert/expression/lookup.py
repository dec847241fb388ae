"""Functions given by a table: piecewise cubic, C1 by construction, exact.

Between the knots x_i and x_{i+1}, of values y and slopes d, with s = x - x_i and h = x_{i+1} - x_i, the function is
Hermite's cubic y_i + d_i s + (3 D - 2 d_i - d_{i+1})/h s^2 + (d_i + d_{i+1} - 2 D)/h^2 s^3, D = (y_{i+1} - y_i)/h. Two
pieces agree in value and slope at the knot that they share, whatever the numbers are: no rounding can part them. The
first and the last piece go on for `MARGIN` of the length of the table, so that a safe set may end where the table does.

Slopes that are not given are rational, rounded to `DIGITS` digits. `monotone_slopes`: those of PCHIP (Fritsch and
Butland, with the ends of Moler), which keep a rising table rising; rounded towards 0, which keeps that. `cubic_slopes`:
those of the spline with continuous second derivative whose first two and last two pieces are one cubic each
(not-a-knot).
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
DIGITS: Final = 20
_INNER: Final = 60  # digits that are kept while a spline is solved for
ROUGH: Final = 4  # the order from which all derivatives are the same: 0 inside of a piece, none at a knot

Numbers = Sequence[Fraction]


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


def monotone_slopes(x: Numbers, y: Numbers) -> tuple[Fraction, ...]:
    """PCHIP's slopes."""
    h, mean = _steps(x), _means(x, y)
    if len(h) == 1:
        return _shortened((mean[0], mean[0]))
    inner = [_between(*each) for each in zip(h, h[1:], mean, mean[1:], strict=False)]
    ends = _at_end(h[0], h[1], mean[0], mean[1]), _at_end(h[-1], h[-2], mean[-1], mean[-2])
    return _shortened((ends[0], *inner, ends[1]))


def cubic_slopes(x: Numbers, y: Numbers) -> tuple[Fraction, ...]:
    """Those of the not-a-knot spline; of three points a parabola, of two a line."""
    h, mean = _steps(x), _means(x, y)
    if len(h) == 1:
        return _shortened((mean[0], mean[0]))
    if len(h) == 2:
        bend = (mean[1] - mean[0]) / (h[0] + h[1])
        return _shortened((mean[0] - bend * h[0], mean[0] + bend * h[0], mean[1] + bend * h[1]))
    rows = [(Fraction(0), h[1], h[0] + h[1], _free(h[0], h[1], mean[0], mean[1]))]
    for a, b, p, q in zip(h, h[1:], mean, mean[1:], strict=False):
        rows.append((b, 2 * (a + b), a, 3 * (b * p + a * q)))
    rows.append((h[-1] + h[-2], h[-2], Fraction(0), _free(h[-1], h[-2], mean[-1], mean[-2])))
    return _shortened(_solved(rows))


def _steps(x: Numbers) -> list[Fraction]:
    return [b - a for a, b in pairwise(x)]


def _means(x: Numbers, y: Numbers) -> list[Fraction]:
    return [(q - p) / step for (p, q), step in zip(pairwise(y), _steps(x), strict=True)]


def _between(h: Fraction, h1: Fraction, mean: Fraction, mean1: Fraction) -> Fraction:
    """A weighted harmonic mean of the slopes of the chords; 0 where the table turns."""
    if mean * mean1 <= 0:
        return Fraction(0)
    w, w1 = 2 * h1 + h, h1 + 2 * h
    return (w + w1) / (w / mean + w1 / mean1)


def _at_end(h: Fraction, h1: Fraction, mean: Fraction, mean1: Fraction) -> Fraction:
    """A one-sided slope of three points, kept monotone."""
    slope = ((2 * h + h1) * mean - h * mean1) / (h + h1)
    if slope * mean <= 0:
        return Fraction(0)
    return 3 * mean if mean * mean1 <= 0 and abs(slope) > 3 * abs(mean) else slope


def _free(h: Fraction, h1: Fraction, mean: Fraction, mean1: Fraction) -> Fraction:
    """The right-hand side of h1 d0 + (h + h1) d1 = ..., with which the first two pieces are one cubic."""
    return ((h + 2 * (h + h1)) * h1 * mean + h**2 * mean1) / (h + h1)


def _solved(rows: Sequence[tuple[Fraction, Fraction, Fraction, Fraction]]) -> list[Fraction]:
    """The solution of tridiagonal equations (before, own, after, right-hand side), by elimination."""
    passed: list[tuple[Fraction, Fraction]] = []
    for before, own, after, right in rows:
        share, value = passed[-1] if passed else (Fraction(0), Fraction(0))
        pivot = own - before * share
        passed.append((rounded(after / pivot, _INNER), rounded((right - before * value) / pivot, _INNER)))
    found: list[Fraction] = []
    for share, value in reversed(passed):
        found.append(value - share * found[-1] if found else value)
    return found[::-1]


def _shortened(slopes: Numbers) -> tuple[Fraction, ...]:
    return tuple(rounded(slope, DIGITS) for slope in slopes)


def rounded(q: Fraction, digits: int) -> Fraction:
    """A decimal of about so many digits, towards 0."""
    if not q:
        return q
    bits = abs(q.numerator).bit_length() - q.denominator.bit_length()
    grid = Fraction(10) ** (bits * 30103 // 100000 - digits)
    size = abs(q) // grid * grid
    return size if q > 0 else -size

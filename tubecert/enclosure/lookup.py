"""Enclosures of the functions of tables: by their values at ends of intervals, and at every turning point between.

A derivative of order 0, 1 or 2 is monotone between two neighbours of its `marks`: the knots and the zeros of its own
derivative. So its range on an interval is that of its values at the ends and at the marks inside (at a knot: on both
sides). Marks are located by exact rational arithmetic and rounded outward; one that an interval may touch counts. From
the third order on there is no derivative at a knot: an interval that touches one gets NaN, which bounds nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.expression import Lookup

_JUMPS = 3  # the order from which a knot has no derivative
_STEPS = 200  # of a bisection between floats


@dataclass(frozen=True, slots=True)
class _Marks:
    """Where a function may turn or jump, ascending, with its values there; `least[k]` is of 2^k marks from each on."""

    place: Interval
    least: tuple[Array, ...]
    greatest: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class _Prepared:
    """A table in floats: knots and coefficients (descending) enclosed, and the ends of its range rounded inward."""

    knots: Interval
    coefficients: tuple[Interval, ...]
    start: float
    end: float
    marks: _Marks | None  # None: from the third derivative on


def values(table: Lookup, x: Array) -> Array:
    """Float values; NaN beyond the ends. For proposals only."""
    ready = _prepared(table)
    x = np.asarray(x, dtype=np.float64)
    i = _piece(ready, x)
    s = x - ready.knots.lo[i]
    total = np.zeros_like(s)
    for c in ready.coefficients:
        total = total * s + c.lo[i]
    return np.where((x >= ready.start) & (x <= ready.end), total, np.nan)


def enclosure(table: Lookup, x: Interval) -> Interval:
    """Enclosures of the function (or of a derivative, see `Lookup`); NaN where an interval leaves the table."""
    ready = _prepared(table)
    lo, hi = np.broadcast_arrays(x.lo, x.hi)
    left, right = _ends(ready, lo), _ends(ready, hi)
    found = left.hull(right)
    bad = ~((lo >= ready.start) & (hi <= ready.end))
    if ready.marks is None:
        knots = ready.knots[1:-1]
        bad |= np.searchsorted(knots.hi, lo, "left") < np.searchsorted(knots.lo, hi, "right")
    else:
        found = _with_marks(found, ready.marks, lo, hi)
    return Interval(np.where(bad, np.nan, found.lo), np.where(bad, np.nan, found.hi))


def _piece(ready: _Prepared, x: Array) -> NDArray[np.intp]:
    """The piece of a float: that on the right of a knot that it is."""
    found = np.searchsorted(ready.knots.hi, np.where(np.isnan(x), ready.start, x), "right") - 1
    return np.clip(found, 0, len(ready.knots.hi) - 2)


def _ends(ready: _Prepared, x: Array) -> Interval:
    """Values at floats, by Horner's rule."""
    i = _piece(ready, x)
    s = Interval.exact(x) - ready.knots[i]
    total = ready.coefficients[0][i]
    for c in ready.coefficients[1:]:
        total = total * s + c[i]
    return total


def _with_marks(found: Interval, marks: _Marks, lo: Array, hi: Array) -> Interval:
    """The hull with the values at all marks that may lie between."""
    first = np.searchsorted(marks.place.hi, lo, "left")
    count = np.searchsorted(marks.place.lo, hi, "right") - first
    level = np.frexp(np.maximum(count, 1).astype(np.float64))[1] - 1  # 2^level <= count
    least, greatest = found.lo.copy(), found.hi.copy()
    for k in range(len(marks.least)):
        here = (level == k) & (count > 0)
        if here.any():
            a, b = first[here], first[here] + count[here] - 2**k
            least[here] = np.minimum(least[here], np.minimum(marks.least[k][a], marks.least[k][b]))
            greatest[here] = np.maximum(
                greatest[here], np.maximum(marks.greatest[k][a], marks.greatest[k][b])
            )
    return Interval(least, greatest)


@cache
def _prepared(table: Lookup) -> _Prepared:
    knots = _enclosed(table.knots)
    columns = [_enclosed(column) for column in zip(*table.pieces, strict=True)]
    start, end = fraction_bounds(table.start)[1], fraction_bounds(table.end)[0]
    bare = _Prepared(knots, tuple(reversed(columns)), start, end, None)
    if table.order >= _JUMPS:
        return bare
    return _Prepared(knots, bare.coefficients, start, end, _marks(table, bare))


def _enclosed(numbers: Sequence[Fraction]) -> Interval:
    lo, hi = zip(*map(fraction_bounds, numbers), strict=True)
    return Interval(np.array(lo), np.array(hi))


def _marks(table: Lookup, ready: _Prepared) -> _Marks:
    places: list[tuple[float, float]] = []
    ranges: list[tuple[float, float]] = []
    ends = [table.start, *table.knots[1:-1], table.end]
    for i, piece in enumerate(table.pieces):
        knot, left, right = table.knots[i], ends[i], ends[i + 1]
        for place in (*_turning(piece, knot, left, right), _rounded(knot), _rounded(table.knots[i + 1])):
            s = Interval(*map(np.array, place)) - ready.knots[i]
            total = ready.coefficients[0][i]
            for c in ready.coefficients[1:]:
                total = total * s + c[i]
            places.append(place)
            ranges.append((float(total.lo), float(total.hi)))
    order = sorted(range(len(places)), key=lambda k: places[k])
    lo = np.array([places[k][0] for k in order])
    hi = np.maximum.accumulate(np.array([places[k][1] for k in order]))
    least, greatest = ([np.array([ranges[k][side] for k in order])] for side in (0, 1))
    while (width := 2 ** len(least)) <= len(order):
        last, half = len(order) - width + 1, width // 2
        least.append(np.minimum(least[-1][:last], least[-1][half : half + last]))
        greatest.append(np.maximum(greatest[-1][:last], greatest[-1][half : half + last]))
    return _Marks(Interval(lo, hi), tuple(least), tuple(greatest))


def _rounded(x: Fraction) -> tuple[float, float]:
    lo, hi = fraction_bounds(x)
    return float(lo), float(hi)


def _turning(
    piece: Sequence[Fraction], knot: Fraction, left: Fraction, right: Fraction
) -> list[tuple[float, float]]:
    """Enclosures of the zeros of a piece's derivative between its ends, which are marks themselves."""
    slope = [k * c for k, c in enumerate(piece)][1:]
    cuts = [left, right]
    if len(slope) == 3 and slope[2]:
        vertex = knot - slope[1] / (2 * slope[2])
        if left < vertex < right:
            cuts = [left, vertex, right]
    found = [root for a, b in pairwise(cuts) for root in _root(slope, knot, a, b)]
    return [*found, *(_rounded(cut) for cut in cuts[1:-1])]  # of a double root there is no change of sign


def _root(slope: Sequence[Fraction], knot: Fraction, a: Fraction, b: Fraction) -> list[tuple[float, float]]:
    """Where a polynomial that is monotone between a and b changes its sign there, between neighbouring floats."""

    def sign(x: Fraction) -> int:
        total = Fraction(0)
        for c in reversed(slope):
            total = total * (x - knot) + c
        return (total > 0) - (total < 0)

    first, last = sign(a), sign(b)
    if first * last >= 0:
        return [_rounded(x) for x, s in ((a, first), (b, last)) if s == 0]
    lo, hi = fraction_bounds(a)[0], fraction_bounds(b)[1]
    for _ in range(_STEPS):
        middle = 0.5 * lo + 0.5 * hi
        if not lo < middle < hi:
            break
        exact = Fraction(middle)
        if exact <= a or (exact < b and sign(exact) == first):
            lo = middle
        else:
            hi = middle
    return [(lo, hi)]

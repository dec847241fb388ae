"""The function of a table as a computer has it: how far it is off, by the argument, the piece and its cubic. Trusted.

Implements: theory 8.11 (H.45).
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from itertools import pairwise

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.lookup import enclosure
from tubecert.export.followed import Float, Followed, UncoveredError, combined, intervals_of
from tubecert.expression.lookup import MARGIN, Lookup

Rounder = Callable[[Interval, Interval], Followed]


def followed(table: Lookup, x: Followed, real: Float, rounded: Rounder) -> Followed:
    """Of an argument that is off; raises `UncoveredError` for knots that are no longer apart in this type."""
    off = Interval.exact(x.error)
    wide = Interval((x.value - off).lo, (x.value + off).hi)
    slope = Interval.exact(enclosure(table.derivative, wide).sanitised().magnitude)
    own = _worst(table, wide, _cubics(table, real, rounded)) + _seam(table, real).hi
    moved = slope * off
    return Followed(value=enclosure(table, x.value), error=(moved + Interval.exact(own)).hi)


def _near(table: Lookup, real: Float) -> Fraction:
    """So far beyond an end of a piece the code may take a number for one of it: knots are rounded."""
    far = max(abs(q) for q in table.knots)
    found = 2 * (real.unit * far + real.least)
    if min(b - a for a, b in pairwise(table.knots)) <= 4 * found:
        raise UncoveredError(f"the table {table.name}, in this type: its knots have no digit that is right")
    return found


def _cubics(table: Lookup, real: Float, rounded: Rounder) -> Array:
    """(K,): what every cubic rounds, as Horner's rule is computed from what is subtracted in the code."""
    u, eta = Interval.of(real.unit), Interval.of(real.least)
    beyond = _near(table, real) + MARGIN * (table.knots[-1] - table.knots[0])
    begin = intervals_of(table.knots[:-1])
    length = intervals_of([b - a for a, b in pairwise(table.knots)])
    most = Interval.of(beyond).hi
    kept = u * Interval.exact(begin.magnitude) + eta
    s = rounded(Interval(-most * np.ones_like(length.hi), (length + Interval.exact(most)).hi), kept)
    powers = [_constant(intervals_of([piece[k] for piece in table.pieces]), u, eta) for k in range(4)]
    found = powers[3]
    for own in reversed(powers[:3]):
        found = rounded(*combined("mul", s, found))
        found = rounded(*combined("add", own, found))
    return found.error


def _constant(value: Interval, u: Interval, eta: Interval) -> Followed:
    return Followed(value=value, error=(u * Interval.exact(value.magnitude) + eta).hi)


def _worst(table: Lookup, wide: Interval, errors: Array) -> Array:
    """The largest error of the pieces that a range may touch, and of their neighbours."""
    begin = np.array([float(q) for q in table.knots[:-1]])
    low, high = np.atleast_1d(wide.lo), np.atleast_1d(wide.hi)
    first = np.maximum(np.searchsorted(begin, low) - 2, 0)
    last = np.minimum(np.searchsorted(begin, high) + 1, len(begin))
    found = np.array([errors[a : max(b, a + 1)].max() for a, b in zip(first, last, strict=True)])
    known = np.isfinite(low) & np.isfinite(high)
    return np.asarray(np.where(known, found, np.inf).reshape(np.shape(wide.lo)))


def _seam(table: Lookup, real: Float) -> Interval:
    """Cubics that meet in value and slope, so little beyond their knot."""
    near = _near(table, real)
    worst = Fraction(0)
    for (p, q), (a, b) in zip(pairwise(table.pieces), pairwise(table.knots), strict=False):
        bent = abs(p[2]) + 3 * abs(p[3]) * (b - a) + abs(q[2])
        worst = max(worst, bent * near**2 + (abs(p[3]) + abs(q[3])) * near**3)
    return Interval.of(worst)

"""Slopes at the knots of a table, in rational arithmetic, rounded to `DIGITS` digits: a table with them is exact.

`monotone`: those of PCHIP (Fritsch and Butland, with the ends of Moler), which keep a rising table rising; rounded
towards 0, which keeps that. `cubic`: those of the spline with continuous second derivative whose first two and last two
pieces are one cubic each (not-a-knot).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final

DIGITS: Final = 20
_INNER: Final = 60  # digits that are kept while a spline is solved for

Numbers = Sequence[Fraction]


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

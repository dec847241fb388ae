"""Norms of columns over a ball or an ellipsoid around a point, where its own constraint carries the proof.

For the largest |G|^2 over d'Q d <= rho^2, d = x - x*, boxes alone are poor: near its boundary a box always has corners
outside. With any L >= 0, t^2 - |G|^2 - L (rho^2 - d'Q d) >= 0 on a box proves |G| <= t for its points in the tube, and
with the multiplier of the maximum the left-hand side has no slope along the boundary. L is a proposal: an ascent in
floats. Q is the identity for a ball; of an ellipsoid in more states it is that of the projection.
A box is examined by a lower bound of the quadratic form about its centre, one variable at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, magnitude
from tubecert.recheck.boxes import Box, Found
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.place import Place
from tubecert.recheck.program import Program
from tubecert.recheck.terms import NOUGHT, Term, in_order, names, number, slopes, variable

_ASCENTS = 60
_BESIDE = 16  # points of what the constraint does not contain, less one


def column_below(place: Place, column: Sequence[Term], limit: Fraction, budget: int) -> Outcome | None:
    """|G| <= limit over the tube of a plan that stays where it is; None if there is no multiplier that helps.

    G may also depend on t and on what is known by ranges, which the constraint of the tube does not contain.
    """
    if any(e.op in ("norm", "direction", "table") for e in in_order(column)):
        return None  # no curvature
    if limit < 0:
        return None  # |G|^2 <= limit^2 would say nothing
    square = sum((e * e for e in column), start=NOUGHT)
    centre = dict(zip(place.system.states, place.curve.start, strict=True))
    found = sorted(names([square]))
    variables = tuple(v for v in found if v in centre)
    beside = tuple(v for v in found if v not in centre)
    if not variables or set(beside) & set(place.system.inputs):
        return None
    own = [centre[v] for v in variables]
    which = [place.system.states.index(v) for v in variables]
    middle = [float(x.mid()) for x in Program(own, ()).run(())]
    values = _Square(square, variables, beside, middle, place.around.directions(which))
    share = _multiplier(values, float(place.rho), _samples(place, beside))
    if share is None:
        return None
    offsets = [variable(v) - x for v, x in zip(variables, own, strict=True)]
    products = (
        number(q) * a * b
        for a, row in zip(offsets, place.around.form(which), strict=True)
        for b, q in zip(offsets, row, strict=True)
        if q
    )
    inside = number(place.rho**2) - sum(products, start=NOUGHT)
    test = QuadraticNotNegative(number(limit**2) - square - number(share) * inside)
    return prove(test, place.tube(), budget)


class _Square:
    """|G|^2 and its slopes along d at x = x* + C d, in floats; `beside` are what else it depends on."""

    def __init__(
        self,
        square: Term,
        variables: tuple[str, ...],
        beside: tuple[str, ...],
        centre: list[float],
        C: list[list[float]],
    ) -> None:
        self.count = len(variables)
        self._centre, self._C = centre, C
        self._program = Program([square, *(slopes([square], v)[0] for v in variables)], (*variables, *beside))

    def at(self, d: list[float], beside: tuple[float, ...]) -> tuple[float, list[float]]:
        """The value and the slopes."""
        offset = [sum(c * x for c, x in zip(row, d, strict=True)) for row in self._C]
        at = [*(c + x for c, x in zip(self._centre, offset, strict=True)), *beside]
        value, *slope = (float(y.mid()) for y in self._program.run([arb(x) for x in at]))
        return value, [
            sum(row[j] * g for row, g in zip(self._C, slope, strict=True)) for j in range(self.count)
        ]


def _samples(place: Place, beside: tuple[str, ...]) -> list[tuple[float, ...]]:
    """Points of what the constraint does not contain, on one diagonal of its box: a proposal."""
    if not beside:
        return [()]
    ((box, _),) = place.tube().start(beside)
    return [tuple(lo + (hi - lo) * k / _BESIDE for lo, hi in box) for k in range(_BESIDE + 1)]


def _multiplier(square: _Square, rho: float, samples: list[tuple[float, ...]]) -> Fraction | None:
    """L with grad |G|^2 = 2 L Q (x - x*) at the largest |G|^2 that is found on x - x* = C d, |d| = rho."""
    starts = []
    for start in range(2 * square.count):
        d = [0.1 * rho] * square.count
        d[start // 2] = rho if start % 2 else -rho
        starts.append(d)
    beside = samples[0]
    if len(samples) > 1:  # the ascent leaves them as they are
        largest = max(product(starts, samples), key=lambda pair: square.at(*pair)[0])
        starts, beside = [largest[0]], largest[1]
    best = -math.inf
    share = 0.0
    for first in starts:
        d, value, along = first, -math.inf, 0.0
        for _ in range(_ASCENTS):
            value, slope = square.at(d, beside)
            size = math.hypot(*slope)
            if not 0 < size < math.inf:
                break
            along = sum(g * x for g, x in zip(slope, d, strict=True))
            d = [rho * g / size for g in slope]
        if value > best:
            best, share = value, along / (2 * rho * rho)
    return Fraction(share) if 0 < share < math.inf else None


class QuadraticNotNegative:
    """e(x) >= 0, by its gradient at the centre of a box and its curvature over the box.

    Off the diagonal, 2 |d_i d_j| <= d_i^2 r_j/r_i + d_j^2 r_i/r_j; what remains is g d + h d^2/2 in each variable,
    whose least value for |d| <= r is known exactly. Curvature upward is never paid for.
    """

    def __init__(self, e: Term) -> None:
        self.variables = tuple(sorted(names([e])))
        first = [slopes([e], v)[0] for v in self.variables]
        self._centre = Program([e, *first], self.variables)
        self._pairs = [(i, j) for i in range(len(first)) for j in range(i, len(first))]
        self._bends = Program(
            [slopes([first[i]], self.variables[j])[0] for i, j in self._pairs], self.variables
        )

    def over(self, box: Box) -> Found:
        """The least value of the quadratic form."""
        middle = [arb(min(max(0.5 * lo + 0.5 * hi, lo), hi)) for lo, hi in box]
        radius = [(arb(hi) - c).max(c - arb(lo)).upper() for (lo, hi), c in zip(box, middle, strict=True)]
        value, *slope = self._centre.run(middle)
        bends = self._bends.run([arb(lo).union(arb(hi)) for lo, hi in box])
        steepest = [r * g for r, g in zip(radius, slope, strict=True)]  # in units of the box: |d| <= 1
        bend = [arb(0)] * len(box)
        for (i, j), h in zip(self._pairs, bends, strict=True):
            size = radius[i] * radius[j] * h
            if i == j:
                bend[i] = bend[i] + size
            else:
                bend[i], bend[j] = bend[i] - magnitude(size), bend[j] - magnitude(size)
        least = [_least(g, h) for g, h in zip(steepest, bend, strict=True)]
        total = value + sum(least, start=arb(0))
        causes = [max(0.0, -float(x.lower())) if x.is_finite() else math.inf for x in least]
        return Found(bool(total >= 0), causes, [0.0] * len(box))

    def broken(self, point: Sequence[Ball]) -> bool:
        """A multiplier that does not serve refutes nothing."""
        del point
        return False


def _least(g: Ball, h: Ball) -> Ball:
    """A lower bound of g d + h d^2/2 for |d| <= 1, close to the least value where g and h are thin."""
    slope, bend = magnitude(g), h.lower()
    if bend >= slope and bend > 0:
        return (-slope * slope / (2 * bend)).lower()
    return (bend / 2 - slope).lower()

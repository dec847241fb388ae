"""Norms of matrices over the tube, by the way that decides them in the fewest boxes.

A matrix is taken apart where no entry joins its rows and columns; a column about a plan that stays where it is goes by
a multiplier for the tube (theory 1a.8), in many variables by its linear part (1a.7). Where these do not decide, boxes
do; only they contradict.

Norms of columns over a ball or an ellipsoid around a point, by their linear part (theory 1a.7).

With any constants g, K: G = g + K (x - x*) + r, and K (x - x*) = K S^-1 z with |z| <= rho, so
    |G| <= |g| + rho |K S^-1| + |r|.
Each r_i is examined in the variables that it has. K is a proposal, slopes of chords of the tube; so is what every |r_i|
is asked to stay below, such that the squares sum up to the square of what is left.

Norms of columns over a ball or an ellipsoid around a point, where its own constraint carries the proof.

For the largest |G|^2 over d'Q d <= rho^2, d = x - x*, boxes alone are poor: near its boundary a box always has corners
outside. With any L >= 0, t^2 - |G|^2 - L (rho^2 - d'Q d) >= 0 on a box proves |G| <= t for its points in the tube, and
with the multiplier of the maximum the left-hand side has no slope along the boundary. L is a proposal: an ascent in
floats. Q is the identity for a ball; of an ellipsoid in more states it is that of the projection.
A box is examined by a lower bound of the quadratic form about its centre, one variable at a time or as a whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, exact, is_positive, length, sharp_norm
from tubecert.recheck.boxes import Box, Found
from tubecert.recheck.cover import Outcome, prove, together
from tubecert.recheck.lipschitz import norms_below
from tubecert.recheck.place import Place
from tubecert.recheck.program import Program
from tubecert.recheck.terms import (
    NOUGHT,
    Rows,
    Term,
    blocks,
    in_order,
    names,
    number,
    number_of,
    slopes,
    variable,
)

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
    n = range(square.count)
    starts = [[end if i == j else 0.1 * rho for j in n] for i in n for end in (-rho, rho)]
    beside = samples[0]
    if len(samples) > 1:  # the ascent leaves them as they are
        largest = max(product(starts, samples), key=lambda pair: square.at(*pair)[0])
        starts, beside = [largest[0]], largest[1]
    best, share = -math.inf, 0.0
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
    Where variables go together, as in a long thin tube, all n at once: with |d_i| <= 1 in units of the box,
    2 e(x) >= [1 d'] [[e, g'], [g, h + (e/n) I]] [1 d']', because e d'd/n <= e. A definite matrix is proof.
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
        """The least value of the quadratic form, or that it is definite."""
        middle = [arb(min(max(0.5 * lo + 0.5 * hi, lo), hi)) for lo, hi in box]
        radius = [(arb(hi) - c).max(c - arb(lo)).upper() for (lo, hi), c in zip(box, middle, strict=True)]
        value, *slope = self._centre.run(middle)
        bends = self._bends.run([arb(lo).union(arb(hi)) for lo, hi in box])
        steepest = [r * g for r, g in zip(radius, slope, strict=True)]  # in units of the box: |d| <= 1
        bend = [arb(0)] * len(box)
        form = [[value, *steepest], *([g, *bend] for g in steepest)]
        for (i, j), h in zip(self._pairs, bends, strict=True):
            size = radius[i] * radius[j] * h
            form[i + 1][j + 1] = form[j + 1][i + 1] = size + (value / len(box) if i == j else 0)
            if i == j:
                bend[i] = bend[i] + size
            else:
                bend[i], bend[j] = bend[i] - size.abs_upper(), bend[j] - size.abs_upper()
        least = [_least(g, h) for g, h in zip(steepest, bend, strict=True)]
        total = value + sum(least, start=arb(0))
        causes = [max(0.0, -float(x.lower())) if x.is_finite() else math.inf for x in least]
        return Found(bool(total >= 0) or is_positive(form), causes, [0.0] * len(box))

    def broken(self, point: Sequence[Ball]) -> bool:
        """A multiplier that does not serve refutes nothing."""
        del point
        return False


def _least(g: Ball, h: Ball) -> Ball:
    """A lower bound of g d + h d^2/2 for |d| <= 1, close to the least value where g and h are thin."""
    slope, bend = g.abs_upper(), h.lower()
    if bend >= slope and bend > 0:
        return (-slope * slope / (2 * bend)).lower()
    return (bend / 2 - slope).lower()


_CHORDS = (0.25, 0.5, 1.0)  # of the way to the rim
_SHARE = Fraction(1, 20)  # of what is left, for a remainder of which nothing is seen
_KEPT = 1 - Fraction(1, 10**9)


def straight_below(place: Place, column: Sequence[Term], limit: Fraction) -> Outcome | None:
    """|G| <= limit over the tube of a plan that stays where it is; None if the linear part leaves too little.

    Theory 1a.7.
    """
    states, start = place.system.states, place.curve.start
    if not names(column) <= set(states) or any(e.op != "const" for e in start):
        return None
    centre = [number_of(e) for e in start]
    rim = list(_rim(place, [float(q) for q in centre]))
    g, K = _proposed(column, states, centre, rim)
    straight_in_z = place.fields.covector([[number(k) for k in row] for row in K])
    H = [[exact(number_of(e)) for e in row] for row in straight_in_z]
    left = exact(limit) - length([exact(q) for q in g]) - exact(place.rho) * sharp_norm(H)
    if not left > 0:
        return None
    room = Fraction(float(left.lower())) * _KEPT
    offsets = [variable(name) - x for name, x in zip(states, start, strict=True)]
    rest = []
    for e, q, row in zip(column, g, K, strict=True):
        straight = sum((number(k) * y for k, y in zip(row, offsets, strict=True) if k), start=number(q))
        rest.append(e - straight)
    most = _shared(rest, states, rim, room)
    if most is None or not sum(q * q for q in most) <= room * room:
        return None
    outcomes = []
    for e, own in zip(rest, most, strict=True):
        outcomes.append(prove(norms_below([[[e]]], own), place.tube(), place.budget))
        if not outcomes[-1].holds:
            return None
    return together(outcomes)


def _rim(place: Place, centre: Sequence[float]) -> Iterator[list[float]]:
    """For every state the point where it is largest, then the one where it is least: x* and those, in turns."""
    n = len(centre)
    spread = [[float(number_of(e)) for e in row] for row in place.fields.unit]
    for j in range(n):
        far = [float(place.rho) * spread[i][j] / math.sqrt(spread[j][j]) for i in range(n)]
        for share in _CHORDS:
            for sign in (1, -1):
                yield [c + sign * share * d for c, d in zip(centre, far, strict=True)]


def _proposed(
    column: Sequence[Term], states: Sequence[str], centre: Sequence[Fraction], rim: Sequence[Sequence[float]]
) -> tuple[list[Fraction], list[list[Fraction]]]:
    """G at the centre, and in column j of K the mean of its slopes by x_j where x_j changes most."""
    each = 2 * len(_CHORDS)
    g = [_short(x) for x in Program(list(column), states).run([exact(q) for q in centre])]
    columns = []
    for j, name in enumerate(states):
        program = Program(slopes(list(column), name), states)
        found = [program.run([arb(x) for x in point]) for point in rim[j * each : (j + 1) * each]]
        columns.append(
            [sum((_short(x) for x in own), Fraction(0)) / each for own in zip(*found, strict=True)]
        )
    return g, [list(row) for row in zip(*columns, strict=True)]


def _shared(
    rest: Sequence[Term], states: Sequence[str], rim: Sequence[Sequence[float]], room: Fraction
) -> list[Fraction] | None:
    """What every |r_i| is asked to stay below: as large as they look, with the same factor for all."""
    program = Program(list(rest), states)
    seen = [Fraction(0)] * len(rest)
    for point in rim:
        values = program.run([arb(x) for x in point])
        seen = [max(q, abs(_short(x))) for q, x in zip(seen, values, strict=True)]
    least = _SHARE * room / len(rest)
    asked = [max(q, least) if e is not NOUGHT else Fraction(0) for q, e in zip(seen, rest, strict=True)]
    size = math.sqrt(float(sum(q * q for q in asked)))
    factor = Fraction(float(room) / size) * _KEPT if size > 0 else Fraction(1)
    return [q * factor for q in asked] if factor >= 1 else None


def _short(value: arb) -> Fraction:
    """A number near a ball, for a proposal."""
    middle = float(value.mid())
    return Fraction(round(middle * 2**30), 2**30) if math.isfinite(middle) else Fraction(0)


_AT_ONCE = 12  # boxes that cost less than to look for a multiplier
_EASED = 300  # boxes with one, before boxes without are tried again
_FIRST = 500  # boxes before another way is tried
_FEW = 4  # variables in which boxes are poor


def norms(place: Place, matrices: Sequence[Rows], limit: Fraction) -> Outcome:
    """Whether the spectral norms of the matrices sum up to at most `limit` over the tube.

    What was confirmed of the same terms over the same tube, with a limit that is no larger, is not examined again.
    """
    key = tuple(tuple(tuple(row) for row in matrix) for matrix in matrices)  # equal terms are one object
    known = place.known.get(key)
    if known is not None and known[0] <= limit:
        return known[1]
    found = _examined(place, matrices, limit)
    if found.holds:
        place.known[key] = limit, found
    return found


def _examined(place: Place, matrices: Sequence[Rows], limit: Fraction) -> Outcome:
    parts = blocks(matrices[0]) if len(matrices) == 1 else []
    if len(parts) > 1:
        return together([norms(place, [part], limit) for part in parts])
    test = norms_below(matrices, limit)
    stays = not place.curve.moves and not place.curve.ranges
    column = [row[0] for row in matrices[0]]
    if not (stays and len(matrices) == 1 and len(matrices[0][0]) == 1):
        return prove(test, place.tube(), place.budget)
    found = prove(test, place.tube(), min(place.budget, _AT_ONCE))
    if found.verdict != "undecided" or place.budget <= _AT_ONCE:
        return found
    eased = column_below(place, column, limit, min(place.budget, _EASED))
    if eased is not None and eased.holds:
        return eased
    found = prove(test, place.tube(), min(place.budget, _FIRST))
    if found.verdict != "undecided" or place.budget <= _FIRST:
        return found
    straight = straight_below(place, column, limit) if len(test.variables) >= _FEW else None
    if straight is not None:
        return straight
    eased = column_below(place, column, limit, place.budget)
    if eased is not None and eased.holds:
        return eased
    return prove(test, place.tube(), place.budget)

"""Functions of tables on balls: Hermite's cubics in Bernstein form over every piece that a ball touches.

Between two knots the function is the cubic with their values and slopes. Over a part [u, v] of a piece a polynomial
of degree k lies between the least and the greatest of its k + 1 Bernstein coefficients, which follow from its values
and derivatives at u and v: of a cubic p these are p(u), p(u) + w p'(u)/3, p(v) - w p'(v)/3, p(v) with w = v - u.
Jumps of the second derivative lie between its values on either side; from the third on there is none at a knot.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache

from flint import arb

from tubecert.recheck.balls import Ball, ceiling, exact, floor

_BEYOND = Fraction(1, 10**6)  # of its length: how far a table goes on beyond its ends
_NONE_AT_KNOTS = 3  # the order from which a knot has no derivative
_LAST = 4  # from there on all are alike: 0 between knots


@dataclass(frozen=True)
class Table:
    """A derivative of the function of a table; `points` are (x, y, slope), x ascending.

    With a `side`, -1 or 1, it is looked at only on that side of an inner knot, where a ball touches a single one.
    """

    name: str
    points: tuple[tuple[Fraction, Fraction, Fraction], ...]
    order: int = 0
    side: int = 0

    def __hash__(self) -> int:
        """By what is short."""
        return hash((self.name, len(self.points), self.order))

    def __str__(self) -> str:
        return f"{self.name}{self.order}{self.side}{self.points}"

    @property
    def slope(self) -> Table:
        """The derivative of this."""
        return replace(self, order=min(self.order + 1, _LAST))

    @property
    def ends(self) -> tuple[Fraction, Fraction]:
        """Between them it is defined; they do not belong to it."""
        first, last = self.points[0][0], self.points[-1][0]
        more = _BEYOND * (last - first)
        return first - more, last + more

    def value(self, x: Fraction) -> Fraction | None:
        """Its exact value; None where it has none, and at knots where it jumps."""
        first, last = self.ends
        knots = [x for x, _, _ in self.points]
        if not first < x < last or (self.order >= 2 and x in knots[1:-1]):
            return None
        i = min(max(bisect_right(knots, x) - 1, 0), len(knots) - 2)
        coefficients = self.polynomial(i)
        return sum((c * (x - knots[i]) ** k for k, c in enumerate(coefficients)), start=Fraction(0))

    def polynomial(self, i: int) -> list[Fraction]:
        """The piece after knot i, of this derivative, by powers of the distance from the knot."""
        (x, y, d), (x1, y1, d1) = self.points[i : i + 2]
        w, rise = x1 - x, y1 - y
        # y H00 + w d H10 + y1 H01 + w d1 H11 with the basis of Hermite in s/w
        own = [y, d, (3 * rise - w * (2 * d + d1)) / w**2, (w * (d + d1) - 2 * rise) / w**3]
        for _ in range(self.order):
            own = [k * c for k, c in enumerate(own)][1:]
        return own or [Fraction(0)]


def smooth_on(table: Table, ball: Ball) -> bool:
    """Whether a ball touches no inner knot, so that the function has every derivative there."""
    inner = _made(table).knots[1:-1]
    return not any(knot.overlaps(ball) for knot in inner)


def over(table: Table, ball: Ball) -> Ball:
    """Everything that the function can be on a ball; not a number where that leaves the table."""
    made = _made(table)
    if not (ball.is_finite() and ball > made.first and ball < made.last):
        return arb("nan")
    if table.order >= _NONE_AT_KNOTS and not smooth_on(table, ball):
        return arb("nan")
    low, high = ball.lower(), ball.upper()
    first, last = 0, len(made.pieces) - 1
    touched = [k for k, knot in enumerate(made.knots[1:-1], 1) if knot.overlaps(ball)] if table.side else []
    if len(touched) == 1:
        first, last = (first, touched[0] - 1) if table.side < 0 else (touched[0], last)
    passed = bisect_left(made.upper, floor(low))  # knots that are proven to lie below
    i = min(max(passed - 1, first), last)
    found: Ball | None = None
    for k in range(i, last + 1):
        left, right = made.knots[k], made.knots[k + 1]
        if k + 2 < len(made.knots) and right < low:
            continue
        if k and left > high:
            break
        u = low if k == 0 else low.max(left)
        v = high if k == len(made.pieces) - 1 else high.min(right)
        part = _bernstein(made.pieces[k], u - left, v - left)
        found = part if found is None else found.union(part)
    return arb("nan") if found is None else found


def _bernstein(c: Sequence[Ball], u: Ball, v: Ball) -> Ball:
    """The hull of the Bernstein coefficients over [u, v] of a polynomial of degree at most 3."""
    w = v - u
    found = _at(c, u).union(_at(c, v))
    if len(c) == 3:
        found = found.union(_at(c, u) + w * _at(_slopes(c), u) / 2)
    if len(c) == 4:
        slope = _slopes(c)
        found = found.union(_at(c, u) + w * _at(slope, u) / 3).union(_at(c, v) - w * _at(slope, v) / 3)
    return found


def _slopes(c: Sequence[Ball]) -> list[Ball]:
    return [k * x for k, x in enumerate(c)][1:]


def _at(c: Sequence[Ball], s: Ball) -> Ball:
    total = arb(0)
    for x in reversed(c):
        total = total * s + x
    return total


@dataclass(frozen=True)
class _Made:
    knots: list[Ball]
    upper: list[float]  # of the knots
    pieces: list[list[Ball]]
    first: Ball
    last: Ball


@cache
def _made(table: Table) -> _Made:
    knots = [exact(x) for x, _, _ in table.points]
    first, last = table.ends
    return _Made(
        knots=knots,
        upper=[ceiling(knot) for knot in knots],
        pieces=[[exact(c) for c in table.polynomial(i)] for i in range(len(knots) - 1)],
        first=exact(first),
        last=exact(last),
    )

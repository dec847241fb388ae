"""The plan as a curve of segments: for every part of time a box that contains x* and one that contains u*.

A plan is a list of parts, each with x* and u* as terms of one variable s and numbers of its own: one part for a plan
given by expressions of t, one cubic Hermite piece for every pair of knots. Segments are halved where that is asked for.

A family of plans: x* anywhere in a box P, u* anywhere in a box U, the defect limited.

Nothing more is known of its members, so that a claim about the plan is one about P and U, and O(rho) is what lies
within rho of P. No claim contains x*', but for the defect.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from flint import arb

from tubecert.recheck.balls import Ball, ceiling, exact, floor
from tubecert.recheck.boxes import Field
from tubecert.recheck.cover import Range, as_ball
from tubecert.recheck.program import Program
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.specified.trajectory import AnyPlan
from tubecert.recheck.terms import Term, names, number, replaced, slopes, variable

CLOCK = "s#"  # no state can have this name
SINCE = "since#"
Ends = list[tuple[float, float]]
_HALVINGS = 12  # of a part of the plan, until its ranges have bounds


@dataclass(frozen=True)
class Part:
    """x* and u* as terms of s and of named `values`, for s in [0, length] at time start + s."""

    start: Fraction
    length: Ball
    values: dict[str, Ball]


@dataclass(frozen=True)
class Curve:
    """x*(s), u*(s) over parts; `horizon` None is for ever."""

    x: tuple[Term, ...]
    u: tuple[Term, ...]
    parts: tuple[Part, ...]
    horizon: Fraction | None
    start: tuple[Term, ...]  # x*(0), free of variables

    @property
    def ranges(self) -> Mapping[str, Range]:
        """Variables of x* and u* beside s: none for a plan that is known."""
        return {}

    def somewhere(self) -> list[Ball]:
        """An x* of a plan: x*(0). All others are connected with it."""
        return Program(list(self.start), ()).run([])

    @cached_property
    def moves(self) -> bool:
        """Whether it is more than a point."""
        return CLOCK in names([*self.x, *self.u])

    @cached_property
    def slope(self) -> list[Term]:
        """x*'."""
        return slopes(self.x, CLOCK)

    @cached_property
    def field(self) -> Field:
        """x* and u* on ranges of s."""
        return Field([*self.x, *self.u], self.parts[0].values)

    def at(self, t: Fraction) -> tuple[list[Ball], list[Ball]]:
        """x* and u* at a time of the plan; where u* jumps, what it jumps to."""
        part = self.parts[bisect_right(self.parts, t, key=lambda own: own.start) - 1]
        field = self.field.with_values(part.values)
        found = field.at([exact(t - part.start)] if field.variables else [])
        return found[: len(self.x)], found[len(self.x) :]

    @cached_property
    def root(self) -> Segment:
        """The whole curve."""
        level: list[Segment] = [
            piece for part in self.parts for piece in Piece(self, part, 0.0, ceiling(part.length)).bounded()
        ]
        while len(level) > 1:
            level = [Bundle(level[i : i + 2]) for i in range(0, len(level), 2)]
        return level[0]


class Segment:
    """A part of the curve: x* and u* lie in boxes, `when` is its time."""

    when: tuple[float, float]
    x: Ends
    u: Ends

    @property
    def halves(self) -> Sequence[Segment]:
        """Segments that cover this one; none if it cannot be halved."""
        raise NotImplementedError

    def middle(self) -> tuple[Ball, list[Ball], list[Ball]]:
        """A time of it, with x* and u* there."""
        raise NotImplementedError

    def nearest(self, state: int, at: float, own: Ball) -> Ball:
        """An x* of the segment in one state, where `own` is that of its middle, near to a number."""
        del state, at
        return own


class Piece(Segment):
    """A range of s in one part."""

    def __init__(self, curve: Curve, part: Part, lo: float, hi: float) -> None:
        self._curve, self._part, self._lo, self._hi = curve, part, lo, hi
        field = curve.field.with_values(part.values)
        found = field.hull([(lo, hi)] if field.variables else [])
        ends = [(floor(value), ceiling(value)) for value in found]
        n = len(curve.x)
        self.x, self.u = ends[:n], ends[n:]
        start = exact(part.start)
        self.when = floor(start + arb(lo)), ceiling(start + arb(hi))

    def bounded(self, halvings: int = _HALVINGS) -> list[Piece]:
        """Itself, or where it has no bounds (a root of a wide range) shorter ranges that have."""
        known = all(math.isfinite(end) for side in (*self.x, *self.u) for end in side)
        if known or not halvings or not self.halves:
            return [self]
        return [piece for half in self.halves for piece in half.bounded(halvings - 1)]

    @cached_property
    def halves(self) -> Sequence[Piece]:
        """Two ranges of s."""
        middle = 0.5 * self._lo + 0.5 * self._hi
        if not self._lo < middle < self._hi or not self._curve.moves:
            return ()
        return tuple(
            Piece(self._curve, self._part, *ends) for ends in ((self._lo, middle), (middle, self._hi))
        )

    def middle(self) -> tuple[Ball, list[Ball], list[Ball]]:
        """The middle of the range, or the end of the part if that comes first."""
        s = arb(min(0.5 * self._lo + 0.5 * self._hi, max(0.0, floor(self._part.length))))
        field = self._curve.field.with_values(self._part.values)
        found = field.at([s] if field.variables else [])
        n = len(self._curve.x)
        return exact(self._part.start) + s, found[:n], found[n:]


class Bundle(Segment):
    """Neighbouring segments together."""

    def __init__(self, parts: Sequence[Segment]) -> None:
        self._parts = tuple(parts)
        self.when = parts[0].when[0], parts[-1].when[1]
        self.x, self.u = _hull([part.x for part in parts]), _hull([part.u for part in parts])

    @property
    def halves(self) -> Sequence[Segment]:
        """What it consists of."""
        return self._parts

    def middle(self) -> tuple[Ball, list[Ball], list[Ball]]:
        """A point of the first one."""
        return self._parts[0].middle()


def _hull(boxes: Sequence[Ends]) -> Ends:
    return [(min(lo for lo, _ in side), max(hi for _, hi in side)) for side in zip(*boxes, strict=True)]


def expressed(
    x: Sequence[Term], u: Sequence[Term], time: str, horizon: Fraction | None, period: Ball | None = None
) -> Curve:
    """A curve given by terms of `time`; only a point needs no horizon (`ValueError`).

    s runs over one `period` of what else depends on t, where there is no horizon.
    """
    if horizon is None and time in names([*x, *u]):
        raise ValueError("a plan that moves needs a horizon")
    clock = {time: variable(CLOCK)}
    length = exact(horizon) if horizon is not None else exact(0) if period is None else period
    part = Part(Fraction(0), length, {})
    start = tuple(replaced(x, {time: number(0)}))
    return Curve(tuple(replaced(x, clock)), tuple(replaced(u, clock)), (part,), horizon, start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Knots:
    """Exact knots of a plan: times, states, inputs (row by row), and whether inputs are held or linear between.

    With `inner`, a time and inputs between every two knots, u* is the parabola through those and the two knots.
    """

    t: tuple[Fraction, ...]
    x: tuple[tuple[Fraction, ...], ...]
    u: tuple[tuple[Fraction, ...], ...]
    held: bool = False
    inner: tuple[tuple[Fraction, tuple[Fraction, ...]], ...] = ()


def hermite(
    knots: Knots, drift: Sequence[Term], states: Sequence[str], inputs: Sequence[str], horizon: Fraction
) -> Curve:
    """The cubics with the knots as ends and the slopes f + B u there, on the right side of each jump of u*.

    `drift` is f + B u in states, inputs and t. The last piece ends at the horizon. Where f contains t, every part knows
    when it begins.
    """
    s = variable(CLOCK)
    x = [_polynomial([variable(f"x{i}#{k}") for k in range(4)], s) for i in range(len(states))]
    powers = 3 if knots.inner else 2
    u = [_polynomial([variable(f"u{j}#{k}") for k in range(powers)], s) for j in range(len(inputs))]
    moving = TIME in names(drift)
    rate = Program(drift, (*states, *inputs, *((TIME,) if moving else ())))
    parts = []
    for k, (begin, end) in enumerate(pairwise(knots.t)):
        if begin >= horizon:
            break
        h, left = end - begin, knots.u[k]
        right = left if knots.held else knots.u[k + 1]
        ends = ((begin, knots.x[k], left), (end, knots.x[k + 1], right))
        m0, m1 = (rate.run([*map(exact, (*y, *v, *((t,) if moving else ())))]) for t, y, v in ends)
        values: dict[str, Ball] = {SINCE: exact(begin)} if moving else {}
        for i, (a, b) in enumerate(zip(knots.x[k], knots.x[k + 1], strict=True)):
            secant, width = exact((b - a) / h), exact(h)
            values |= {
                f"x{i}#0": exact(a),
                f"x{i}#1": m0[i],
                f"x{i}#2": (3 * secant - 2 * m0[i] - m1[i]) / width,
                f"x{i}#3": (m0[i] + m1[i] - 2 * secant) / (width * width),
            }
        for j, (p, q) in enumerate(zip(left, right, strict=True)):
            found = (
                [p, (q - p) / h] if not knots.inner else _parabola(knots.inner[k], j, (begin, p), (end, q))
            )
            values |= {f"u{j}#{power}": exact(c) for power, c in enumerate(found)}
        parts.append(Part(begin, exact(min(end, horizon) - begin), values))
    return Curve(tuple(x), tuple(u), tuple(parts), horizon, tuple(map(number, knots.x[0])))


def _parabola(
    inner: tuple[Fraction, tuple[Fraction, ...]],
    j: int,
    first: tuple[Fraction, Fraction],
    last: tuple[Fraction, Fraction],
) -> list[Fraction]:
    """Coefficients in s = t - t0 of the parabola through (t0, p), (t, row[j]) and (t1, q): divided differences."""
    (t0, p), (t1, q), (t, row) = first, last, inner
    steep = (row[j] - p) / (t - t0)
    bend = ((q - row[j]) / (t1 - t) - steep) / (t1 - t0)
    return [p, steep - bend * (t - t0), bend]


def _polynomial(coefficients: Sequence[Term], s: Term) -> Term:
    value = number(0)
    for c in reversed(coefficients):
        value = c + s * value
    return value


@dataclass(frozen=True)
class Everyone(Curve):
    """All members: x and u are variables, names with a star, in `ranges`; |p| is at most `limit`."""

    boxes: tuple[tuple[tuple[Fraction, Fraction], ...], tuple[tuple[Fraction, Fraction], ...]]
    named: Mapping[str, Range]
    limit: Fraction

    @property
    def ranges(self) -> Mapping[str, Range]:
        """P and U."""
        return self.named

    def somewhere(self) -> list[Ball]:
        """The centre of P, a box: all others are connected with it."""
        return [exact((low + high) / 2) for low, high in self.boxes[0]]

    @cached_property
    def slope(self) -> list[Term]:
        """Not known; raises `ValueError`."""
        raise ValueError("the slopes of a family of plans are not known")

    @cached_property
    def root(self) -> Segment:
        """P and U at once."""
        return Everywhere(*self.boxes)


class Everywhere(Segment):
    """Every plan at every time."""

    def __init__(
        self, P: Sequence[tuple[Fraction, Fraction]], U: Sequence[tuple[Fraction, Fraction]]
    ) -> None:
        self._P, self._U = P, U
        self.when = 0.0, 0.0
        self.x, self.u = _outward(P), _outward(U)

    @property
    def halves(self) -> Sequence[Segment]:
        """None: all of it is as good as any part."""
        return ()

    def middle(self) -> tuple[Ball, list[Ball], list[Ball]]:
        """The centres of P and U."""
        return arb(0), *([exact((low + high) / 2) for low, high in box] for box in (self._P, self._U))  # type: ignore[return-value]

    def nearest(self, state: int, at: float, own: Ball) -> Ball:
        """The nearest x* that a plan can have."""
        del own
        low, high = self._P[state]
        least, most = ceiling(exact(low)), floor(exact(high))
        return arb(min(max(at, least), most)) if least <= most else exact(low)


def _outward(box: Sequence[tuple[Fraction, Fraction]]) -> Ends:
    return [(floor(exact(low)), ceiling(exact(high))) for low, high in box]


def everyone(
    family: AnyPlan, states: Sequence[str], inputs: Sequence[str], times: Range | None = None
) -> Everyone:
    """The plans of a family as a curve; its start is not known. `times`: those of f, from 0 on; None if it has none."""
    P, U = (tuple(box[name] for name in names) for box, names in ((family.x, states), (family.u, inputs)))
    stars = [[f"{name}*" for name in names] for names in (states, inputs)]
    x, u = (tuple(map(variable, names)) for names in stars)
    named = dict(zip([*stars[0], *stars[1]], (*P, *U), strict=True))
    part = Part(Fraction(0), exact(0) if times is None else as_ball(times[1]), {})
    return Everyone(x, u, (part,), family.horizon, (), (P, U), named, family.defect)

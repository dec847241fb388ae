"""Numbers as a computer has them: a ball for what is exact, and a bound of how far the computer's is from that.

An analysis of rounding errors forwards, operation by operation. Every bound is a ball, of which the upper end
counts; what is not a number bounds nothing.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, between, exact, larger, magnitude, root, smaller, square
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.program import Program
from tubecert.recheck.terms import function, slopes, variable

_LIBRARY = 8  # units of rounding: 4 units in the last place, of a function of math.h but sqrt
_NOTHING = arb(0)


@dataclass(frozen=True, slots=True)
class Kind:
    """A type of IEEE 754: half of the distance of 1 to the next number, the least number, and one below infinity."""

    unit: Ball
    least: Ball
    most: Ball
    code: str

    def nearest(self, text: str) -> Ball:
        """The number of a decimal, of which a compiler makes the nearest one (6.4.4.2 of C99, annex F)."""
        literal = text.rstrip("f")
        if (text != literal) != (self.code == "f"):
            raise UnreadError(f"{text} is a number of another type")
        try:
            (own,) = struct.unpack(self.code, struct.pack(self.code, float(literal)))
        except OverflowError:
            raise UnreadError(f"{text} is too large for its type") from None
        return exact(Fraction(own))

    def nearest_to(self, value: Fraction) -> Ball:
        """The number nearest to an exact one."""
        (near,) = struct.unpack(self.code, struct.pack(self.code, float(value)))
        step = abs(Fraction(near)) * Fraction(1, 2**53 if self.code == "d" else 2**24)
        around = (
            struct.unpack(self.code, struct.pack(self.code, float(near + k * step)))[0]
            for k in (-2, -1, 0, 1, 2)
        )
        return exact(min(map(Fraction, around), key=lambda own: abs(own - value)))


KINDS = {
    "double": Kind(exact(Fraction(1, 2**53)), exact(Fraction(1, 2**1074)), arb(2) ** 1022, "d"),
    "float": Kind(exact(Fraction(1, 2**24)), exact(Fraction(1, 2**149)), arb(2) ** 126, "f"),
}


@dataclass(frozen=True, slots=True)
class Seen:
    """Exactly in `value`, and computed with an error of at most `error`; computed it is never below `least`.

    `degree`: a form of that degree in differences of vectors of which `origin` names the entries; None: it is none.
    """

    value: Ball
    error: Ball
    least: Ball | None = None
    degree: int | None = None
    origin: tuple[str, int] | None = None

    @property
    def most(self) -> Ball:
        """A bound of what the computer has."""
        return magnitude(self.value) + self.error

    @property
    def bottom(self) -> Ball:
        """A number that what the computer has is not below."""
        own = (self.value - self.error).lower()
        return own if self.least is None else larger(own, self.least)


def known(value: Ball) -> Seen:
    """What the computer has exactly."""
    return Seen(value, _NOTHING)


SINCE = ("y", "last_y")  # what is measured, and what was a sample before


class Rounded:
    """Arithmetic of a kind. `stands`: literals stand for numbers near to them; `rounds`: operations are rounded;
    `decides`: what is not known to be less is compared by middles, which proves nothing.

    `apart`: origins of which differences are forms of degree 1, and how large each of them is at most. `moves`: how far
    entries of `SINCE`, which the computer has exactly, are apart at most.
    """

    def __init__(
        self,
        kind: Kind,
        *,
        stands: bool = True,
        rounds: bool = True,
        underflows: bool = True,
        decides: bool = False,
        apart: tuple[str, str] | None = None,
        widths: Mapping[int, Ball] | None = None,
        moves: Mapping[int, Ball] | None = None,
    ) -> None:
        self.kind, self.stands, self.rounds, self.decides = kind, stands, rounds, decides
        self.eta = kind.least if underflows else _NOTHING
        self.apart, self.widths, self.moves = apart, widths or {}, moves or {}

    def literal(self, text: str) -> Seen:
        """The number of the kind nearest to a decimal; it stands for any number that it is the nearest one to."""
        value = self.kind.nearest(text)
        off = self.kind.unit * magnitude(value) if self.stands else _NOTHING
        return Seen(value + between(-off, off), off, degree=0)

    def whole(self, k: int) -> Seen:
        """Small ones are exact."""
        if abs(k) >= 2**24:
            raise UnreadError("a whole number that may have too many digits")
        return Seen(arb(k), _NOTHING, degree=0)

    def both(self, sign: str, a: Seen, b: Seen) -> Seen:
        """One operation, rounded."""
        found = self.rounded(*_OPERATIONS[sign](a, b))
        if sign == "-":
            return self._difference(found, a, b)
        return replace(found, degree=_DEGREES[sign](a.degree, b.degree))

    def _difference(self, found: Seen, a: Seen, b: Seen) -> Seen:
        degree = _same(a.degree, b.degree)
        if a.origin is None or b.origin is None or self.apart is None:
            return replace(found, degree=degree)
        (left, i), (right, j) = a.origin, b.origin
        if (left, right) == SINCE and i == j and i in self.moves:
            near = _met(found.value, between(-self.moves[i], self.moves[i]))
            return self.rounded(near, a.error + b.error)
        if (left, right) != self.apart or i != j:
            return replace(found, degree=degree)
        width = self.widths.get(i)
        value = found.value if width is None else _met(found.value, between(-width, width))
        return replace(found, value=value, degree=1)

    def negative(self, a: Seen) -> Seen:
        """Nothing is rounded."""
        return Seen(-a.value, a.error, degree=a.degree)

    def call(self, name: str, a: Seen) -> Seen:
        """A function of math.h."""
        value = _FUNCTIONS[name].run([a.value])[0]
        computed = a.value.union(a.value - a.error).union(a.value + a.error)
        if name == "sqrt":
            if not a.bottom >= 0:
                return Seen(value, arb("inf"))
            inside = computed.intersection(between(0, magnitude(computed)))
            slope = 1 / (2 * root(inside.lower())) if inside.lower() > 0 else arb("inf")
            return self.rounded(root(a.value), _finite_least(slope * a.error, root(a.error)))
        slope = magnitude(_SLOPES[name].run([computed])[0])
        return self.rounded(value, slope * a.error, _LIBRARY)

    def least(self, a: Seen, b: Seen) -> Seen:
        """Moves by no more than they do."""
        return Seen(smaller(a.value, b.value), larger(a.error, b.error))

    def greatest(self, a: Seen, b: Seen) -> Seen:
        """The same."""
        return Seen(larger(a.value, b.value), larger(a.error, b.error), larger(a.bottom, b.bottom))

    def shrink(self, a: Seen, b: Seen) -> Seen:
        """min(1, b/a), a and b positive: it moves by the relative errors of both, and is computed by one division."""
        if not (b.bottom > 0 and b.value.lower() > 0):
            return Seen(arb("nan"), arb("inf"))
        low = smaller(b.value.lower(), b.bottom)
        if a.value <= b.value and a.value + a.error <= b.value - b.error:
            return Seen(arb(1), _NOTHING)
        value = smaller(b.value / larger(a.value, b.value.lower()), arb(1))
        return self.rounded(value, (a.error + b.error) / low * (1 + a.error / low))

    def ratio(self, a: Seen, b: Seen) -> Seen:
        """Of what is computed at one place, where signs are known."""
        if self.less(known(_NOTHING), a) and self.less(known(_NOTHING), b):
            return self.both("/", a, b)
        if self.decides:
            return known(_NOTHING)
        if (a.value + a.error).upper() <= 0 or (b.value + b.error).upper() <= 0:
            return known(_NOTHING)
        return Seen(arb("nan"), arb("inf"))

    def less(self, a: Seen, b: Seen) -> bool | None:
        """As computed, if that is sure."""
        if a.value + a.error < b.value - b.error:
            return True
        if a.value - a.error >= b.value + b.error:
            return False
        return bool(a.value.mid() < b.value.mid()) if self.decides else None

    def rounded(self, value: Ball, error: Ball, units: int = 1) -> Seen:
        """With the rounding of the operation itself; of what overflows nothing is known."""
        most = magnitude(value) + error
        if not most < self.kind.most:
            return Seen(value, arb("inf"))
        own = units * (self.kind.unit * most + self.eta) if self.rounds else _NOTHING
        return Seen(value, (error + own).upper())


def _met(a: Ball, b: Ball) -> Ball:
    return a.intersection(b) if a.overlaps(b) else a


def _finite_least(a: Ball, b: Ball) -> Ball:
    return smaller(a, b) if a.is_finite() else b


def _same(p: int | None, q: int | None) -> int | None:
    return p if p == q else None


def _sum(p: int | None, q: int | None) -> int | None:
    return None if p is None or q is None else p + q


def _quotient(a: Seen, b: Seen) -> tuple[Ball, Ball]:
    room = b.value.abs_lower() - b.error
    value = a.value / b.value
    if not room > 0:
        return value, arb("inf")
    return value, (a.error + magnitude(value) * b.error) / room


def _product(a: Seen, b: Seen) -> tuple[Ball, Ball]:
    x, y = magnitude(a.value), magnitude(b.value)
    value = square(a.value) if a is b else a.value * b.value
    return value, x * b.error + y * a.error + a.error * b.error


_OPERATIONS: Mapping[str, Callable[[Seen, Seen], tuple[Ball, Ball]]] = {
    "+": lambda a, b: (a.value + b.value, a.error + b.error),
    "-": lambda a, b: (a.value - b.value, a.error + b.error),
    "*": _product,
    "/": _quotient,
}
_DEGREES: Mapping[str, Callable[[int | None, int | None], int | None]] = {
    "+": _same,
    "*": _sum,
    "/": lambda p, q: p if q == 0 else None,
}

FUNCTIONS = (
    "sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log",
)  # fmt: skip
_X = variable("x")
_FUNCTIONS = {name: Program([function(name, _X)], ["x"]) for name in FUNCTIONS}
_SLOPES = {name: Program(slopes([function(name, _X)], "x"), ["x"]) for name in FUNCTIONS}

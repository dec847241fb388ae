"""An operation of a computer, followed: what it gives exactly, and how far what it gives is off. Trusted.

Types of IEEE 754, results of operations as an interval and a bound of the error, by pieces of a plan; all outward.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.enclosure import interval
from tubecert.enclosure.constant import printable_above
from tubecert.enclosure.interval import Array, Interval, fraction_bounds, sqrt
from tubecert.spec import Arithmetic


class UncoveredError(ValueError):
    """What a controller does, and no bound is derived for, in words; `help`: what to do instead."""

    def __init__(self, what: str, help: str = "") -> None:
        super().__init__(what)
        self.help = help


@dataclass(frozen=True, slots=True, kw_only=True)
class Float:
    """A type of IEEE 754: `unit` u of rounding, `least`, what underflow may lose, and `most`, below infinity."""

    unit: Fraction
    least: Fraction
    most: float

    def near(self, value: Fraction) -> Fraction:
        """The number of the type that stands in the code for a constant."""
        with np.errstate(over="ignore"):
            near = float(np.float32(float(value))) if self.unit > DOUBLE.unit else float(value)
        if not np.isfinite(near):
            raise UncoveredError("a number that is too large for this type")
        return Fraction(near)


DOUBLE: Final = Float(unit=Fraction(1, 2**53), least=Fraction(1, 2**1074), most=2.0**1022)
SINGLE: Final = Float(unit=Fraction(1, 2**24), least=Fraction(1, 2**149), most=2.0**126)
FLOATS: Final[Mapping[Arithmetic, Float]] = {"single": SINGLE, "double": DOUBLE}


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """A result: exactly in `value`, and off by `error` at most; both (P,), by pieces of the plan."""

    value: Interval
    error: Array

    @property
    def most(self) -> Interval:
        """A bound of what the computer has."""
        return Interval.exact(self.value.magnitude) + Interval.exact(self.error)


def combined(operation: str, a: Followed, b: Followed) -> tuple[Interval, Interval]:
    """The exact result, and how far it moves with its operands."""
    x, y = a.value, b.value
    off_a, off_b = Interval.exact(a.error), Interval.exact(b.error)
    if operation == "add":
        return x + y, off_a + off_b
    if operation == "sub":
        return x - y, off_a + off_b
    size_x, size_y = Interval.exact(x.magnitude), Interval.exact(y.magnitude)
    if operation == "mul":
        return x * y, size_x * off_b + size_y * off_a + off_a * off_b
    ratio = x / y
    room = Interval.exact(y.mignitude) - off_b
    moved = (off_a + Interval.exact(ratio.sanitised().magnitude) * off_b) / room
    return ratio, Interval(moved.lo, np.where(room.lo > 0, moved.hi, np.inf))


def steepest(name: str, x: Interval) -> Array:
    """A bound of |f'| over an interval."""
    one = Interval.of(1)
    slopes = {
        "sin": one,
        "cos": one,
        "atan": one,
        "tanh": one,
        "tan": one + interval.tan(x) * interval.tan(x),
        "exp": interval.exp(x),
        "sinh": interval.cosh(x),
        "cosh": interval.sinh(x),
        "log": one / x,
        "sqrt": one / (2 * sqrt(x)),
        "asin": one / sqrt(one - x * x),
        "acos": one / sqrt(one - x * x),
    }
    return slopes[name].sanitised().magnitude


def length_of(vector: Sequence[Followed]) -> Interval:
    """The Euclidean length of the errors, by pieces."""
    return _root([Interval.exact(x.error) for x in vector])


def size_of(vector: Sequence[Followed]) -> Interval:
    """A bound of the length of what a computer has, by pieces."""
    return _root([x.most for x in vector])


def _root(sizes: Sequence[Interval]) -> Interval:
    """The root of a sum of squares; of 0 an enclosure may be a little below."""
    square = sum((x * x for x in sizes), Interval.of(0))
    return sqrt(Interval(np.maximum(square.lo, 0.0), square.hi))


def by_pieces(t: Followed, x: Followed) -> Followed:
    """By pieces, also what does not depend on time."""
    zero = 0 * t.error
    return Followed(value=Interval(x.value.lo + zero, x.value.hi + zero), error=x.error + zero)


def over_pieces(x: Followed) -> Followed:
    """Over all pieces."""
    value = Interval(np.full_like(x.error, x.value.lo.min()), np.full_like(x.error, x.value.hi.max()))
    return Followed(value=value, error=np.full_like(x.error, x.error.max()))


def known_by_size(most: Interval, pieces: int) -> Followed:
    """What is known by its size only, and has no error of its own: it is what the code has."""
    ends = np.full(pieces, float(np.max(most.hi)))
    return Followed(value=Interval(-ends, ends), error=np.zeros(pieces))


def largest_of(x: Interval) -> Interval:
    """The largest over all pieces."""
    return Interval.exact(float(np.max(x.sanitised().hi)))


def printed(x: Interval) -> Fraction:
    """An upper bound, as the number that is printed; raises `UncoveredError` where there is none."""
    most = float(x.hi)
    if not np.isfinite(most):
        raise UncoveredError("what a program computes has no bound in this type")
    return Fraction(repr(printable_above(most)))


def intervals_of(values: Sequence[Fraction]) -> Interval:
    """Rational numbers, enclosed."""
    ends = [fraction_bounds(value) for value in values]
    return Interval([low for low, _ in ends], [high for _, high in ends])


def floats_of(table: Sequence[Sequence[Sequence[Fraction]]]) -> Array:
    """A table of floats, as floats."""
    return np.array([[[float(value) for value in row] for row in piece] for piece in table])


def frobenius(rows: Sequence[Sequence[Fraction]]) -> Interval:
    """A bound of the norm of a matrix of rational numbers."""
    return sqrt(Interval.of(sum((q * q for row in rows for q in row), Fraction(0))))

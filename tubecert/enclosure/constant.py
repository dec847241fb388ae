"""A number known by bounds proven from both sides, and where it is attained.

Gains as exact decimals: what is printed is what is verified.

A gain is a `Fraction` with a short decimal expansion; `printed` turns it into the float whose shortest
representation is that decimal, so that a checker that reads JSON numbers as decimals reads the same number.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from math import ceil, floor

DIGITS = 12
_LEAST = 2.0**-900


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """Where the value proven from below is attained, nearly: time in s (if it matters) and state, shape (n,)."""

    t: float | None = None
    x: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A supremum (or infimum) enclosed: proven to lie in [below, above]."""

    below: float
    above: float
    at: Witness | None = None

    def __post_init__(self) -> None:
        if not self.below <= self.above:  # NaN fails too
            raise ValueError(f"empty enclosure [{self.below}, {self.above}]")

    @staticmethod
    def exactly(value: float) -> Constant:
        """A value known exactly."""
        return Constant(below=value, above=value)

    @property
    def gap(self) -> float:
        """Relative width (above - below)/|above|; 0 for an exact value."""
        return 0.0 if self.above == self.below else (self.above - self.below) / abs(self.above or self.below)

    def printable(self) -> Constant:
        """The same, widened to bounds of `DIGITS` digits: what is printed is what is used (see `printable_above`)."""
        return Constant(below=printable_below(self.below), above=printable_above(self.above), at=self.at)


def printable_above(value: Fraction | float) -> float:
    """The least number of `DIGITS` digits >= `value` whose float is not below its decimal.

    Its shortest decimal text, read exactly, is then a bound, and so is the float that is computed with.
    """
    return _printable(value, ROUND_CEILING)


def printable_below(value: Fraction | float) -> float:
    """The greatest number of `DIGITS` digits <= `value` whose float is not above its decimal."""
    return _printable(value, ROUND_FLOOR)


def decimal_above(value: Fraction) -> Fraction:
    """The least decimal of `DIGITS` digits >= value."""
    quotient = Context(prec=DIGITS, rounding=ROUND_CEILING).divide(
        Decimal(value.numerator), Decimal(value.denominator)
    )
    return Fraction(quotient)


def _printable(value: Fraction | float, rounding: str) -> float:
    if value == 0 or (isinstance(value, float) and not math.isfinite(value)):
        return float(value)
    exact = Fraction(value)
    if abs(exact) < Fraction(_LEAST):  # floats lose digits below their normal range
        away_from_zero = (exact > 0) == (rounding == ROUND_CEILING)
        return math.copysign(_LEAST, exact) if away_from_zero else 0.0
    context = Context(prec=DIGITS, rounding=rounding)
    decimal = context.divide(Decimal(exact.numerator), Decimal(exact.denominator))
    step = Decimal((0, (1,), decimal.adjusted() - DIGITS + 1))
    outward = step if rounding == ROUND_CEILING else -step
    while True:
        near = float(decimal)
        binary, text = Fraction(near), Fraction(decimal)
        if (binary >= text) if rounding == ROUND_CEILING else (binary <= text):
            return near
        decimal = context.add(decimal, outward)


_MOST_PLACES = 1200  # after the decimal point; enough for every binary64 number


def exact(value: Fraction | Decimal | str | float) -> Fraction:
    """The decimal that `value` shows: a float stands for its shortest representation."""
    if isinstance(value, float):
        return Fraction(repr(float(value)))
    return Fraction(value)


def round_up(value: Fraction | float, digits: int) -> Fraction:
    """The smallest decimal of `digits` significant digits >= value > 0; 0 for 0."""
    return _rounded(Fraction(value), digits, ceil)


def round_down(value: Fraction | float, digits: int) -> Fraction:
    """The largest decimal of `digits` significant digits <= value > 0; 0 for 0."""
    return _rounded(Fraction(value), digits, floor)


def next_up(value: Fraction, digits: int) -> Fraction:
    """The next larger decimal of `digits` significant digits."""
    unit = _unit(value, digits)
    return (floor(value / unit) + 1) * unit


def _unit(value: Fraction, digits: int) -> Fraction:
    """One in the last of `digits` significant digits of value > 0."""
    exponent = len(str(value.numerator)) - len(str(value.denominator))
    if value >= Fraction(10) ** (exponent + 1):
        exponent += 1
    while value < Fraction(10) ** exponent:
        exponent -= 1
    return Fraction(10) ** (exponent + 1 - digits)


def _rounded(value: Fraction, digits: int, to_integer: Callable[[Fraction], int]) -> Fraction:
    if value < 0:
        raise ValueError(f"gains are positive, not {float(value)}")
    if value == 0:
        return value
    unit = _unit(value, digits)
    return to_integer(value / unit) * unit


def printed(value: Fraction) -> float | str:
    """The JSON form: a float if its shortest representation is exactly `value`, else the decimal as text."""
    near = float(value)
    if Fraction(repr(near)) == value:
        return near
    places = 0
    while (value * 10**places).denominator != 1:
        places += 1
        if places > _MOST_PLACES:
            raise ValueError(f"{near} has no short decimal expansion")
    return str(Decimal(int(value * 10**places)).scaleb(-places, Context(prec=_MOST_PLACES)))

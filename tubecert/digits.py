"""Numbers as text for a reader: bounds from above rounded up, bounds from below rounded down, so both stay true.

In: numbers. Out: text, which nothing reads again. Exact text, as it stands in specifications and certificates, is
`expression.number_text` and `records.exact_json`. Trusted: yes; it decides nothing.
"""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Context, Decimal
from fractions import Fraction
from typing import Final

from tubecert.records import exact_json

Number = float | int | str | Fraction
UNKNOWN: Final = "-"
_LONG: Final = 16
_FRACTION: Final = 5
_DEGREE: Final = Fraction("3.14159265358979323846264338327950288") / 180


def short(value: Number | None, digits: int = 4) -> str:
    """The nearest number of `digits` significant digits."""
    return _shown(value, digits, ROUND_HALF_EVEN)


def near(value: Number, digits: int = 6) -> str:
    """The same in a sentence, where a number is one that is known: infinity is infinite."""
    if isinstance(value, float) and not math.isfinite(value):
        return "no number" if math.isnan(value) else "infinity" if value > 0 else "-infinity"
    return short(value, digits)


def up(value: Number | None, digits: int = 4) -> str:
    """The least number of `digits` significant digits that is not below `value`."""
    return _shown(value, digits, ROUND_CEILING)


def down(value: Number | None, digits: int = 4) -> str:
    """The greatest number of `digits` significant digits that is not above `value`."""
    return _shown(value, digits, ROUND_FLOOR)


def exact(value: Number | None) -> str:
    """A gain or another exact number: every digit of it."""
    if isinstance(value, Fraction):
        value = exact_json(value)
    if isinstance(value, str) and "/" in value:
        return value
    return _shown(value, None, ROUND_HALF_EVEN)


def end(value: Number | None) -> str:
    """An end of a range: exact, but for fractions of large numbers, and for multiples of pi: in degrees.

    Of these the certificate holds 30 digits.
    """
    text = exact(value)
    if "/" in text and len(text) > _FRACTION:
        return short(Fraction(text), 9)
    if len(text) <= _LONG:
        return text
    degrees = short(Fraction(text) / _DEGREE, 8)
    missed = abs(Fraction(text) / _DEGREE / Fraction(degrees) - 1)
    return f"{degrees} deg" if missed < 1e-24 else short(value, _LONG - 4)


def in_unit(text: str, unit: str) -> str:
    """What `end` says with its unit, where degrees stand in place of radians."""
    degrees = text.endswith(("deg", "deg]")) and unit.startswith("rad")
    return text + unit.removeprefix("rad") if degrees else f"{text} {unit}".rstrip()


def percent(margin: float | None) -> str:
    """The side of a margin that is proven, rounded down: `1.23 %`."""
    if margin is None:
        return UNKNOWN
    return f"{_shown(100 * _decimal(margin), 3, ROUND_FLOOR)} %"


def _decimal(value: Number | Decimal) -> Decimal:
    """The decimal that is written in the certificate (a float stands for its shortest text)."""
    if isinstance(value, Decimal):
        return value
    if isinstance(value, Fraction):
        value = exact_json(value)
    if isinstance(value, str) and "/" in value:
        ratio = Fraction(value)
        return Decimal(ratio.numerator) / Decimal(ratio.denominator)
    return Decimal(value if isinstance(value, str | int) else repr(float(value)))


def _shown(value: Number | Decimal | None, digits: int | None, rounding: str) -> str:
    if value is None:
        return UNKNOWN
    number = _decimal(value)
    if not number.is_finite():
        return UNKNOWN
    if number == 0:
        return "0"
    if digits is not None:
        number = Context(prec=digits, rounding=rounding).plus(number)
    return _text(number.normalize())


def _text(number: Decimal) -> str:
    """Plain digits for moderate sizes, else `1.967e7`."""
    if -4 <= number.adjusted() < 6:
        return f"{number:f}"
    sign, digits, _ = number.as_tuple()
    mantissa = str(digits[0]) + ("." + "".join(map(str, digits[1:])) if len(digits) > 1 else "")
    return f"{'-' if sign else ''}{mantissa}e{number.adjusted()}"

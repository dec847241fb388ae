"""Gains as exact decimals: what is printed is what is verified.

A gain is a `Fraction` with a short decimal expansion; `printed` turns it into the float whose shortest
representation is that decimal, so that a checker that reads JSON numbers as decimals reads the same number.
"""

from __future__ import annotations

from decimal import Context, Decimal
from fractions import Fraction
from math import ceil, floor
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

_MOST_PLACES = 1200  # after the decimal point; enough for every binary64 number


def exact(value: Fraction | Decimal | str | float) -> Fraction:
    """The decimal that `value` shows: a float stands for its shortest representation."""
    if isinstance(value, (float, np.floating)):
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

"""Numbers of few digits: rates that are printed as they are tried."""

from __future__ import annotations

from fractions import Fraction
from math import floor, isfinite, log10


def digits_below(value: float | Fraction, digits: int) -> Fraction:
    """The largest decimal of so many digits that does not exceed a positive value."""
    assert isfinite(value)
    assert value > 0
    exponent = floor(log10(value))
    if Fraction(10) ** exponent > value:  # the logarithm was rounded up
        exponent -= 1
    unit = Fraction(10) ** (exponent - digits + 1)
    return (Fraction(value) // unit) * unit


def two_digits(value: Fraction) -> Fraction:
    """Two digits, rounded down."""
    return digits_below(value, 2)

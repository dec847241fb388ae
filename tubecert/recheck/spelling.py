"""The one spelling of a number in a certificate: a decimal if there is a short one, else `p/q`."""

from __future__ import annotations

from fractions import Fraction

LONGEST = 40  # characters of a number
_PLAIN_DIGITS = 25  # longer ones have an exponent
_ZEROS = 4  # so many at least are worth one


def spelled(q: Fraction) -> str:
    """The text that stands for q; a reader of it needs no rule of arithmetic."""
    sign, size = "-" if q < 0 else "", abs(q)
    short = _decimal(size)
    return sign + (short if short is not None and len(short) <= LONGEST else str(size))


def _decimal(q: Fraction) -> str | None:
    """The decimal, if it is finite."""
    below = q.denominator
    places = next((k for k in range(below.bit_length() + 1) if 10**k % below == 0), None)
    if places is None:
        return None
    digits = str(q.numerator * 10**places // below)
    if places > _PLAIN_DIGITS:
        return f"{digits}e-{places}"
    if places:
        digits = digits.zfill(places + 1)
        return f"{digits[:-places]}.{digits[-places:]}"
    short = digits.rstrip("0")
    zeros = len(digits) - len(short)
    return f"{short}e{zeros}" if len(digits) > _PLAIN_DIGITS and zeros >= _ZEROS else digits

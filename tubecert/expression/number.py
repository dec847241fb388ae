"""Text -> exact number: rationals as they are, multiples of pi and degrees rounded to 30 digits.

A number in a specification is a rational. What contains pi is none: it is rounded, to nearest or to the side that its
place asks for (the ends of a set inward, a bound upward), and from then on the rounded number is the one that counts.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction
from math import isqrt
from typing import Final, Literal

from tubecert.expression import graph
from tubecert.expression.balls import BITS, middle, values
from tubecert.expression.calculus import rebuild
from tubecert.expression.graph import Expression, topological
from tubecert.expression.meant import HAS_NONE, UNITS, instead_of
from tubecert.expression.parse import Parsed, parse
from tubecert.expression.scan import ExpressionError

Side = Literal["nearest", "below", "above"]

DIGITS: Final = 30
_MEASURED: Final = re.compile(
    r"\s*([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*([A-Za-z][\w/*^ ]*?)\s*"
)
_NOT_FINITE = frozenset({"nan", "inf", "infinity", "infinite", "oo", "forever"})
_FOREIGN_NUMBER = re.compile(r"[-+]?[0-9]+[,:][0-9,:.]+")
_THOUSANDS: Final = re.compile(r"[-+]?[1-9][0-9]{0,2},[0-9]{3}")
_NOT_NUMBERS = frozenset({"true", "false", "yes", "no", "on", "off", "null", "none", "~"})
_ONE_FACTOR = re.compile(
    r"\s*[-+]?\s*(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[A-Za-z]\w*|\([^()]*\))"
    r"(?:\s*[*/]\s*(?:[0-9.]+|[A-Za-z]\w*))*\s*"
)
PI_ABOVE: Final = Fraction(  # the next decimal of 75 digits
    3141592653589793238462643383279502884197169399375105820974944592307816406287, 10**75
)
_OF_PI: Final = frozenset({"const", "pi", "add", "mul", "div", "pow"})


def parse_number(
    text: str, symbols: Mapping[str, Fraction | Expression] | None = None, side: Side = "nearest"
) -> Fraction:
    """The rational that `text` stands for: a number or an expression of numbers, parameters and pi, perhaps in `deg`.

    With pi it is rounded to `DIGITS` digits, to that side. Raises `ExpressionError`.
    """
    value = parse_constant(text, symbols)
    return value.fraction if value.is_constant else _rounded(value, side)


def parse_constant(text: str, symbols: Mapping[str, Fraction | Expression] | None = None) -> Expression:
    """The same, exact: an expression of numbers and pi."""
    word = text.strip()
    _check_foreign(text, word)
    known = {name: graph.as_expression(value) for name, value in (symbols or {}).items()}
    parsed, factor = _in_degrees(text, known)
    found = parsed.expression * factor
    try:
        for owed in parsed.obligations:
            low, high = _ends(owed.argument)
            if low <= 0 and (owed.kind == "positive" or high >= 0):
                raise ZeroDivisionError
        _ends(found)
        _nearly(found)
    except (ValueError, ZeroDivisionError):
        help = "write it as a decimal or a fraction, or with pi or deg; numbers here are exact"
        raise _refused(text, f"{word[:60]} is not a rational number", help) from None
    return found


def _check_foreign(text: str, word: str) -> None:
    """Words that are no numbers, and numbers as they are written elsewhere."""
    bare = word.lower().lstrip("+-.")
    if bare in _NOT_FINITE:
        raise _refused(text, f"{word} is not a finite number", "write a finite number")
    if bare in _NOT_NUMBERS or not word:
        what = f"{word} is not a number" if word else "a number is missing"
        raise _refused(text, what, "write a number such as 0.1 or 1e-3")
    if _FOREIGN_NUMBER.fullmatch(word):
        help = "write a decimal point" if "," in word else "write it as one decimal number, times in seconds"
        if _THOUSANDS.fullmatch(word):
            point = word.replace(",", ".", 1)
            help = f"write {word.replace(',', '')}, or {point} if the comma is a decimal point"
        raise _refused(text, f"{word[:40]} is not a number", help)


def _refused(text: str, message: str, help: str) -> ExpressionError:
    """The error for the whole of a text."""
    word = text.strip()
    offset = len(text) - len(text.lstrip()) if word else 0
    return ExpressionError(message, help=help, offset=offset, width=max(1, len(word)), kind="value")


def _in_degrees(text: str, symbols: Mapping[str, Expression]) -> tuple[Parsed, Expression]:
    """A text of known names, without its `deg`, and the unit."""
    bare = text.rstrip()
    factor: Expression = graph.ONE
    if angle := re.fullmatch(r"(.*[0-9.)\s])deg", bare, re.DOTALL):
        if not _ONE_FACTOR.fullmatch(angle[1]):
            raise ExpressionError(
                "deg follows one number",
                offset=len(bare) - 3,
                width=3,
                help="put what comes before it in parentheses: (10 + 20) deg",
            )
        text, factor = angle[1], graph.PI / 180
    try:
        return parse(text, symbols=symbols), factor
    except ExpressionError as error:
        measured = _MEASURED.fullmatch(text) if error.kind == "symbol" else None  # short, or it was not read
        if measured and re.split(r"\W", measured[2])[0] in UNITS:
            help = instead_of(*measured.groups())
            raise ExpressionError(
                HAS_NONE, help=help, offset=measured.start(2), width=len(measured[2]), kind="value"
            ) from None
        if error.kind == "symbol":
            names = f"; it may use {', '.join(sorted(symbols)[:20])}" if symbols else ""
            error.help = f"write a number such as 0.1, without a unit (only deg is one){names}"
        raise


def _ends(e: Expression) -> tuple[Fraction, Fraction]:
    """An enclosure of a number made of rationals and pi; raises `ValueError` for another one."""
    if e.is_constant:
        return e.fraction, e.fraction
    if any(node.op not in _OF_PI for node in topological([e])):
        raise ValueError("made of more than pi")
    from flint import ctx

    with ctx.workprec(BITS):
        found = values([e], {})
        if found is None:
            raise ZeroDivisionError
        return middle(found[0].lower()), middle(found[0].upper())


def root_above(square: Fraction) -> Fraction:
    """The square root of a number that is not negative: exact if rational, else the next decimal of `DIGITS` digits."""
    if (exact := graph.rational_root(square)) is not None:
        return exact
    places = DIGITS - (square.numerator.bit_length() - square.denominator.bit_length()) * 15051 // 100000
    scaled = square * Fraction(100) ** places
    return Fraction(isqrt(scaled.numerator // scaled.denominator) + 1) / Fraction(10) ** places


def _nearly(e: Expression) -> Fraction:
    """A number made of rationals and pi with 75 digits of pi; raises `ZeroDivisionError` if it has no value then."""
    found: dict[Expression, Expression] = {graph.PI: graph.constant(PI_ABOVE)}
    for node in topological([e]):
        found.setdefault(node, rebuild(node, tuple(found[each] for each in node.args)))
    return found[e].fraction


def _rounded(e: Expression, side: Side) -> Fraction:
    """A decimal of `DIGITS` digits at or next to a number with pi.

    How many digits stand before the point is counted of a fraction: of the same one from version to version, or
    canonical forms and their hashes would change.
    """
    size, (low, high) = _nearly(e), _ends(e)
    bits = size.numerator.bit_length() - size.denominator.bit_length()
    places = DIGITS - bits * 30103 // 100000  # log10(2)
    grid = Fraction(10) ** -places
    if side == "nearest":
        return round((low + high) / 2 / grid) * grid
    return low // grid * grid if side == "below" else -(-high // grid) * grid

"""Ranges of keys (`tube.epsilon=.1:.6:6`) and their product.

A value is a text, as `--set` takes it, so that a point of a sweep is what one command says. The ends of a range are
what was written; values between them are decimals, exact where they are short.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Final, NoReturn

from tubecert.errors import SpecError
from tubecert.expression import ExpressionError, number_text, parse_number
from tubecert.findings import Finding, NamedPlace
from tubecert.spec import Setting

OPTION: Final = "--over"
MOST: Final = 100_000  # points
_SHORT: Final = 12  # digits of a value between the ends that is exact
_DIGITS: Final = 6  # of one that is not
_FORM: Final = "write KEY=FIRST:LAST:COUNT, KEY=FIRST:LAST:logCOUNT or KEY=VALUE,VALUE,..."
_COUNT = re.compile(r"(log)?(\d{1,6})", re.ASCII)
_DASHED: Final = re.compile(r"[0-9.]*[0-9]\s*(?:-|to|\.\.)\s*[0-9.]*[0-9]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A key and the texts of its values, in their order; `log`: they are equally far apart as factors."""

    path: str
    texts: tuple[str, ...]
    log: bool = False

    @classmethod
    def of(cls, words: str) -> Axis:
        """What `KEY=RANGE` says; raises `SpecError`."""
        setting = Setting.of(words, OPTION)
        parts = [part.strip() for part in setting.text.split(":")]
        if len(parts) == 1:
            return cls(path=setting.path, texts=_listed(setting))
        count = _COUNT.fullmatch(parts[2]) if len(parts) == 3 else None
        if count is None:
            _refuse(setting, f"{setting.text[:60]!r} is no range", _FORM)
        first, last = (_number(setting, part) for part in parts[:2])
        log, number = count[1] is not None, int(count[2])
        if not 2 <= number <= MOST:
            _refuse(setting, f"a range has 2 to {MOST:,} values, not {number}", "one value is given by --set")
        if log and (first <= 0 or last <= 0):
            _refuse(setting, "the ends of a range in equal factors are positive", "leave log out")
        if first == last:
            _refuse(setting, "the ends of the range are equal", "one value is given by --set")
        inner = _factors(first, last, number) if log else _steps(first, last, number)
        texts = (parts[0], *inner, parts[1])
        values = [first, *map(parse_number, inner), last]
        if not all(a < b if first < last else a > b for a, b in itertools.pairwise(values)):
            _refuse(setting, "the values of the range are not apart", "give fewer of them, or a list")
        return cls(path=setting.path, texts=texts, log=log)

    @property
    def numbers(self) -> tuple[float, ...] | None:
        """The values as floats, to be drawn; None if one is no number."""
        try:
            return tuple(float(parse_number(text)) for text in self.texts)
        except (ExpressionError, OverflowError):
            return None

    def settings(self) -> list[Setting]:
        """The key with each of its values."""
        return [Setting(path=self.path, text=text, option=OPTION) for text in self.texts]


def points(axes: Sequence[Axis]) -> list[tuple[Setting, ...]]:
    """Every combination of values; the last axis changes first. Raises `SpecError` for too many of them."""
    for index, axis in enumerate(axes):
        other = next((each for each in axes[:index] if axis.settings()[0].meets(each.path)), None)
        if other is not None:
            _refuse(
                axis.settings()[0], f"{other.path} has a range already", "give one range for a key", "TC104"
            )
    count = math.prod(len(axis.texts) for axis in axes)
    if count > MOST:
        message = f"the sweep has {count:,} points; it may have {MOST:,}"
        raise SpecError([Finding(code="TC102", message=message, help="take fewer values of some keys")])
    return list(itertools.product(*(axis.settings() for axis in axes)))


def _listed(setting: Setting) -> tuple[str, ...]:
    texts = tuple(part.strip() for part in setting.text.split(","))
    if len(texts) == 1 and _DASHED.fullmatch(texts[0]):
        _refuse(setting, f"{texts[0]} is one value, not a range", _FORM)
    if not all(texts) or len(set(texts)) < len(texts):
        _refuse(setting, "a value of the list is empty or occurs twice", _FORM)
    return texts


def _number(setting: Setting, text: str) -> Fraction:
    try:
        return parse_number(text)
    except ExpressionError as error:
        _refuse(setting, f"an end of the range is no number: {error.message}", error.help or _FORM, "TC108")


def _steps(first: Fraction, last: Fraction, count: int) -> list[str]:
    """What lies between the ends in equal steps."""
    step = (last - first) / (count - 1)
    return [_decimal(first + i * step) for i in range(1, count - 1)]


def _factors(first: Fraction, last: Fraction, count: int) -> list[str]:
    """What lies between the ends in equal factors."""
    low, high = math.log(first), math.log(last)
    return [_rounded(math.exp(low + (high - low) * i / (count - 1)), 4) for i in range(1, count - 1)]


def _decimal(value: Fraction) -> str:
    text = number_text(value)
    return text if "/" not in text and len(text) <= _SHORT else _rounded(float(value), _DIGITS)


def _rounded(value: float, digits: int) -> str:
    return number_text(Fraction(f"{value:.{digits}g}"))


def _refuse(setting: Setting, message: str, help: str, code: str = "TC112") -> NoReturn:
    place = NamedPlace(file=setting.place, line=1, column=1, source=str(setting), width=len(str(setting)))
    raise SpecError([Finding(code=code, message=message, location=place, help=help)])

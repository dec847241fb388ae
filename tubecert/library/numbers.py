"""Numbers that are asked for, as a specification's are read: exact, and what is wrong with them is told all at once.

In: texts with the names of what they are for (options of a command, arguments of a function). Out: `Fraction`s.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any, Final

from tubecert.errors import SpecError
from tubecert.expression import ExpressionError, parse_number
from tubecert.findings import Finding, NamedPlace

_MODERATE: Final = 60  # powers of ten: the conditions hold products of gains, and floats end at 1e308


class Numbers:
    """Reads numbers as the specification's are read, and keeps what is wrong with them."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def positive(
        self,
        option: str,
        text: str | None,
        *,
        below: int | None = None,
        wanted: str = "positive",
        remedy: str = "> 0",
        word: str = "",
    ) -> Fraction | None:
        """The exact number, > 0 (and < `below`); None if the option is absent or wrong. A `word` may stand for it."""
        if text is None:
            return None
        try:
            value = parse_number(text)
        except ExpressionError as error:
            place = {"offset": error.offset, "width": error.width}
            help = f"{error.help}, or {word}" if word else error.help
            self._fail("TC108", option, text, message=error.message, help=help, **place)
            return None
        if value <= 0:
            self._range(option, text, wanted, remedy)
        elif below is not None and value >= below:
            self._range(option, text, f"below {below}", f"< {below}")
        else:
            return value
        return None

    def gain(self, option: str, text: str | None) -> Fraction | None:
        """A positive number that is so moderate that what follows from it can be computed."""
        value = self.positive(option, text)
        if value is None or text is None or 10**-_MODERATE < value < 10**_MODERATE:
            return value
        self._range(
            option, text, "a gain that anything can have", f"between 1e-{_MODERATE} and 1e{_MODERATE}"
        )
        return None

    def count(
        self, option: str, text: str | None, *, wanted: str = "positive", remedy: str = "> 0"
    ) -> int | None:
        """A positive whole number; None if the option is absent or wrong (then `wanted` tells what is right)."""
        value = self.positive(option, text, wanted=wanted, remedy=remedy)
        if value is None or text is None:
            return None
        if value.denominator != 1:
            self._range(option, text, "a whole number", "without a fraction")
            return None
        return int(value)

    def whole(self, option: str, text: str | None) -> int | None:
        """A whole number, 0 or more; None if the option is absent or wrong."""
        if text is not None and text.strip() == "0":
            return 0
        return self.count(option, text, wanted="0 or more", remedy="that is 0 or more")

    def check(self) -> None:
        """Raises `SpecError` with every problem met so far."""
        if self.findings:
            raise SpecError(self.findings)

    def _range(self, option: str, text: str, wanted: str, remedy: str) -> None:
        shown = text if len(text) <= 40 else f"{text[:40]}..."
        self._fail("TC112", option, text, message=f"{shown} is not {wanted}", help=f"write a number {remedy}")

    def _fail(self, code: str, option: str, text: str, **what: Any) -> None:
        column, width = what.pop("offset", 0) + 1, what.pop("width", len(text))
        place = NamedPlace(file=option, line=1, column=column, source=text, width=width)
        self.findings.append(Finding(code=code, location=place, **what))

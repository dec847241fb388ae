"""The names that an expression of a specification may use, and what its numbers may be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final

from tubecert.expression import (
    MAX_LENGTH,
    MAX_NUMBER_EXPONENT,
    Expression,
    ExpressionError,
    Lookup,
    Obligation,
    Parsed,
    full_text,
    longest_text,
    parse,
)

Parameters = Mapping[str, Expression]
_GREATEST: Final = Fraction(10) ** MAX_NUMBER_EXPONENT  # floats end at 1e308, and lose digits below 1e-308


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """The names that an expression may use here, and why other names of the file may not occur.

    `owed` is what the use of a definition owes; one that owes nothing is there as well.
    """

    symbols: Mapping[str, Expression]
    tables: Mapping[str, Lookup] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    kinks: bool = False
    owed: Mapping[str, tuple[Obligation, ...]] = field(default_factory=dict)

    def parse(self, text: str) -> Parsed:
        """The expression of a text; raises `ExpressionError`."""
        parsed = parse(
            text,
            symbols=self.symbols,
            tables=self.tables,
            kinks=self.kinks,
            refused=self.refused,
            owed=self.owed,
        )
        if self.owed:
            self._check_written_out(parsed)
        return parsed

    def _check_written_out(self, parsed: Parsed) -> None:
        """What definitions stand for is written out in certificates, and must be an expression of the grammar there."""
        parts = [parsed.expression, *(owed.argument for owed in parsed.obligations)]
        try:
            if sum(map(longest_text, parts)) > 8 * MAX_LENGTH:
                raise ExpressionError("it is longer than that", kind="limit")
            text = full_text(parsed.expression, parsed.obligations)
            parse(text, symbols=self.symbols, tables=self.tables, kinks=self.kinks)
        except ExpressionError as error:
            raise ExpressionError(
                f"with its definitions written out the expression is too large ({error.message})",
                help=f"an expression may have {MAX_LENGTH} characters, definitions written out",
                kind="limit",
            ) from None


MODERATE: Final = "choose units in which the numbers are moderate"


def out_of_range(value: Fraction) -> str | None:
    """What is wrong with the size of a number: it must be a float, give or take a rounding, and not a subnormal one."""
    if abs(value) > _GREATEST:
        return f"beyond 1e{MAX_NUMBER_EXPONENT}"
    if 0 < abs(value) < 1 / _GREATEST:
        return f"nearer to 0 than 1e-{MAX_NUMBER_EXPONENT}"
    return None

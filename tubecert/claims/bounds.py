"""Claims about the constants over the tube."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.claims.family import CONSTANTS, Claim, Reason
from tubecert.digits import near


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantBounded(Claim):
    """The constant of this name is bounded over the tube."""

    constant: str

    def _title(self) -> str:
        return f"bound of {self.constant}"

    def _why(self, reason: Reason) -> str:
        return unbounded(self.constant)


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBound(Claim):
    """The bound of `h`, `h_x` or `h_t` that is `declared` covers the expression, which reaches `reaches`."""

    constant: str
    declared: float
    reaches: float | None

    def _title(self) -> str:
        return f"declared bound of {self.constant}"

    def _why(self, reason: Reason) -> str:
        declared = f"uncertainty.bounds.{self.constant} is {near(self.declared)}"
        return f"{declared}, but the expression reaches {reached(self.reaches)} on the tube"


def unbounded(constant: str) -> str:
    """That a constant has no finite bound."""
    symbol, words = CONSTANTS[constant]
    return f"{words} ({symbol}) could not be bounded within the budget of boxes"


def reached(value: float | None) -> str:
    """A value that an expression takes; None is beyond all numbers."""
    return "infinity" if value is None else near(value, 8)

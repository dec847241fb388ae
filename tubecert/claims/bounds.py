"""Claims about the constants over the tube."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from tubecert.claims.family import Claim


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantBounded(Claim):
    """The constant of this name is bounded over the tube."""

    tag: ClassVar[str] = "constant_bounded"
    constant: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyBound(Claim):
    """The bound of `h`, `h_x` or `h_t` that is `declared` covers the expression, which reaches `reaches`."""

    tag: ClassVar[str] = "uncertainty_bound"
    constant: str
    declared: float
    reaches: float | None

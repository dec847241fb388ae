"""Claims about the tube: its radius, the curve in its middle, the safe set around it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Literal

from tubecert.claims.family import Claim, Side


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeRadius(Claim):
    """There is a rho >= sqrt(A/a)|x0* - x0| + eps + rho_a with a, A of the tube itself; `obstacle` says why not."""

    tag: ClassVar[str] = "tube_radius"
    obstacle: Literal["out_of_range", "metric_unbounded", "not_settled"]
    radius: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanBounded(Claim):
    """The curve between the knots of the plan can be bounded."""

    tag: ClassVar[str] = "plan_bounded"


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeInSafeSet(Claim):
    """Assumption 1; the tube of `radius` leaves through the bound of `state` on `side`, by `excess`."""

    tag: ClassVar[str] = "tube_in_safe_set"
    radius: Fraction
    state: str
    side: Side
    excess: float

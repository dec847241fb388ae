"""Claims about the tube: its radius, the curve in its middle, the safe set around it, the start in it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Literal

from tubecert.claims.family import Claim, Reason, Side
from tubecert.digits import near
from tubecert.verdict import Verdict

_IN_SAFE_SET = "assumption 1: the tube lies in the safe set"


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeRadius(Claim):
    """There is a rho >= sqrt(A/a)|x0* - x0| + eps + rho_a with a, A of the tube itself; `obstacle` says why not."""

    name: ClassVar[str] = "radius of the tube"
    obstacle: Literal["out_of_range", "metric_unbounded", "not_settled"]
    radius: Fraction

    def _why(self, reason: Reason) -> str:
        rho = "rho = sqrt(A/a)|x0* - x0| + eps + rho_a"
        match self.obstacle:
            case "out_of_range":
                return f"{rho} is beyond the range of numbers"
            case "metric_unbounded":
                return "the metric could not be bounded over the tube"
            case "not_settled":
                return f"{rho} did not settle: it grows with the tube beyond {near(self.radius)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanBounded(Claim):
    """The curve between the knots of the plan can be bounded."""

    name: ClassVar[str] = _IN_SAFE_SET

    def _why(self, reason: Reason) -> str:
        return "the curve between the plan's knots could not be bounded: two of its times may nearly coincide"


@dataclass(frozen=True, slots=True, kw_only=True)
class TubeInSafeSet(Claim):
    """Assumption 1; the tube of `radius` leaves through the bound of `state` on `side`, by `excess`."""

    name: ClassVar[str] = _IN_SAFE_SET
    radius: Fraction
    state: str
    side: Side
    excess: float

    def _why(self, reason: Reason) -> str:
        lies = "leaves" if reason.verdict is Verdict.REFUTED else "could not be proven to stay in"
        when = "" if reason.at is None or reason.at.t is None else f", at t = {near(reason.at.t)}"
        excess = f", by {near(self.excess, 3)}" if self.excess > 0 else ""
        return f"the tube {lies} the safe set through the {self.side} bound of {self.state}{excess}{when}"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanInSafeSet(Claim):
    """The plan lies in the safe set; it leaves through the bound of `state` on `side`, by `excess`."""

    name: ClassVar[str] = "the plan lies in the safe set"
    state: str
    side: Side
    excess: float

    def _why(self, reason: Reason) -> str:
        when = "" if reason.at is None or reason.at.t is None else f", at t = {near(reason.at.t)}"
        by = f"the {self.side} bound of {self.state}, by {near(self.excess, 3)}"
        return f"the plan itself leaves the safe set through {by}{when}"


@dataclass(frozen=True, slots=True, kw_only=True)
class StartInTube(Claim):
    """The start lies in the tube; in `state` it is `off` from the plan's, and `half_width` is asked for."""

    name: ClassVar[str] = "the start lies in the tube"
    state: str
    off: float
    half_width: Fraction

    def _why(self, reason: Reason) -> str:
        beyond = near(self.off - float(self.half_width), 3)
        return (
            f"{self.state} starts {near(self.off)} from the plan, {beyond} outside of the tube: its half-width is "
            f"{near(self.half_width)}"
        )

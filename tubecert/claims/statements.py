"""What is claimed, as a certification meets it: inputs and metric, tube, constants, limits, gains."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import inf
from typing import Literal

from tubecert.claims.conditions import SAYS, SECTIONS, condition_name, equation
from tubecert.claims.failures import Failure, rank
from tubecert.claims.family import CONSTANTS, Claim, Reason, Side
from tubecert.digits import down, near
from tubecert.enclosure.constant import Constant
from tubecert.verdict import Verdict

_IN_SAFE_SET = "assumption 1: the tube lies in the safe set"
_OF_PREDICTOR = ("26c", "distance")  # conditions that another predictor may satisfy
_WITHOUT_MARGIN = ("wind_not_covered", "gain_not_covered", "proven_gains", "any_gains")


class RankOfB(Claim):
    """B(x) has full rank on the safe set."""

    tag = "rank_of_B"
    name = "rank of B"

    def _why(self, reason: Reason) -> str:
        return rank(reason)


class MetricFound(Claim):
    """A metric was found; `failure` says why not."""

    name = "metric synthesis"
    failure: Failure

    def _why(self, reason: Reason) -> str:
        return self.failure.why(reason)


class MetricDefinite(Claim):
    """C1: W(x) is positive definite on the safe set."""

    name = "metric, definiteness"

    def _why(self, reason: Reason) -> str:
        refuted = reason.verdict is Verdict.REFUTED
        return "W is not positive definite (C1)" if refuted else "W could not be proven positive (C1)"


class MetricKilling(Claim):
    """C3: the Lie derivative of W along the column of `input` vanishes; `residual` is an entry of it at the witness."""

    name = "metric, inputs"
    input: str
    residual: float | None = None

    def _why(self, reason: Reason) -> str:
        condition = "C3 (the Killing condition)"
        if self.residual is None:
            return f"{condition} could not be proven exactly for input {self.input}"
        return f"{condition} fails for input {self.input}: its residual is {near(self.residual, 3)}"


class MetricContraction(Claim):
    """C2 at `rate`, in 1/s; `largest_rate` encloses the supremum of the rates that the metric supports."""

    name = "metric, contraction"
    rate: Fraction
    largest_rate: Constant

    def _why(self, reason: Reason) -> str:
        below, above = self.largest_rate.below, self.largest_rate.above
        if reason.verdict is not Verdict.REFUTED:
            lies = f"the largest rate lies in [{near(below, 10)}, {near(above, 10)}]"
            return f"{lies}, too close to the rate {near(self.rate)} to tell"
        supported = "no rate could be proven"
        if above <= 0:
            supported = "this metric supports no positive rate"
        elif below > 0:
            supported = f"the largest rate that this metric supports is {down(below, 6)}"
        return f"C2 fails at rate {near(self.rate)}: {supported}"


class MetricBound(Claim):
    """The bound of M on the safe set that is `declared`; the eigenvalue is proven to reach `reaches`."""

    name = "declared bounds of the metric"
    side: Side
    declared: Fraction
    reaches: float | None

    def _why(self, reason: Reason) -> str:
        eigenvalue = "lmin(M)" if self.side == "lower" else "lmax(M)"
        declared = f"metric.bounds.{self.side} is {near(self.declared)}"
        return f"{declared}, but {eigenvalue} reaches {reached(self.reaches)}"


METRIC_CLAIMS = (MetricDefinite, MetricContraction, MetricKilling)


class TubeRadius(Claim):
    """There is a rho >= sqrt(A/a)|x0* - x0| + eps + rho_a with a, A of the tube itself; `obstacle` says why not."""

    name = "radius of the tube"
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


class PlanBounded(Claim):
    """The curve between the knots of the plan can be bounded."""

    name = _IN_SAFE_SET
    says = "the curve between the plan's knots could not be bounded: two of its times may nearly coincide"


class TubeInSafeSet(Claim):
    """Assumption 1; the tube of `radius` leaves through the bound of `state` on `side`, by `excess`."""

    name = _IN_SAFE_SET
    radius: Fraction
    state: str
    side: Side
    excess: float

    def _why(self, reason: Reason) -> str:
        lies = "leaves" if reason.verdict is Verdict.REFUTED else "could not be proven to stay in"
        excess = f", by {near(self.excess, 3)}" if self.excess > 0 else ""
        return (
            f"the tube {lies} the safe set through the {self.side} bound of {self.state}{excess}{reason.when}"
        )


class PlanInSafeSet(Claim):
    """The plan lies in the safe set; it leaves through the bound of `state` on `side`, by `excess`."""

    name = "the plan lies in the safe set"
    state: str
    side: Side
    excess: float

    def _why(self, reason: Reason) -> str:
        by = f"the {self.side} bound of {self.state}, by {near(self.excess, 3)}"
        return f"the plan itself leaves the safe set through {by}{reason.when}"


class StartInTube(Claim):
    """The start lies in the tube; in `state` it is `off` from the plan's, and `half_width` is asked for."""

    name = "the start lies in the tube"
    state: str
    off: float
    half_width: Fraction

    def _why(self, reason: Reason) -> str:
        beyond = near(self.off - float(self.half_width), 3)
        return (
            f"{self.state} starts {near(self.off)} from the plan, {beyond} outside of the tube: its half-width is "
            f"{near(self.half_width)}"
        )


class ConstantBounded(Claim):
    """The constant of this name is bounded over the tube."""

    constant: str

    def _title(self) -> str:
        return f"bound of {self.constant}"

    def _why(self, reason: Reason) -> str:
        return unbounded(self.constant)


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


class ObstacleCleared(Claim):
    """The tube stays clear of obstacle number `obstacle` (from 1); `clearance` encloses by how much."""

    obstacle: int
    clearance: Constant

    def _title(self) -> str:
        return f"clearance from obstacle {self.obstacle}"

    def _why(self, reason: Reason) -> str:
        low, high = self.clearance.below, self.clearance.above
        if reason.verdict is Verdict.REFUTED:
            return "the tube contains a point of the obstacle"
        told = (
            f"the tube keeps away from it by {near(low, 4)} at least" if low > 0 else "the tube may meet it"
        )
        return f"{told}; at its nearest by {near(high, 4)}"


class InputWithinLimits(Claim):
    """An input of the plan and of the loop stays within its limits; on `side` it may reach `reaches`, beyond `limit`.

    `plan` is what u* itself reaches there: at least, where it is beyond the limit, else at most. `feedback` and
    `adaptation` add to it at most, by the theorem of `section`; without them nothing is known of the loop.
    """

    input: str
    side: Side
    limit: Fraction
    plan: float | None
    section: str | None = None
    reaches: float | None = None
    feedback: float | None = None
    adaptation: float | None = None

    def _title(self) -> str:
        return input_title(self.input)

    def _why(self, reason: Reason) -> str:
        beyond = f"{'below' if self.side == 'lower' else 'above'} {near(self.limit)}"
        if reason.verdict is Verdict.REFUTED:
            return f"the plan itself has {self.input}* = {reached(self.plan)}, {beyond}"
        if self.reaches is None or self.feedback is None or self.adaptation is None:
            return "no bound of it could be proven"
        added = f"feedback may add {near(self.feedback, 4)}"
        if self.adaptation:
            added += f" and adaptation {near(self.adaptation, 4)}"
        planned = f"{self.input}* reaches {reached(self.plan)}"
        return f"it may reach {near(self.reaches)}, {beyond}: {planned}, to which {added}"


def input_title(name: str) -> str:
    """What the claim is called that an input stays within its limits."""
    return f"limits of {name}"


class GainsSuffice(Claim):
    """The gains of a section satisfy its conditions; `margins` are what is proven to be left of each.

    `binds` sets the bandwidth, if one does; `predictor_gain` g where the predictor is -g I by choice of the search.
    """

    section: str
    margins: Mapping[str, float]
    binds: str | None = None
    predictor_gain: Fraction | None = None

    def _title(self) -> str:
        return SECTIONS.get(self.section, self.section)

    def _why(self, reason: Reason) -> str:
        if len(self.margins) == 1:
            (margin,) = self.margins.values()
            predictor = "" if self.predictor_gain is None else f", with A_m = -{near(self.predictor_gain)} I"
            return f"proven margin {near(margin, 2)} of dbar{predictor}"
        margins = ", ".join(f"{name} {near(margin, 2)}" for name, margin in sorted(self.margins.items()))
        binds = "" if self.binds is None else f"{equation(self.binds)} sets the bandwidth; "
        more = "; where (26b) binds the rate grows without bound, so 1 % of it is left"
        return f"{binds}proven margins: {margins}{more if self.binds == '26b' else ''}"


class ConditionHolds(Claim):
    """A condition of a section that is not proven, by `margin`, or by what is `needed` and `allowed`.

    `condition` is one of the section's own (26a, 26b, 26c, distance), or what no gains can help:
    `initial_distance` (d0 < dbar), `plan_defect` (delta/lambda < dbar), `parameters` and `wind` (the same with what
    they add), `wind_not_covered` (the theorem knows no wind), `gain_not_covered` (it knows no uncertain B), `bounded`
    (the constant `constant` is); or `any_gains`: none were found; or `proven_gains`: of those none could be proven.
    `beyond`: the margin is below all floats; `blocked_by` names a condition without which this one has no margin.
    """

    section: str
    condition: str
    constant: str | None = None
    margin: Constant | None = None
    needed: float | None = None
    allowed: float | None = None
    beyond: bool = False
    blocked_by: str | None = None
    predictor_gain: Fraction | None = None

    def _title(self) -> str:
        section = SECTIONS.get(self.section, self.section)
        if self.condition == self.section:
            return section
        if self.condition.startswith("26"):
            return f"A {equation(self.condition)}"
        if self.condition == "bounded":
            return f"{section}, unbounded: {self.constant}"
        return f"{section}, {condition_name(self.condition)}"

    def _why(self, reason: Reason) -> str:
        if self.condition == "bounded":
            return unbounded(self.constant or "")
        said = SAYS[self.condition]
        if self.needed is not None and self.allowed is not None:
            return f"{said}: {near(self.needed, 4)} is needed, {near(self.allowed, 4)} is allowed"
        if self.condition in _WITHOUT_MARGIN:
            return said
        chosen = self.predictor_gain is not None and self.condition in _OF_PREDICTOR
        predictor = f" (with A_m = -{near(self.predictor_gain or 0)} I)" if chosen else ""
        return f"{said}: {self._missed()}{predictor}"

    def _missed(self) -> str:
        """By how much: a margin m is what is left of what is allowed, so 1 - m of it is needed."""
        if self.blocked_by is not None:
            return f"no adaptation rate can, where {equation(self.blocked_by)} fails"
        if self.beyond:
            return "it fails by more than can be computed"
        low, high = (-inf, inf) if self.margin is None else (self.margin.below, self.margin.above)
        least, most = (f"{near(1 - side, 3)} times" for side in (high, low))
        if low == -inf:
            unknown = "how much it needs could not be bounded"
            return unknown if high == inf else f"{unknown}; it is at least {least} what is allowed"
        if high == inf:
            return f"it needs up to {most} what is allowed"
        return f"it needs {most if least == most else f'{least} to {most}'} what is allowed"

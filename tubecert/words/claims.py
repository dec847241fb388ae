"""What a claim is called, and why it holds or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import Any

from tubecert.bounds.constants import EVERY
from tubecert.claims.bounds import ConstantBounded, UncertaintyBound
from tubecert.claims.failures import (
    ConditionNumber,
    Failure,
    NoFrame,
    NoneCertified,
    NothingFound,
    NotProvenAsWritten,
    NotWritable,
    RankUnproven,
    UncontrollableMode,
    VariableForbidden,
)
from tubecert.claims.family import Claim, Reason
from tubecert.claims.gains import ConditionHolds, GainsSuffice
from tubecert.claims.limits import InputWithinLimits, ObstacleCleared
from tubecert.claims.metric import (
    MetricBound,
    MetricContraction,
    MetricDefinite,
    MetricFound,
    MetricKilling,
    RankOfB,
)
from tubecert.claims.outcomes import ConditionUnbounded, NoProposal, NotProven, Outcome, WrongShape
from tubecert.claims.tube import PlanBounded, TubeInSafeSet, TubeRadius
from tubecert.digits import down, near
from tubecert.spec.codes import CODES
from tubecert.verdict import Verdict
from tubecert.words.conditions import SAYS, SECTIONS, condition_name, equation

_OF_PREDICTOR = ("26c", "distance")  # conditions that another predictor may satisfy
_WITHOUT_MARGIN = (
    "wind_not_covered",
    "gain_not_covered",
    "proven_gains",
    "any_gains",
)


def title(claim: Claim) -> str:
    """What a claim is called, in the words of the table of gains."""
    match claim:
        case GainsSuffice():
            return SECTIONS.get(claim.section, claim.section)
        case ConditionHolds():
            return _condition_name(claim)
        case ConstantBounded():
            return f"bound of {claim.constant}"
        case UncertaintyBound():
            return f"declared bound of {claim.constant}"
        case ObstacleCleared():
            return f"clearance from obstacle {claim.obstacle}"
        case InputWithinLimits():
            return input_title(claim.input)
        case _:
            return _NAMES[type(claim)]


def input_title(name: str) -> str:
    """What the claim is called that an input stays within its limits."""
    return f"limits of {name}"


_NAMES: Mapping[type[Claim], str] = {
    RankOfB: "rank of B",
    MetricFound: "metric synthesis",
    MetricDefinite: "metric, C1",
    MetricContraction: "metric, C2",
    MetricKilling: "metric, C3",
    MetricBound: "declared bounds of the metric",
    TubeRadius: "radius of the tube",
    PlanBounded: "assumption 1: the tube lies in the safe set",
    TubeInSafeSet: "assumption 1: the tube lies in the safe set",
}


def _condition_name(claim: ConditionHolds) -> str:
    section = SECTIONS.get(claim.section, claim.section)
    if claim.condition == claim.section:
        return section
    if claim.condition.startswith("26"):
        return f"A {equation(claim.condition)}"
    if claim.condition == "bounded":
        return f"{section}, unbounded: {claim.constant}"
    return f"{section}, {condition_name(claim.condition)}"


def message(reason: Reason) -> str:
    """Why it holds or not, in one sentence."""
    return _MESSAGES[type(reason.claim)](reason.claim, reason)


def sentence(reason: Reason) -> str:
    """The claim and why it holds or not."""
    return f"{title(reason.claim)}: {message(reason)}"


# -- before there are gains


def _rank(claim: RankOfB | RankUnproven, reason: Reason) -> str:
    if reason.verdict is Verdict.REFUTED:
        return "B loses rank in the safe set"
    return "B could not be proven of full rank"


def _definite(claim: MetricDefinite, reason: Reason) -> str:
    return (
        "W is not positive definite"
        if reason.verdict is Verdict.REFUTED
        else "W could not be proven positive"
    )


def _killing(claim: MetricKilling, reason: Reason) -> str:
    condition = "C3 (the Killing condition)"
    if claim.residual is None:
        return f"{condition} could not be proven exactly for input {claim.input}"
    return f"{condition} fails for input {claim.input}: its residual is {near(claim.residual, 3)}"


def _contraction(claim: MetricContraction, reason: Reason) -> str:
    below, above = claim.largest_rate.below, claim.largest_rate.above
    if reason.verdict is Verdict.REFUTED:
        return f"C2 fails at rate {near(claim.rate)}: {_supported(below, above)}"
    lies = f"the largest rate lies in [{near(below, 10)}, {near(above, 10)}]"
    return f"{lies}, too close to the rate {near(claim.rate)} to tell"


def _supported(below: float, above: float) -> str:
    if above <= 0:
        return "this metric supports no positive rate"
    if below > 0:
        return f"the largest rate that this metric supports is {down(below, 6)}"
    return "no rate could be proven"


def _metric_bound(claim: MetricBound, reason: Reason) -> str:
    eigenvalue = "lmin(M)" if claim.side == "lower" else "lmax(M)"
    reaches = _reached(claim.reaches)
    return f"metric.bounds.{claim.side} is {near(claim.declared)}, but {eigenvalue} reaches {reaches}"


def _uncertainty_bound(claim: UncertaintyBound, reason: Reason) -> str:
    reaches = _reached(claim.reaches)
    declared = f"uncertainty.bounds.{claim.constant} is {near(claim.declared)}"
    return f"{declared}, but the expression reaches {reaches} on the tube"


def _reached(value: float | None) -> str:
    return "infinity" if value is None else near(value, 8)


def _radius(claim: TubeRadius, reason: Reason) -> str:
    rho = "rho = sqrt(A/a)|x0* - x0| + eps + rho_a"
    match claim.obstacle:
        case "out_of_range":
            return f"{rho} is beyond the range of numbers"
        case "metric_unbounded":
            return "the metric could not be bounded over the tube"
        case "not_settled":
            return f"{rho} did not settle: it grows with the tube beyond {near(claim.radius)}"


def _in_safe_set(claim: TubeInSafeSet, reason: Reason) -> str:
    lies = "leaves" if reason.verdict is Verdict.REFUTED else "could not be proven to stay in"
    when = "" if reason.at is None or reason.at.t is None else f", at t = {near(reason.at.t)}"
    excess = f", by {near(claim.excess, 3)}" if claim.excess > 0 else ""
    return (
        f"the tube of radius {near(claim.radius)} {lies} the safe set through the {claim.side} bound of "
        f"{claim.state}{when}{excess}"
    )


def _plan_bounded(claim: PlanBounded, reason: Reason) -> str:
    return "the curve between the plan's knots could not be bounded: two of its times may nearly coincide"


def unbounded(constant: str) -> str:
    """That a constant has no finite bound."""
    meaning = EVERY[constant]
    return f"{meaning.words} ({meaning.symbol}) could not be bounded within the budget of boxes"


def _cleared(claim: ObstacleCleared, reason: Reason) -> str:
    low, high = claim.clearance.below, claim.clearance.above
    if reason.verdict is Verdict.REFUTED:
        return "the tube contains a point of the obstacle"
    told = f"the tube keeps away from it by {near(low, 4)} at least" if low > 0 else "the tube may meet it"
    return f"{told}; at its nearest by {near(high, 4)}"


def _within(claim: InputWithinLimits, reason: Reason) -> str:
    beyond = f"{'below' if claim.side == 'lower' else 'above'} {near(claim.limit)}"
    if reason.verdict is Verdict.REFUTED:
        return f"the plan itself has {claim.input}* = {_reached(claim.plan)}, {beyond}"
    if claim.reaches is None or claim.feedback is None or claim.adaptation is None:
        return "no bound of it could be proven"
    added = f"feedback may add {near(claim.feedback, 4)}"
    if claim.adaptation:
        added += f" and adaptation {near(claim.adaptation, 4)}"
    planned = f"{claim.input}* reaches {_reached(claim.plan)}"
    return f"it may reach {near(claim.reaches)}, {beyond}: {planned}, to which {added}"


# -- gains


def _suffice(claim: GainsSuffice, reason: Reason) -> str:
    if len(claim.margins) == 1:
        (margin,) = claim.margins.values()
        predictor = "" if claim.predictor_gain is None else f", with A_m = -{near(claim.predictor_gain)} I"
        return f"proven margin {near(margin, 2)} of dbar{predictor}"
    margins = ", ".join(
        f"{condition} {near(margin, 2)}" for condition, margin in sorted(claim.margins.items())
    )
    binds = "" if claim.binds is None else f"{equation(claim.binds)} sets the bandwidth; "
    said = f"{binds}proven margins: {margins}"
    if claim.binds == "26b":
        said += "; where (26b) binds the rate grows without bound, so 1 % of it is left"
    return said


def _condition(claim: ConditionHolds, reason: Reason) -> str:
    if claim.condition == "bounded":
        return unbounded(claim.constant or "")
    said = SAYS[claim.condition]
    if claim.needed is not None and claim.allowed is not None:
        return f"{said}: {near(claim.needed, 4)} is needed, {near(claim.allowed, 4)} is allowed"
    if claim.condition in _WITHOUT_MARGIN:
        return said
    return f"{said}: {_margin(claim)}{_predictor(claim)}"


def _predictor(claim: ConditionHolds) -> str:
    if claim.predictor_gain is None or claim.condition not in _OF_PREDICTOR:
        return ""
    return f" (with A_m = -{near(claim.predictor_gain)} I)"


def _margin(claim: ConditionHolds) -> str:
    """The margin of a condition that is not proven, in words where it has no bound."""
    if claim.blocked_by is not None:
        return f"no adaptation rate can, where {equation(claim.blocked_by)} fails"
    if claim.beyond:
        return "it fails by more than can be computed"
    low, high = (-inf, inf) if claim.margin is None else (claim.margin.below, claim.margin.above)
    if low == -inf:
        below = "its margin could not be bounded from below"
        return below if high == inf else f"{below}; it is {near(high, 3)} at most"
    if (shown := near(low, 3)) == near(high, 3):
        return f"its margin is {shown}"
    if high == inf:
        return f"its margin is at least {shown}"
    return f"its margin lies in [{shown}, {near(high, 3)}]"


# -- a metric that was looked for


def _found(claim: MetricFound, reason: Reason) -> str:
    return _FAILURES[type(claim.failure)](claim.failure, reason)


def _mode(item: UncontrollableMode, reason: Reason) -> str:
    real, imaginary = item.mode
    pair = f" +- {near(abs(imaginary))}i" if abs(imaginary) > 1e-9 else ""
    return (
        f"the linearisation at an equilibrium has the uncontrollable mode {near(real)}{pair}: "
        f"no metric has a rate above {near(item.limit, 12)}"
    )


def _forbidden(item: VariableForbidden, reason: Reason) -> str:
    permitted = ", ".join(item.permitted) or "nothing"
    return f"W cannot depend on {item.variable}: C3 (the Killing condition) permits {permitted}"


def _not_writable(item: NotWritable, reason: Reason) -> str:
    return f"the metric cannot be written: {CODES[item.code]}"


def _nothing(item: NothingFound, reason: Reason) -> str:
    if not item.attempts:
        return "no metric was found"
    degrees = ", ".join(map(str, item.degrees))
    tried = f"{item.attempts} attempts by {' and '.join(item.routes)}, degree {degrees}"
    return f"no metric was found: {tried}" + (
        "" if item.last is None else f"; the last: {outcome(item.last)}"
    )


def _none_certified(item: NoneCertified, reason: Reason) -> str:
    slowest, fastest = near(item.slowest), near(item.fastest)
    slow = message(Reason(claim=item.slow, verdict=item.slow_verdict))
    fast = message(Reason(claim=item.fast, verdict=item.fast_verdict))
    if item.compared == 1:
        return f"the metric at rate {slowest} 1/s does not certify: {slow}"
    rates = f"none of {item.compared} metrics, of rates from {slowest} to {fastest} 1/s, certifies"
    if slow == fast:
        return f"{rates}: {slow}"
    return f"{rates}: at the slowest {slow}; at the fastest {fast}"


def outcome(item: Outcome) -> str:
    """What became of an attempt to find a metric."""
    match item:
        case NoProposal():
            return f"{item.route}: {item.status}"
        case WrongShape():
            return f"{item.route} gave coefficients of a wrong shape"
        case NotProven():
            return f"{item.route}: {message(Reason(claim=item.condition, verdict=item.verdict))}"
        case ConditionUnbounded():
            return f"{item.route}: the condition number could not be bounded"
        case _:
            return item.tag


def _above_limit(item: ConditionNumber, reason: Reason) -> str:
    number = near(item.condition_number, 5)
    return f"the least condition number found at rate {near(item.rate)} is {number}, above the limit"


def _as_written(item: NotProvenAsWritten, reason: Reason) -> str:
    why = _MESSAGES[type(item.condition)](item.condition, reason)
    return f"the metric as written could not be proven: {why}"


_FAILURES: Mapping[type[Failure], Callable[[Any, Reason], str]] = {
    RankUnproven: _rank,
    UncontrollableMode: _mode,
    VariableForbidden: _forbidden,
    NoFrame: lambda item, reason: "no frame of vector fields that commute with the columns of B was found",
    NotWritable: _not_writable,
    NotProvenAsWritten: _as_written,
    ConditionNumber: _above_limit,
    NoneCertified: _none_certified,
    NothingFound: _nothing,
}

_MESSAGES: Mapping[type[Claim], Callable[[Any, Reason], str]] = {
    RankOfB: _rank,
    MetricFound: _found,
    MetricDefinite: _definite,
    MetricKilling: _killing,
    MetricContraction: _contraction,
    MetricBound: _metric_bound,
    TubeRadius: _radius,
    PlanBounded: _plan_bounded,
    TubeInSafeSet: _in_safe_set,
    ConstantBounded: lambda claim, reason: unbounded(claim.constant),
    UncertaintyBound: _uncertainty_bound,
    GainsSuffice: _suffice,
    ObstacleCleared: _cleared,
    InputWithinLimits: _within,
    ConditionHolds: _condition,
}

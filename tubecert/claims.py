"""What can be claimed, assumed and advised: ids with parameters, never sentences. `words` makes sentences of them.

In: what a room found. Out: `Reason`s and `Assumption`s, as they stand in a certificate. The ids and the names of the
parameters are a contract: a reader of certificates decides by them. Trusted: yes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import ClassVar, Literal

from tubecert.enclosure.constant import Constant, Witness
from tubecert.records import INLINE, FormError, Json, Tagged, foreign, from_json, refer
from tubecert.verdict import Verdict

Side = Literal["lower", "upper"]


class Claim(Tagged):
    """Something that is proven, refuted or left undecided."""

    __slots__ = ()
    key: ClassVar[str] = "claim"


class Relax(Tagged):
    """Something that would help."""

    __slots__ = ()


class Assumption(Tagged):
    """Something that is not proven here and that the certificate rests on."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """A claim, what is known of it, a point that shows it, and what would help."""

    claim: Claim = field(metadata=INLINE)
    verdict: Verdict
    at: Witness | None = None
    relax: tuple[Relax, ...] = ()


# -- claims, in the order in which a certification meets them


@dataclass(frozen=True, slots=True, kw_only=True)
class RankOfB(Claim):
    """B(x) has full rank on the safe set."""

    tag: ClassVar[str] = "rank_of_B"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricFound(Claim):
    """A metric was found; `failure` says why not."""

    tag: ClassVar[str] = "metric_found"
    failure: Failure


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricDefinite(Claim):
    """C1: W(x) is positive definite on the safe set."""

    tag: ClassVar[str] = "metric_definite"


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricKilling(Claim):
    """C3: the Lie derivative of W along the column of `input` vanishes; `residual` is an entry of it at the witness."""

    tag: ClassVar[str] = "metric_killing"
    input: str
    residual: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricContraction(Claim):
    """C2 at `rate`, in 1/s; `largest_rate` encloses the supremum of the rates that the metric supports."""

    tag: ClassVar[str] = "metric_contraction"
    rate: Fraction
    largest_rate: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricBound(Claim):
    """The bound of M on the safe set that is `declared`; the eigenvalue is proven to reach `reaches`."""

    tag: ClassVar[str] = "metric_bound"
    side: Side
    declared: Fraction
    reaches: float | None


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


@dataclass(frozen=True, slots=True, kw_only=True)
class GainsSuffice(Claim):
    """The gains of a section satisfy its conditions; `margins` are what is proven to be left of each.

    `binds` sets the bandwidth, if one does; `below_twice_rate`: the bandwidth lies in the window below 2 lambda;
    `predictor_gain` g where the predictor is -g I by choice of the search.
    """

    tag: ClassVar[str] = "gains_suffice"
    section: str
    margins: Mapping[str, float]
    binds: str | None = None
    below_twice_rate: bool = False
    predictor_gain: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionHolds(Claim):
    """A condition of a section that is not proven, by `margin`, or by what is `needed` and `allowed`.

    `condition` is one of the section's own (26a, 26b, 26c, distance, sampled), or what no gains can help:
    `initial_distance` (d0 < dbar), `plan_defect` (delta/lambda < dbar), `parameters` and `wind` (the same with what
    they add), `wind_bound` (it is searched for), `wind_not_covered` (the theorem knows no wind), `gain_not_covered`
    (it knows no uncertain B), `gain_unmatched` (B acts where B(theta0) does), `gain_range` (|Delta| < 1), `bounded`
    (the constant `constant` is),
    `corrected_formulas`; or `any_gains`: none were found; or `proven_gains`: of those found none could be proven.
    `beyond`: the margin is below all floats; `blocked_by` names a condition without which this one has no margin.
    """

    tag: ClassVar[str] = "condition_holds"
    section: str
    condition: str
    constant: str | None = None
    margin: Constant | None = None
    needed: float | None = None
    allowed: float | None = None
    beyond: bool = False
    blocked_by: str | None = None
    predictor_gain: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleCleared(Claim):
    """The tube stays clear of obstacle number `obstacle` (from 1); `clearance` encloses by how much."""

    tag: ClassVar[str] = "obstacle_cleared"
    obstacle: int
    clearance: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWithinLimits(Claim):
    """An input of the plan and of the loop stays within its limits; on `side` it may reach `reaches`, beyond `limit`.

    `plan` is what u* itself reaches there: at least, where it is beyond the limit, else at most. `feedback` and
    `adaptation` add to it at most, by the theorem of `section`; without them nothing is known of the loop.
    """

    tag: ClassVar[str] = "input_within_limits"
    input: str
    side: Side
    limit: Fraction
    plan: float | None
    section: str | None = None
    reaches: float | None = None
    feedback: float | None = None
    adaptation: float | None = None


METRIC_CLAIMS = (MetricDefinite, MetricContraction, MetricKilling)


# -- why no metric was found


class Failure(Tagged):
    """Why a synthesis came to nothing."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class RankUnproven(Failure):
    """B could not be proven of full rank, or is proven to lose it at the witness."""

    tag: ClassVar[str] = "rank_of_B"


@dataclass(frozen=True, slots=True, kw_only=True)
class UncontrollableMode(Failure):
    """A mode of the linearisation at the witness that no input reaches: no metric has a rate above `limit`, in 1/s."""

    tag: ClassVar[str] = "uncontrollable_mode"
    mode: tuple[float, float]
    limit: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableForbidden(Failure):
    """C3 forbids that W depends on `variable`; it may depend on those `permitted`."""

    tag: ClassVar[str] = "variable_forbidden"
    variable: str
    permitted: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NoFrame(Failure):
    """No frame of vector fields that commute with the columns of B was found."""

    tag: ClassVar[str] = "no_frame"


@dataclass(frozen=True, slots=True, kw_only=True)
class NotWritable(Failure):
    """The metric is beyond what a specification can hold; `code` is that of the finding."""

    tag: ClassVar[str] = "not_writable"
    code: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NotProvenAsWritten(Failure):
    """The metric, read back as written, could not be proven; `condition` is the claim that failed."""

    tag: ClassVar[str] = "not_proven_as_written"
    condition: Claim


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionNumber(Failure):
    """The least condition number found at `rate` is above the limit that was given."""

    tag: ClassVar[str] = "condition_number"
    rate: Fraction
    condition_number: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NothingFound(Failure):
    """No attempt led to a metric; the attempts stand in `result.synthesis`."""

    tag: ClassVar[str] = "nothing_found"
    attempts: int
    routes: tuple[str, ...]
    degrees: tuple[int, ...]
    last: Outcome | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoneCertified(Failure):
    """Metrics were found at `compared` rates from `slowest` to `fastest`, and none certifies.

    `slow` and `fast` are the claims that ended the certifications with the slowest and the fastest.
    """

    tag: ClassVar[str] = "none_certified"
    compared: int
    slowest: Fraction
    fastest: Fraction
    slow: Claim
    slow_verdict: Verdict
    fast: Claim
    fast_verdict: Verdict


# -- what became of an attempt to find a metric


class Outcome(Tagged):
    """What a route came to; all but `Proven` are why there is no metric by it."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Proven(Outcome):
    """A metric, proven."""

    tag: ClassVar[str] = "proven"


@dataclass(frozen=True, slots=True, kw_only=True)
class NoProposal(Outcome):
    """The route proposed nothing; `status` is what its solver said."""

    tag: ClassVar[str] = "no_proposal"
    route: str
    status: str


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongShape(Outcome):
    """The route proposed coefficients of a wrong shape."""

    tag: ClassVar[str] = "wrong_shape"
    route: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NotProven(Outcome):
    """The proposal, rounded, could not be proven, or is refuted: `condition` failed."""

    tag: ClassVar[str] = "not_proven"
    route: str
    condition: Claim
    verdict: Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class ConditionUnbounded(Outcome):
    """The condition number of what was proposed could not be bounded."""

    tag: ClassVar[str] = "condition_unbounded"
    route: str


# -- what would help


@dataclass(frozen=True, slots=True, kw_only=True)
class HalveConstant(Relax):
    """With the constant halved, the least Gamma is `factor` times what it is."""

    tag: ClassVar[str] = "halve_constant"
    constant: str
    factor: float


HardwarePart = Literal["sample_time", "delay", "noise", "wind"]


@dataclass(frozen=True, slots=True, kw_only=True)
class HalveHardware(Relax):
    """With this part of the machine halved, the tube of certificate H is about `factor` times as wide."""

    tag: ClassVar[str] = "halve_hardware"
    part: HardwarePart
    factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class EaseHardware(Relax):
    """With `value` for this part of the machine, the others as they are, certificate H is proven."""

    tag: ClassVar[str] = "ease_hardware"
    part: HardwarePart
    value: Fraction


HardwareCause = Literal[
    "plan",
    "feedforward",
    "wind",
    "wind_estimate",
    "bias",
    "noise_estimate",
    "lag",
    "noise_feedback",
    "sampling",
    "gain",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class LessenCause(Relax):
    """At the loop that comes nearest, this cause takes `share` of what contraction makes good; nothing is proven."""

    tag: ClassVar[str] = "lessen_cause"
    cause: HardwareCause
    share: float


Knob = Literal[
    "epsilon",
    "rho_a",
    "half_widths",
    "rate",
    "start",
    "uncertainty",
    "wind",
    "knots",
    "defect",
    "gap",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnKnob(Relax):
    """With `value` in place of `now` for this knob, all else as it is, the specification is certified.

    For half_widths, start (its distance from the plan) and uncertainty it is a factor. `input` and `term`: only this
    input's h, or only this term of it, as an expression; without them all of h.
    """

    tag: ClassVar[str] = "turn_knob"
    knob: Knob
    now: Fraction
    value: Fraction
    input: str | None = None
    term: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoKnobAlone(Relax):
    """None of the knobs `tried` was found to serve alone; these values together are proven to, if any were found.

    `half_widths` and `uncertainty` are factors.
    """

    tag: ClassVar[str] = "no_knob_alone"
    tried: tuple[Knob, ...]
    epsilon: Fraction | None = None
    half_widths: Fraction | None = None
    uncertainty: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MendPlan(Relax):
    """The plan misses x' = f + B u by up to `defect` (at t, if known), which alone takes `share` of the tube."""

    tag: ClassVar[str] = "mend_plan"
    defect: float
    share: float
    remedy: PlanRemedy
    t: float | None = None


class PlanRemedy(Tagged):
    """What would lower the defect of a plan."""

    __slots__ = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectPlan(PlanRemedy):
    """Correct the expressions."""

    tag: ClassVar[str] = "correct_plan"


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherInterpolation(PlanRemedy):
    """With another interpolation of the inputs the defect would be `defect`."""

    tag: ClassVar[str] = "other_interpolation"
    interpolation: Literal["hold", "linear"]
    defect: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MoreKnots(PlanRemedy):
    """Give more knots, or integrate the dynamics between them."""

    tag: ClassVar[str] = "more_knots"


@dataclass(frozen=True, slots=True, kw_only=True)
class RaiseBudget(Relax):
    """A larger budget of boxes may decide it; `proof`: a proof of a synthesis ran out of it."""

    tag: ClassVar[str] = "raise_budget"
    proof: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ShrinkTube(Relax):
    """A smaller tube."""

    tag: ClassVar[str] = "shrink_tube"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReduceRadii(Relax):
    """Smaller epsilon, rho_a or initial error."""

    tag: ClassVar[str] = "reduce_radii"


@dataclass(frozen=True, slots=True, kw_only=True)
class LeavePlanRoom(Relax):
    """A plan with more room between its inputs and their limits."""

    tag: ClassVar[str] = "leave_plan_room"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReduceInitialError(Relax):
    """A start nearer to the plan."""

    tag: ClassVar[str] = "reduce_initial_error"


@dataclass(frozen=True, slots=True, kw_only=True)
class EnlargeSafeSet(Relax):
    """A larger safe set."""

    tag: ClassVar[str] = "enlarge_safe_set"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShrinkSafeSet(Relax):
    """A smaller safe set: to `factor` of its size about its centre, where `rate` works, if that is known."""

    tag: ClassVar[str] = "shrink_safe_set"
    factor: float | None = None
    rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LowerRate(Relax):
    """A lower rate of the metric: `to` that one, where it is known to be supported."""

    tag: ClassVar[str] = "lower_rate"
    to: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherMetric(Relax):
    """Another dual metric."""

    tag: ClassVar[str] = "other_metric"


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclareMetricBound(Relax):
    """A bound of M that holds."""

    tag: ClassVar[str] = "declare_metric_bound"
    side: Side | None = None
    value: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclareUncertaintyBound(Relax):
    """A bound of the uncertainty that holds."""

    tag: ClassVar[str] = "declare_uncertainty_bound"
    constant: str
    value: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class AskForRateBelow(Relax):
    """Ask for a rate below `rate`."""

    tag: ClassVar[str] = "ask_for_rate_below"
    rate: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class AskForRateUpTo(Relax):
    """`rate` works on this safe set."""

    tag: ClassVar[str] = "ask_for_rate_up_to"
    rate: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class GiveInput(Relax):
    """The mode needs an input."""

    tag: ClassVar[str] = "give_input"


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherVariables(Relax):
    """Other variables of W, or none asked for."""

    tag: ClassVar[str] = "other_variables"


@dataclass(frozen=True, slots=True, kw_only=True)
class LowerDegree(Relax):
    """A lower degree of W."""

    tag: ClassVar[str] = "lower_degree"


@dataclass(frozen=True, slots=True, kw_only=True)
class HigherDegree(Relax):
    """A degree of W above `degree`, or none asked for."""

    tag: ClassVar[str] = "higher_degree"
    degree: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RaiseConditionNumber(Relax):
    """A higher limit of the condition number."""

    tag: ClassVar[str] = "raise_condition_number"
    to: float


# -- assumptions (docs/guarantee, "What is assumed")


@dataclass(frozen=True, slots=True, kw_only=True)
class LeastFeedback(Assumption):
    """The feedback is the least k of the quadratic program, evaluated in continuous time and exactly."""

    tag: ClassVar[str] = "least_feedback"


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightGeodesics(Assumption):
    """Nothing, really: the metric is constant, its geodesics are straight and unique."""

    tag: ClassVar[str] = "straight_geodesics"


@dataclass(frozen=True, slots=True, kw_only=True)
class ExactGeodesics(Assumption):
    """The controller finds the minimising geodesic exactly, and it is unique in the tube.

    `uniqueness`: proven, with `value` = G rho + L_G rho^2/8 < 1; else assumed, `value` once it is known.
    """

    tag: ClassVar[str] = "exact_geodesics"
    uniqueness: Literal["proven", "assumed"]
    value: Constant | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StartAtRest(Assumption):
    """xhat(0) = x(0), u_a(0) = 0, and sigma_hat(0) lies in the projection's ball."""

    tag: ClassVar[str] = "start_at_rest"


@dataclass(frozen=True, slots=True, kw_only=True)
class HardProjection(Assumption):
    """The projection is hard."""

    tag: ClassVar[str] = "hard_projection"


@dataclass(frozen=True, slots=True, kw_only=True)
class SmoothProjection(Assumption):
    """The projection is smooth with this layer."""

    tag: ClassVar[str] = "smooth_projection"
    layer: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class PerfectState(Assumption):
    """The full state is measured without noise or delay, and inputs do not saturate."""

    tag: ClassVar[str] = "perfect_state"


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstOrderFilter(Assumption):
    """C(s) = omega/(s + omega)."""

    tag: ClassVar[str] = "first_order_filter"


@dataclass(frozen=True, slots=True, kw_only=True)
class ForAllTime(Assumption):
    """The claim is for all t >= 0."""

    tag: ClassVar[str] = "for_all_time"


@dataclass(frozen=True, slots=True, kw_only=True)
class UpToHorizon(Assumption):
    """The claim is for 0 <= t <= `horizon`, in s."""

    tag: ClassVar[str] = "up_to_horizon"
    horizon: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyAsDeclared(Assumption):
    """The uncertainty obeys its declared bounds on the tube."""

    tag: ClassVar[str] = "uncertainty_as_declared"


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyAsGiven(Assumption):
    """The uncertainty is the expression of the specification, or any other within the certificate's h, h_x, h_t."""

    tag: ClassVar[str] = "uncertainty_as_given"
    any_within_bounds: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineAsGiven(Assumption):
    """The computer, its sensors and its inputs are what the section `hardware` says; for certificate H."""

    tag: ClassVar[str] = "machine_as_given"


@dataclass(frozen=True, slots=True, kw_only=True)
class WindWithin(Assumption):
    """Beside the inputs acts E(x) w with |w| <= `bound` (None: whatever a certificate finds), else arbitrary.

    `rate` bounds |w'|, in 1/s, where that is known.
    """

    tag: ClassVar[str] = "wind_within"
    bound: Fraction | None = None
    rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametersWithin(Assumption):
    """The parameters of the claim are constant, anywhere in their ranges; the controller knows f, B at the middles."""

    tag: ClassVar[str] = "parameters_within"


# -- as JSON


def _place_json(at: Witness) -> Json:
    return {**({} if at.t is None else {"t": at.t}), "x": list(at.x)}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    x: tuple[float, ...]
    t: float | None = None


def _place(data: Json, path: str) -> Witness:
    form = from_json(_Place, data, path)
    return Witness(t=form.t, x=form.x)


def _pair_json(value: Constant) -> Json:
    """[below, above]; null where there is no bound."""
    return [side if math.isfinite(side) else None for side in (value.below, value.above)]


def _pair(data: Json, path: str) -> Constant:
    low, high = from_json(tuple[float | None, float | None], data, path)
    try:
        return Constant(below=-math.inf if low is None else low, above=math.inf if high is None else high)
    except ValueError as error:
        raise FormError(path, f"is {error}") from error


foreign(Witness, _place_json, _place)
foreign(Constant, _pair_json, _pair)
refer(Witness, "point")
refer(Constant, "enclosure")

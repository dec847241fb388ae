"""What is assumed, as sentences."""

from __future__ import annotations

from tubecert.claims.assumptions import (
    ExactGeodesics,
    FirstOrderFilter,
    ForAllTime,
    HardProjection,
    LeastFeedback,
    ParametersWithin,
    PerfectState,
    SmoothProjection,
    StartAtRest,
    StraightGeodesics,
    UncertaintyAsDeclared,
    UncertaintyAsGiven,
    UpToHorizon,
    WindWithin,
)
from tubecert.claims.family import Assumption
from tubecert.digits import down, near, up

_FIXED: dict[type[Assumption], str] = {
    LeastFeedback: "the feedback is the least k of the quadratic program with this metric and rate (docs/theory, "
    "section 0); the controller acts in continuous time and exactly, "
    "evaluates f(x*) + B(x*) u* itself and never the derivative of a stored plan",
    StraightGeodesics: "the controller takes the straight line for the minimising geodesic; where the metric is "
    "constant, as here, it is the only one",
    StartAtRest: "xhat(0) = x(0), the filter starts at rest (u_a(0) = 0), and sigma_hat(0) lies in the projection's "
    "ball",
    HardProjection: "the projection is hard",
    PerfectState: "the full state is measured without noise or delay, and inputs do not saturate",
    FirstOrderFilter: "the filter is first order, C(s) = omega/(s + omega)",
    ForAllTime: "the claim is for all t >= 0",
    ParametersWithin: "the parameters that are known by ranges are constant and lie in them; predictor, feedback and "
    "plan are those of f and B at the middles of the ranges",
    UncertaintyAsDeclared: "the uncertainty obeys its declared bounds on the tube",
}


def assumed(item: Assumption) -> str:
    """The sentence of an assumption."""
    match item:
        case ExactGeodesics():
            return _geodesics(item)
        case SmoothProjection():
            return f"the projection is smooth with layer {near(item.layer)}"
        case UpToHorizon():
            return f"the claim is for 0 <= t <= {near(item.horizon)} s"
        case WindWithin():
            return _wind(item)
        case UncertaintyAsGiven():
            others = ", or any other within the bounds h, h_x, h_t of this certificate"
            return "the uncertainty is the expression of the specification" + (
                others if item.any_within_bounds else ""
            )
        case _:
            return _FIXED[type(item)]


def _wind(item: WindWithin) -> str:
    rate = "" if item.rate is None else f", |dw/dt| <= {near(item.rate)} 1/s"
    return f"a wind acts as E(x) w beside the inputs, |w| <= {near(item.bound)}{rate}, and is otherwise arbitrary"


def _geodesics(item: ExactGeodesics) -> str:
    exact = "the controller finds the minimising geodesic exactly"
    if item.value is None:
        return f"{exact}, and it is unique in the tube (not proven here)"
    if item.uniqueness == "proven":
        most = up(item.value.above, 6)
        return f"{exact}; it is unique in the tube: proven, G rho + L_G rho^2/8 <= {most}"
    size = f"reaches {down(item.value.below, 6)}"
    if item.value.below < 1:
        size = "could not be bounded by less than 1"
    return f"{exact}, and it is unique in the tube (not proven: G rho + L_G rho^2/8 {size})"

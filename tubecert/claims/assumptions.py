"""What is not proven and what the certificate rests on (docs/guarantee, "What is assumed")."""

from __future__ import annotations

from fractions import Fraction
from functools import partial
from typing import Literal

from tubecert.claims.family import Assumption, plain
from tubecert.digits import down, near, up
from tubecert.enclosure.constant import Constant

_assumption = partial(plain, __name__, Assumption)

LeastFeedback = _assumption(
    "LeastFeedback",
    "the feedback is the least k of the quadratic program with this metric and rate (docs/theory, section 0); the "
    "controller acts in continuous time and exactly, evaluates f(x*) + B(x*) u* itself and never the derivative "
    "of a stored plan",
)
StraightGeodesics = _assumption(
    "StraightGeodesics",
    "the controller takes the straight line for the minimising geodesic; where the metric is constant, as here, it "
    "is the only one",
)


class ExactGeodesics(Assumption):
    """The controller finds the minimising geodesic exactly, and it is unique in the tube.

    `uniqueness`: proven, with `value` = G rho + L_G rho^2/8 < 1; else assumed, `value` once it is known.
    """

    uniqueness: Literal["proven", "assumed"]
    value: Constant | None = None

    def _told(self) -> str:
        exact = "the controller finds the minimising geodesic exactly"
        if self.value is None:
            return f"{exact}, and it is unique in the tube (not proven here)"
        if self.uniqueness == "proven":
            most = up(self.value.above, 6)
            return f"{exact}; it is unique in the tube: proven, G rho + L_G rho^2/8 <= {most}"
        size = f"reaches {down(self.value.below, 6)}"
        if self.value.below < 1:
            size = "could not be bounded by less than 1"
        return f"{exact}, and it is unique in the tube (not proven: G rho + L_G rho^2/8 {size})"


StartAtRest = _assumption(
    "StartAtRest",
    "xhat(0) = x(0), the filter starts at rest (u_a(0) = 0), and sigma_hat(0) lies in the projection's ball",
)
HardProjection = _assumption("HardProjection", "the projection is hard")


class SmoothProjection(Assumption):
    """The projection is smooth with this layer."""

    says = "the projection is smooth with layer {layer}"
    layer: Fraction


PerfectState = _assumption(
    "PerfectState", "the full state is measured without noise or delay, and inputs do not saturate"
)
FirstOrderFilter = _assumption("FirstOrderFilter", "the filter is first order, C(s) = omega/(s + omega)")
ForAllTime = _assumption("ForAllTime", "the claim is for all t >= 0")


class UpToHorizon(Assumption):
    """The claim is for 0 <= t <= `horizon`, in s."""

    says = "the claim is for 0 <= t <= {horizon} s"
    horizon: Fraction


UncertaintyAsDeclared = _assumption(
    "UncertaintyAsDeclared", "the uncertainty obeys its declared bounds on the tube"
)


class UncertaintyAsGiven(Assumption):
    """The uncertainty is the expression of the specification, or any other within the certificate's h, h_x, h_t."""

    any_within_bounds: bool

    def _told(self) -> str:
        others = ", or any other within the bounds h, h_x, h_t of this certificate"
        given = "the uncertainty is the expression of the specification"
        return given + (others if self.any_within_bounds else "")


class WindWithin(Assumption):
    """Beside the inputs acts E(x) w with |w| <= `bound`, else arbitrary.

    `rate` bounds |w'|, in 1/s, where that is known.
    """

    bound: Fraction
    rate: Fraction | None = None

    def _told(self) -> str:
        rate = "" if self.rate is None else f", |dw/dt| <= {near(self.rate)} 1/s"
        wind = f"a wind acts as E(x) w beside the inputs, |w| <= {near(self.bound)}{rate}"
        return f"{wind}, and is otherwise arbitrary"


ParametersWithin = _assumption(
    "ParametersWithin",
    "the parameters that are known by ranges are constant and lie in them; predictor, feedback and plan are those "
    "of f and B at the middles of the ranges",
)

"""What is not proven and what the certificate rests on (docs/guarantee, "What is assumed")."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Literal

from tubecert.claims.family import Assumption
from tubecert.enclosure.constant import Constant


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
class WindWithin(Assumption):
    """Beside the inputs acts E(x) w with |w| <= `bound`, else arbitrary.

    `rate` bounds |w'|, in 1/s, where that is known.
    """

    tag: ClassVar[str] = "wind_within"
    bound: Fraction
    rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametersWithin(Assumption):
    """The parameters of the claim are constant, anywhere in their ranges; the controller knows f, B at the middles."""

    tag: ClassVar[str] = "parameters_within"

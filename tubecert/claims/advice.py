"""What would help."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Literal

from tubecert.claims.family import Relax, Side
from tubecert.records import Tagged


@dataclass(frozen=True, slots=True, kw_only=True)
class HalveConstant(Relax):
    """With the constant halved, the least Gamma is `factor` times what it is."""

    tag: ClassVar[str] = "halve_constant"
    constant: str
    factor: float


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
class ConstantInputs(Relax):
    """Inputs in which B is constant, such as the accelerations of joints."""

    tag: ClassVar[str] = "constant_inputs"


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

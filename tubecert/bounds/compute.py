"""The radius of the tube and all constants over it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Literal, Protocol, TypeVar

import numpy as np

from tubecert.bounds.constants import BoundConstants, Constant
from tubecert.bounds.start import InitialState
from tubecert.bounds.suprema import Suprema
from tubecert.bounds.wind import beside_of, uncertainty_constants
from tubecert.enclosure.constant import decimal_above
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.model import TIME
from tubecert.tube import Containment, containment
from tubecert.verdict import Verdict

T = TypeVar("T")
Box = tuple[tuple[Fraction, Fraction], ...]
Obstacle = Literal["out_of_range", "metric_unbounded", "not_settled"]
_ROUNDS = 60
OF_UNCERTAINTY = ("h", "h_x", "h_t", "h_initial")
_CLOSE = 1 + Fraction(1, 10**4)
_INFLATION = 1 + Fraction(1, 10**6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Radius:
    """rho >= sqrt(A/a)|x0* - x0| + eps + rho_a, an exact decimal.

    `contained` tells whether O(rho) lies in the safe set; if not, there is no rho and the tube is refused. `obstacle`
    says why the fixed point was not found, if it was not (see `TubeRadius`). `sides`: what |x_i - x_i*| is at
    most, where the tube has coordinates of its own.
    """

    rho: Fraction
    lower: Constant | None = None
    upper: Constant | None = None
    contained: Containment = field(default_factory=Containment)
    obstacle: Obstacle | None = None
    sides: tuple[Fraction, ...] | None = None


def least_radius(
    suprema: Suprema,
    safe_set: Box,
    offset: Interval,
    width: Fraction,
    declared: tuple[Constant, Constant] | None,
) -> Radius:
    """The least rho with rho >= sqrt(A/a)|x0* - x0| + width, where a and A are those of O(rho) itself, theory 2.11.

    Iterated upwards, inflated by 1e-6, and proven: with a and A over O(rho), the right-hand side is at most rho.
    With declared a and A (proven on the safe set) there is nothing to iterate.
    """

    def check(rho: Fraction) -> Containment:
        return containment(suprema.plan, rho, suprema.model.states, safe_set, suprema.effort)

    if declared is not None:
        given = overshoot(*declared, offset, width)
        if given is None:
            return Radius(rho=width, obstacle="out_of_range")
        return Radius(rho=given, lower=declared[0], upper=declared[1], contained=check(given))
    if not math.isfinite(offset.hi):
        return Radius(rho=width, obstacle="out_of_range")
    rho = decimal_above(Fraction(float(offset.hi)) + width)
    contained = check(rho)
    for _ in range(_ROUNDS):
        contained = check(rho)
        if contained.verdict is not Verdict.CERTIFIED:
            return Radius(rho=rho, contained=contained)
        a, A = suprema.with_radius(rho).metric_bounds()
        if not (a.below > 0 and math.isfinite(A.above)):
            return Radius(rho=rho, contained=contained, obstacle="metric_unbounded")
        right = overshoot(a, A, offset, width)
        if right is None:
            return Radius(rho=rho, contained=contained, obstacle="out_of_range")
        if right <= rho:
            return Radius(rho=rho, lower=a, upper=A, contained=contained)
        rho = decimal_above(right * _INFLATION) if right < rho * _CLOSE else right
    return Radius(rho=rho, contained=contained, obstacle="not_settled")


def overshoot(a: Constant, A: Constant, offset: Interval, width: Fraction) -> Fraction | None:
    """sqrt(A/a) offset + width, None if it is beyond all floats, theory 2.11."""
    if not a.below > 0:
        return None
    if not offset.hi > 0:
        return width
    with np.errstate(all="ignore"):
        value = float((sqrt(Interval.exact(A.above) / Interval.exact(a.below)) * offset).hi)
    return decimal_above(Fraction(value) + width) if math.isfinite(value) else None


class Recall(Protocol):
    """What is known of constants by their names, or what `compute` makes of them."""

    def __call__(self, names: tuple[str, ...], compute: Callable[[], T]) -> T:
        """It."""
        ...


def _computed(names: tuple[str, ...], compute: Callable[[], T]) -> T:
    del names
    return compute()


def bound_constants(
    suprema: Suprema,
    start: InitialState,
    metric: tuple[Constant, Constant],
    declared: Mapping[str, Constant],
    recall: Recall = _computed,
) -> BoundConstants:
    """Every constant over the tube, in its coordinates.

    `metric` is (a, A) over the tube; `declared` may hold h, h_x, h_t, which then take the place of derived bounds.
    `recall` is given the names of constants that are computed together, and what computes them to their gaps.
    """
    fields = suprema.fields
    declared, derived = recall(OF_UNCERTAINTY, lambda: uncertainty_bounds(suprema, start, declared))
    delta_p, delta = recall(("plan_defect", "plan_defect_metric"), suprema.plan_defect)

    def one(name: str, compute: Callable[[], Constant]) -> Constant:
        return recall((name,), compute)

    constants = BoundConstants(
        lower=metric[0],
        upper=metric[1],
        f=one("f", lambda: suprema.norms("f", [fields.f])),
        f_x=one("f_x", lambda: suprema.norms("f_x", [fields.f_x])),
        B=one("B", lambda: suprema.norms("B", [fields.B])),
        B_x=one("B_x", lambda: suprema.norms("B_x", fields.B_x)),
        b_x=one("b_x", lambda: suprema.norms("b_x", fields.b_x)),
        B_pinv=one("B_pinv", lambda: suprema.norms("B_pinv", [fields.B_pinv])),
        B_pinv_x=one("B_pinv_x", lambda: suprema.norms("B_pinv_x", fields.B_pinv_x)),
        M_x=one("M_x", suprema.metric_slope),
        u_star=one("u_star", suprema.input_on_plan),
        **{**derived, **declared},
        feedback_gain=one("feedback_gain", suprema.feedback_gain),
        metric_input_gain=one("metric_input_gain", suprema.metric_input_gain),
        drift_on_plan=one("drift_on_plan", suprema.drift_on_plan),
        initial_distance=start.distance(suprema, metric),
        plan_defect=delta_p,
        plan_defect_metric=delta,
    )
    # what is declared is an exact decimal already
    return replace(constants.printable(), **declared)


def uncertainty_bounds(
    suprema: Suprema, start: InitialState, declared: Mapping[str, Constant]
) -> tuple[Mapping[str, Constant], Mapping[str, Constant]]:
    """h, h_x, h_t and h_initial over the tube: those that stand as they were declared, and those that are derived."""
    if "h" in declared:  # the class of uncertainties is what is declared, whatever the expression starts from
        declared = {**declared, "h_initial": declared["h"]}
    if beside_of(suprema).joins_uncertainty:
        return {}, uncertainty_constants(suprema, start, declared)
    derived: dict[str, Constant] = {}
    if suprema.model.h is not None:
        derived = dict(zip(("h", "h_x", "h_t"), suprema.uncertainty(), strict=True))
        derived["h_initial"] = start.uncertainty(suprema)
    return declared, derived


def time_range(
    horizon: Fraction | None, period: Interval | None
) -> tuple[Fraction | float, Fraction | float] | None:
    """The range of t over which h must be bounded: the horizon, or one period where there is no horizon.

    None if h does not depend on t or is not given; raises `ValueError` if neither is known.
    """
    if horizon is not None:
        return Fraction(0), horizon
    if period is None:
        raise ValueError(f"h depends on {TIME} without a period, so a horizon is needed")
    return (0.0, float(period.hi)) if period.hi > 0 else None

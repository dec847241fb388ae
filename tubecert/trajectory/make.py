"""A specification -> its plan. Knots that a planner proposes are checked for what the specification asks of them.

That a plan is what it claims to be does not rest on who made it: how far it is from satisfying the dynamics is proven
(`defect`), that it starts, ends and moves as asked for is decided here, exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from math import isqrt
from typing import Literal

import numpy as np

from tubecert.claims.advice import CorrectPlan, MoreKnots, OtherInterpolation, PlanRemedy
from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import fraction_bounds
from tubecert.errors import SpecError
from tubecert.expression import PI, constant, to_text
from tubecert.expression.number import PI_ABOVE
from tubecert.expression.waves import frequencies
from tubecert.findings import Finding
from tubecert.model import TIME, ControlAffineModel, moving_parts, time_period
from tubecert.spec import Knots, Spec, Task
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import Defect, Plan, family

_SHARE = 1e-3  # of the tube that a planned curve's defect may cost
# |x*(T) - target| may be this much of 1 + |target|, where a plan is to end in its target
MISS = Fraction(1, 1000)
_DIGITS = 10**12  # of a root


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """What a defect is measured against: radius of the tube, and a lower bound of the metric."""

    rho: Fraction
    lower: float
    effort: Effort

    def allowed(self, model: ControlAffineModel) -> float:
        """The defect, in the metric, that costs a thousandth of the tube: delta/rate < 1e-3 sqrt(a) rho."""
        return _SHARE * float(model.rate) * float(np.sqrt(self.lower)) * float(self.rho)


def plan_of(spec: Spec, model: ControlAffineModel, proposed: Knots | None = None) -> Plan:
    """The plan of a specification, through the knots that a planner proposes where the specification asks for one.

    Raises `SpecError` for proposed knots that are not what was asked for.
    """
    trajectory = spec.trajectory
    if trajectory.bundle is not None:
        boxes = trajectory.bundle.x, trajectory.bundle.u
        return family(spec.states, spec.inputs, boxes, trajectory.bundle.defect, trajectory.horizon)
    if trajectory.table is not None:
        return piecewise_plan(model, trajectory.table.knots, trajectory.horizon)
    if trajectory.task is not None:
        if proposed is None:
            raise ValueError("this plan needs a planner's knots")
        trouble = refusal(spec, trajectory.task, proposed)
        if trouble is not None:
            raise SpecError([trouble])
        return piecewise_plan(model, proposed)
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    return Plan(x, u, trajectory.horizon)


def refusal(spec: Spec, task: Task, knots: Knots) -> Finding | None:
    """What keeps a planner's knots from being the plan that was asked for; decided in exact arithmetic."""
    shape = len(spec.states), len(spec.inputs)
    whole = (
        len(knots.t) == len(knots.x) == len(knots.u) >= 2
        and all(len(x) == shape[0] and len(u) == shape[1] for x, u in zip(knots.x, knots.u, strict=True))
        and all(before < after for before, after in zip(knots.t, knots.t[1:], strict=False))
    )
    if not whole or knots.t[0] != 0 or knots.t[-1] != spec.trajectory.horizon:
        return _unusable(spec, "has no knots from 0 to the horizon")
    if knots.interpolation != task.interpolation:
        return _unusable(spec, f"is not for interpolation: {task.interpolation}")
    if knots.x[0] != task.start:
        return _unusable(spec, "does not begin where it was asked to")
    if task.goal and misses(task, knots.x[-1]):
        gap = sum(((a - b) ** 2 for a, b in zip(knots.x[-1], task.target, strict=True)), Fraction(0))
        return Finding(
            code="TC402",
            message=f"the planner misses the target by {near(float(gap) ** 0.5, 3)} at the end of the horizon",
            location=spec.location("trajectory.kind"),
            help="lengthen trajectory.horizon, raise trajectory.knots, or set trajectory.goal: false",
        )
    return None


def misses(task: Task, end: tuple[Fraction, ...]) -> bool:
    """Whether |end - target| > MISS (1 + |target|), but for the last digit of a root."""
    gap = sum(((a - b) ** 2 for a, b in zip(end, task.target, strict=True)), Fraction(0))
    size = sum((b * b for b in task.target), Fraction(0))
    root = Fraction(isqrt(int(size * _DIGITS**2)), _DIGITS)  # rounded down: nothing is let through by it
    return gap > (MISS * (1 + root)) ** 2


def _unusable(spec: Spec, why: str) -> Finding:
    return Finding(
        code="TC410",
        message=f"the plan that was proposed {why}",
        location=spec.location("trajectory.kind"),
        help="run again; if it happens again, give a plan as CSV and report the specification",
    )


def remedy(plan: Plan, model: ControlAffineModel, room: Room) -> PlanRemedy:
    """What would lower a plan's defect."""
    knots = plan.knots
    if knots is None:
        return CorrectPlan()
    if knots.interpolation == "hermite-simpson":
        return MoreKnots()
    other: Literal["hold", "linear"] = "linear" if knots.interpolation == "hold" else "hold"
    mended = piecewise_plan(model, replace(knots, interpolation=other), plan.horizon)
    rho, effort = fraction_bounds(room.rho)[1], replace(room.effort, gap=0.05)
    own, instead = (Defect.of(each, model, rho, effort).in_state().above for each in (plan, mended))
    if instead < 0.5 * own:
        return OtherInterpolation(interpolation=other, defect=instead)
    return MoreKnots()


def unending(spec: Spec, knots: Knots | None) -> list[Finding]:
    """Why a computer's h or plan is not known for all times of the claim; `knots` of a plan that goes through some."""

    def refused(path: str, message: str, help: str) -> Finding:
        return Finding(code="TC204", message=message, location=spec.location(path), help=help)

    plan = spec.trajectory
    if (plan.horizon is None or plan.afterwards != "nothing") and time_period(moving_parts(spec)) is None:
        unseen = "h depends on t for ever, without a period that can be seen"
        return [refused("uncertainty.h", unseen, "give trajectory.horizon, in s")]
    if plan.afterwards != "repeat" or plan.horizon is None or not (why := _breaks(spec, plan.horizon, knots)):
        return []
    help = "leave out afterwards, or give a plan that ends as it begins; a horizon may be written as 2*pi"
    return [refused("trajectory.afterwards", f"the plan does not repeat: {why}", help)]


def _breaks(spec: Spec, end: Fraction, knots: Knots | None) -> str:
    """Why a plan does not begin again where its horizon ends; empty if it does.

    Formulas go on as they are, with a period that is not longer than the horizon; knots begin again, which needs
    equal ends and a horizon of whole samples.
    """
    if knots is not None:
        if spec.hardware is not None and (end / spec.hardware.sample_time).denominator != 1:
            return "its horizon is no whole number of samples"
        joined = knots.t[-1] == end and knots.x[0] == knots.x[-1] and knots.u[0] == knots.u[-1]
        return "" if joined else "its ends differ"
    waves = frequencies((term.expression for term in (*spec.trajectory.x, *spec.trajectory.u)), TIME)
    if waves is None:
        return "no common period of its formulas can be seen"
    length, of_pi = waves.period or (Fraction(0), False)
    if length * (PI_ABOVE if of_pi else 1) <= end:
        return ""
    return f"its period, {to_text(length * PI if of_pi else constant(length))[:40]} s, is longer than its horizon"

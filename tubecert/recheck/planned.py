"""A plan through knots: that it is the plan its task asks for.

A plan *is* what its knots define: u* between the inputs at knots (held, or linear), x* the cubic pieces whose slopes at
their ends are f(x*) + B(x*) u*. Nothing is believed of how the knots were found: that the inputs lead along the states
is no premise, because what they miss by is the defect, which is bounded for this very curve. So of a planner's knots
only what the task promises is left to examine: start, horizon, and with a goal the target. Input limits are no claim.
"""

from __future__ import annotations

from fractions import Fraction

from tubecert.recheck.balls import Ball, exact, length
from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import CONFIRMED, stated
from tubecert.recheck.plans import Plan
from tubecert.recheck.specified.trajectory import Planned

_MISS = Fraction(1, 1000)  # of 1 + |target|: how far from its target a planned curve may end


def serves(task: Planned, plan: Plan) -> Outcome:
    """The knots begin at the start, end at the horizon, and there, if that is the goal, at the target."""
    knots = plan.knots
    assert knots is not None
    if knots.x[0] != task.start:
        return stated(False, "it does not begin at trajectory.start")
    if knots.t[-1] != task.horizon:
        return stated(False, "its last knot is not at the horizon")
    if not task.goal:
        return CONFIRMED
    missed = _distance(knots.x[-1], task.target)
    allowed = exact(_MISS) * (1 + _distance(task.target, (Fraction(0),) * len(task.target)))
    return stated(bool(missed <= allowed), f"it ends {float(missed.mid()):.6g} away from its target")


def _distance(a: tuple[Fraction, ...], b: tuple[Fraction, ...]) -> Ball:
    return length([exact(x - y) for x, y in zip(a, b, strict=True)])

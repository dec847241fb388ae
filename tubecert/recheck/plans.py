"""The plan as a certificate holds it: its kind, its knots; and that it is the plan its task asks for.

A plan *is* what its knots define: u* between the inputs at knots (held, or linear), x* the cubic pieces whose slopes at
their ends are f(x*) + B(x*) u*. Nothing is believed of how the knots were found: that the inputs lead along the states
is no premise, because what they miss by is the defect, which is bounded for this very curve. So of a planner's knots
only what the task promises is left to examine: start, horizon, and with a goal the target. Input limits are no claim.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.balls import Ball, exact, length
from tubecert.recheck.cover import CONFIRMED, Outcome, stated
from tubecert.recheck.curve import Knots
from tubecert.recheck.document import Members, Node, may, one_of, reads
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Planned, Resting, Tabled


@dataclass(frozen=True, slots=True)
class Plan:
    """The plan as it was certified: `interpolation` is None where a certification ended before there was one."""

    kind: str = reads(Node.text)
    interpolation: str | None = may(one_of("exact", "hold", "linear", "hermite-simpson"))
    curve: str | None = may(Node.text)
    knots: Knots | None = None
    file: str | None = may(Node.text)
    file_hash: str | None = may(Node.text)


def read_plan(node: Node, specification: Specification) -> Plan:
    """`result.plan`; the members that it has depend on the kind of trajectory."""
    n, m = len(specification.plant.states), len(specification.plant.inputs)
    optional = ["interpolation"]
    if not isinstance(specification.trajectory, (Resting, Expressed, AnyPlan)):
        optional += ["curve", "knots"]
    if isinstance(specification.trajectory, Tabled):
        optional += ["file", "file_hash"]
    own = node.closed("kind", optional=optional)
    if "interpolation" in own:
        own.require(*optional)
    return node.record(Plan, knots=lambda item: read_knots(item.closed("t", "x", "u"), n, m, Node.exact))


def read_knots(own: Members, n: int, m: int, how: Callable[[Node], Fraction]) -> Knots:
    """`t`, `x` and `u` of an object, row by row; what lies between is not known yet."""
    t = tuple(map(how, own["t"].entries()))
    x, u = (
        tuple(tuple(map(how, row)) for row in own[key].rows(len(t), size))
        for key, size in (("x", n), ("u", m))
    )
    return Knots(t=t, x=x, u=u)


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

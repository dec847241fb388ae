"""Whether the tube lies in the safe set: assumption 1, decided state by state along the plan. Trusted: yes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.pencil import scalar
from tubecert.trajectory import Plan
from tubecert.trajectory.hermite import ends_of_pieces
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Containment:
    """Whether the tube lies in the safe set (assumption 1): certified, refuted with place and time, or undecided.

    `outside`: so does the plan itself not, by `excess`; else the tube is too wide by it, and has `room`. Both are exact
    bounds, from below.
    """

    verdict: Verdict = Verdict.UNDECIDED
    state: str = ""
    side: str = ""
    t: float = 0.0
    x: tuple[float, ...] = ()
    excess: Fraction = Fraction(0)
    room: Fraction = Fraction(0)
    outside: bool = False


def containment(
    plan: Plan,
    sides: Fraction | Sequence[Fraction],
    states: tuple[str, ...],
    safe_set: tuple[tuple[Fraction, Fraction], ...],
    effort: Effort,
) -> Containment:
    """Decide assumption 1: x*_i(t) is at least sides_i away from both faces of the safe set, for all i and t.

    One number stands for all sides: the radius of a ball.
    """
    sides = (sides,) * len(states) if isinstance(sides, Fraction) else tuple(sides)
    if not plan.defined:
        return _knots_outside(plan, states, safe_set)
    undecided: Containment | None = None
    worst: Containment | None = None
    for i, (name, radius, (lowest, highest)) in enumerate(zip(states, sides, safe_set, strict=True)):
        for side, sign, limit in (("upper", 1, highest), ("lower", -1, -lowest)):
            exact = plan.x[i]
            if exact.is_constant:
                low = high = sign * exact.fraction
                t = 0.0
            else:
                width = 1e-7 * float(highest - lowest)
                # relative to the limit that is the same; to a curve far beyond it, it is all that matters
                fine = Effort(
                    gap=width / float(max(abs(highest), abs(lowest))), absolute=width, budget=effort.budget
                )
                found = supremum(scalar(sign * exact, plan.fixed), plan.domain, fine)
                t = plan.moment(found.at) or 0.0
                # what is not bounded is undecided
                low = Fraction(found.below) if np.isfinite(found.below) else limit - radius - 1
                high = Fraction(found.above) if np.isfinite(found.above) else limit + 1
            if high + radius <= limit:
                continue
            here, _ = plan.enclose(np.array([t]), np.array([t]))
            place = here.mid[0].copy()
            if plan.allowance is not None:  # the member that comes nearest
                place[i] = sign * float(low)
            outside = low > limit
            if not outside:
                place[i] += sign * float(radius)
            case = Containment(
                verdict=Verdict.REFUTED if low + radius > limit else Verdict.UNDECIDED,
                state=name,
                side=side,
                t=t,
                x=tuple(float(value) for value in place),
                excess=low - limit if outside else low + radius - limit,
                room=limit - high,
                outside=outside,
            )
            if case.verdict is Verdict.REFUTED and (worst is None or case.excess > worst.excess):
                worst = case
            elif case.verdict is Verdict.UNDECIDED:
                undecided = case
    return worst or undecided or Containment(verdict=Verdict.CERTIFIED)


def _knots_outside(
    plan: Plan, states: tuple[str, ...], safe_set: tuple[tuple[Fraction, Fraction], ...]
) -> Containment:
    """The knot that is farthest outside, for a curve whose slopes are not defined everywhere.

    Inside the safe set they are, so that a knot outside is to be expected. Knots beyond the horizon shape the last
    piece only: the curve need not reach them.
    """
    worst = Containment()
    knots = None if plan.knots is None else ends_of_pieces(plan.knots)
    reached = zip(knots.t, knots.x, strict=True) if knots else ()
    for t, x in reached:
        if plan.horizon is not None and t > plan.horizon:
            break
        for name, value, (lowest, highest) in zip(states, x, safe_set, strict=True):
            for side, excess in (("upper", value - highest), ("lower", lowest - value)):
                if excess > worst.excess:
                    worst = Containment(
                        verdict=Verdict.REFUTED,
                        state=name,
                        side=side,
                        t=float(t),
                        x=tuple(float(value) for value in x),
                        excess=excess,
                        outside=True,
                    )
    return worst

"""What a result claims, in words: its time, its plans, its radius, points."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.certificate.result import Plans, Result
from tubecert.digits import short
from tubecert.enclosure.constant import Witness


def span(result: Result) -> str:
    """The time that is claimed."""
    end = horizon(result)
    return "for all t >= 0" if end is None else f"for 0 <= t <= {short(end, 12)} s"


def plan_words(result: Result) -> str:
    """What the state stays close to."""
    return "the plan" if result.claim.plans is None else "every plan of the family"


def family_words(plans: Plans) -> str:
    """Which plans belong to a family."""
    sides = [*((f"{name}*", ends) for box in (plans.x, plans.u) for name, ends in box.items())]
    boxes = ", ".join(f"{name} in [{low}, {high}]" for name, (low, high) in sides)
    return f"{boxes}; |x*' - f(x*) - B(x*) u*| <= {plans.defect}"


def horizon(result: Result) -> Fraction | None:
    """The end of the plan in s, None if it has none."""
    return result.spec.effective.trajectory.horizon


def radius(result: Result) -> Fraction | None:
    """The radius of the tube, None if there is none."""
    return None if result.tube is None else result.tube.rho


def point(result: Result, at: Witness) -> str:
    """A witness: `t = 0.2 s, x1 = 0.1, ...`."""
    return place(result.spec.effective.system.states, at)


def place(states: Sequence[str], at: Witness) -> str:
    """The same for any states."""
    parts = [] if at.t is None else [f"t = {short(at.t, 6)} s"]
    parts += [f"{name} = {short(value, 6)}" for name, value in zip(states, at.x, strict=False)]
    return ", ".join(parts)

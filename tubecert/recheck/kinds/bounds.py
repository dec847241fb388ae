"""Printed numbers against what is proven here: each on the side that is claimed."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.conditions import DistanceProof, Gains, Setting, distance_bound
from tubecert.recheck.cover import CONFIRMED, Outcome, stated
from tubecert.recheck.document import Enclosure


def all_of(outcomes: Iterable[Outcome]) -> Outcome:
    """The first that is not confirmed."""
    return next((item for item in outcomes if not item.holds), CONFIRMED)


def margin_at_least(value: Ball, printed: Enclosure, what: str) -> Outcome:
    """A margin: proven to be at least the lower end that is printed, which is positive."""
    below = printed.below
    if below is None or below <= 0:
        return stated(False, f"the printed margin of {what} is not positive")
    if not printed.is_interval:
        return stated(False, f"the printed margin of {what} is not an interval")
    return at_least(value, below, what)


def at_least(value: Ball, below: Fraction, what: str) -> Outcome:
    """A margin that is at least this."""
    if value >= exact(below):
        return CONFIRMED
    if not value.is_finite():
        return Outcome(verdict="contradicted", why=f"the condition on {what} does not hold at these numbers")
    return Outcome(
        verdict="contradicted" if value < exact(below) else "undecided",
        why=f"the margin of {what} is {float(value.lower()):.6g}, not {float(below):.6g}",
    )


def told(value: Ball, printed: Enclosure, what: str) -> Outcome:
    """A margin of what is not certified for another reason: an interval, and proven to be at least its lower end."""
    if not printed.is_interval:
        return stated(False, f"the printed margin of {what} is not an interval")
    return CONFIRMED if printed.below is None else at_least(value, printed.below, what)


def at_most(value: Ball, printed: Fraction, what: str) -> Outcome:
    """A number that is at most this."""
    if value <= exact(printed):
        return CONFIRMED
    verdict = "contradicted" if value > exact(printed) or not value.is_finite() else "undecided"
    return Outcome(
        verdict=verdict,  # type: ignore[arg-type]
        why=f"{what} is {float(value.upper()):.12g}, more than {float(printed):.12g}",
    )


def ultimate(radius: Fraction, setting: Setting, gains: Gains, proof: DistanceProof) -> Outcome:
    """|x - x*| is at most `radius` in the long run, by theorem B."""
    bound = distance_bound(setting, gains, proof)
    if bound is None or not bound.supremum() < setting.reach:
        return Outcome(verdict="undecided", why="theorem B could not be shown at these gains")
    return at_most(bound.ultimate() / root(setting.n.lower), radius, "the ultimate radius")


def not_shown_to_hold(margins: Iterable[Enclosure]) -> Outcome:
    """Gains that are not certified: their margins do not say that every condition holds."""
    ends = [margin.below for margin in margins]
    holds = any(below is None or below <= 0 for below in ends)
    return stated(holds, "by its margins it holds, and yet it is not certified")


def no_radius() -> Outcome:
    """A radius in the long run is one of what is certified."""
    return stated(False, "a radius is stated of a tube that is not certified")


def words(at: Gains) -> str:
    """Gains, to name a claim by."""
    return f"omega = {float(at.bandwidth):.6g}, Gamma = {float(at.adaptation_rate):.6g}"

"""How far each input can go: u* on the plan, and what feedback and adaptation add to it. Trusted.

|u_i - u*_i| <= du D + R, where d(x*, x) <= D by the theorem and R bounds what the loop adapts by. Implements: theory
section 4d.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite

from tubecert.conditions.problem import Numbers
from tubecert.enclosure.constant import Constant, Witness, printable_above, printable_below
from tubecert.enclosure.interval import Interval
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class InputShares:
    """What is added to u* at most, in any one input: by the feedback, and by the adaptation."""

    feedback: float
    adaptation: float


def shares(n: Numbers[Interval], distance: Interval, radius: Fraction | None) -> InputShares | None:
    """du D for d(x*, x) <= `distance`, and the radius of the projection; None if du has no bound (4.13).

    The radius is None for a loop that does not adapt.
    """
    nothing = bool(n.du.hi <= 0)  # a product of 0 is rounded up from it
    feedback = 0.0 if nothing else float((n.du * distance).hi)
    if not isfinite(feedback):
        return None
    adaptation = 0.0 if radius is None else printable_above(radius)
    return InputShares(feedback=printable_above(feedback), adaptation=adaptation)


@dataclass(frozen=True, slots=True, kw_only=True)
class InputBound:
    """The input stays in [least, greatest] with the gains of a proof; what feedback and adaptation add at most."""

    least: float
    greatest: float
    feedback: float
    adaptation: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitedInput:
    """An input with limits; `least` and `greatest` enclose inf u* and sup u* on the plan, in printable numbers.

    `any_plan`: they are those of a family, or of a planner: a plan need not reach them.
    """

    name: str
    limits: tuple[Fraction, Fraction]
    least: Constant
    greatest: Constant
    any_plan: bool

    def bound(self, own: InputShares | None) -> InputBound | None:
        """What the input does in the loop, if the shares are known and u* is bounded, (4.13)."""
        low, high = self.least.below, self.greatest.above
        if own is None or not (isfinite(low) and isfinite(high)):
            return None
        added = Fraction(own.feedback) + Fraction(own.adaptation)
        return InputBound(
            least=printable_below(Fraction(low) - added),
            greatest=printable_above(Fraction(high) + added),
            feedback=own.feedback,
            adaptation=own.adaptation,
        )

    def holds(self, bound: InputBound) -> bool:
        """Whether a bound lies within the limits."""
        low, high = self.limits
        return low <= Fraction(bound.least) and Fraction(bound.greatest) <= high

    @property
    def leaves(self) -> Witness | None:
        """Where the plan's own input is proven to be beyond a limit."""
        low, high = self.limits
        if self.any_plan:
            return None
        if self.greatest.below > high:
            return self.greatest.at or Witness()
        return self.least.at or Witness() if self.least.above < low else None

    def verdict(self, bounds: Sequence[InputBound | None]) -> Verdict:
        """On the limits, from the bounds by every theorem that decides."""
        if self.leaves is not None:
            return Verdict.REFUTED
        proven = bool(bounds) and all(bound is not None and self.holds(bound) for bound in bounds)
        return Verdict.CERTIFIED if proven else Verdict.UNDECIDED

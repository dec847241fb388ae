"""Claims about what the loop keeps to: obstacles and the limits of its inputs."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.claims.bounds import reached
from tubecert.claims.family import Claim, Reason, Side
from tubecert.digits import near
from tubecert.enclosure.constant import Constant
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleCleared(Claim):
    """The tube stays clear of obstacle number `obstacle` (from 1); `clearance` encloses by how much."""

    obstacle: int
    clearance: Constant

    def _title(self) -> str:
        return f"clearance from obstacle {self.obstacle}"

    def _why(self, reason: Reason) -> str:
        low, high = self.clearance.below, self.clearance.above
        if reason.verdict is Verdict.REFUTED:
            return "the tube contains a point of the obstacle"
        told = (
            f"the tube keeps away from it by {near(low, 4)} at least" if low > 0 else "the tube may meet it"
        )
        return f"{told}; at its nearest by {near(high, 4)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWithinLimits(Claim):
    """An input of the plan and of the loop stays within its limits; on `side` it may reach `reaches`, beyond `limit`.

    `plan` is what u* itself reaches there: at least, where it is beyond the limit, else at most. `feedback` and
    `adaptation` add to it at most, by the theorem of `section`; without them nothing is known of the loop.
    """

    input: str
    side: Side
    limit: Fraction
    plan: float | None
    section: str | None = None
    reaches: float | None = None
    feedback: float | None = None
    adaptation: float | None = None

    def _title(self) -> str:
        return input_title(self.input)

    def _why(self, reason: Reason) -> str:
        beyond = f"{'below' if self.side == 'lower' else 'above'} {near(self.limit)}"
        if reason.verdict is Verdict.REFUTED:
            return f"the plan itself has {self.input}* = {reached(self.plan)}, {beyond}"
        if self.reaches is None or self.feedback is None or self.adaptation is None:
            return "no bound of it could be proven"
        added = f"feedback may add {near(self.feedback, 4)}"
        if self.adaptation:
            added += f" and adaptation {near(self.adaptation, 4)}"
        planned = f"{self.input}* reaches {reached(self.plan)}"
        return f"it may reach {near(self.reaches)}, {beyond}: {planned}, to which {added}"


def input_title(name: str) -> str:
    """What the claim is called that an input stays within its limits."""
    return f"limits of {name}"

"""Claims about what the loop keeps to: obstacles and the limits of its inputs."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from tubecert.claims.family import Claim, Side
from tubecert.enclosure.constant import Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class ObstacleCleared(Claim):
    """The tube stays clear of obstacle number `obstacle` (from 1); `clearance` encloses by how much."""

    tag: ClassVar[str] = "obstacle_cleared"
    obstacle: int
    clearance: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWithinLimits(Claim):
    """An input of the plan and of the loop stays within its limits; on `side` it may reach `reaches`, beyond `limit`.

    `plan` is what u* itself reaches there: at least, where it is beyond the limit, else at most. `feedback` and
    `adaptation` add to it at most, by the theorem of `section`; without them nothing is known of the loop.
    """

    tag: ClassVar[str] = "input_within_limits"
    input: str
    side: Side
    limit: Fraction
    plan: float | None
    section: str | None = None
    reaches: float | None = None
    feedback: float | None = None
    adaptation: float | None = None

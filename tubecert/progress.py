"""How far a command is: the one record that every callback of progress is given.

In: nothing. Out: `Step`. Nothing that is computed depends on it; sentences are made in `words/progress`. Trusted: yes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

__all__ = ["Phase", "Progress", "Step", "Unit"]


class Phase(StrEnum):
    """What a command is at. Its `done` and `of` count what stands behind it."""

    CERTIFICATION = "certification"  # claims
    PLAN = "plan"  # claims: the planner works for a certification
    GAINS = "gains"  # claims
    LOOP = "loop"  # no count: a sampled loop is designed and proven
    SYNTHESIS = "synthesis"  # no count
    VERIFICATION = "verification"  # metrics
    CHECK = "check"  # files
    SWEEP = "sweep"  # points
    SIMULATION = "simulation"  # runs
    FIGURES = "figures"  # no count
    RECHECK = "recheck"  # claims


class Unit(StrEnum):
    """What a search counts."""

    BOXES = "boxes"
    KNOTS = "knots"
    PIECES = "pieces"
    STEPS = "steps"


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """Progress: what is worked on now, how far it is, and how far the whole is.

    `name`: of what is worked on: a constant, a claim, a file, a controller. `count`: what the search for it has
    examined, in `unit`s, and `share` how much of it is proven (0 where nobody knows); what it searches, which may be
    that constant in other units or its inverse, is proven to lie between `below` and `above`. `done` of `of` pieces of
    the whole phase are finished; None if nobody knows how many there are. `seconds` since the call began; `left`: an
    estimate of the seconds until the phase is done, if those to come are like those before; None where there is nothing
    to go by. `least`: it is without the piece that is worked on, which takes longer than those before it.
    """

    phase: Phase
    name: str = ""
    count: int = 0
    unit: Unit = Unit.BOXES
    share: float = 0.0
    below: float = -math.inf
    above: float = math.inf
    done: int = 0
    of: int | None = None
    seconds: float = 0.0
    left: float | None = None
    least: bool = False


Progress = Callable[[Step], None]

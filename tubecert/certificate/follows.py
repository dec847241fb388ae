"""What follows from the tube, as a certificate tells it: its shape, clearances, inputs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from tubecert.enclosure.constant import Constant
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class ShapeData:
    """Bounds over the tube of the block of W in a plane: of its diagonal, and [low, high] of what is beside it."""

    diagonal: tuple[float, float]
    beside: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceData:
    """An obstacle of the specification, in its order: the clearance of the tube, and the time at which it is least.

    `inside`: a point of the obstacle that the tube contains then.
    """

    verdict: Verdict
    decides: bool
    clearance: Constant
    shape: ShapeData
    t: float | None = None
    inside: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanInputData:
    """Enclosures of inf u* and of sup u* on the plan, of one input."""

    least: Constant
    greatest: Constant


@dataclass(frozen=True, slots=True, kw_only=True)
class InputBoundData:
    """The input stays in [least, greatest] with the gains in `proof`; what feedback and adaptation add at most."""

    least: float
    greatest: float
    feedback: float
    adaptation: float


@dataclass(frozen=True, slots=True, kw_only=True)
class InputData:
    """An input with limits: what it does on the plan, and in the loop of every kind that is certified, by its key."""

    input: str
    limits: tuple[Fraction, Fraction]
    verdict: Verdict
    plan: PlanInputData
    bounds: Mapping[str, InputBoundData]

    def use(self, kinds: Iterable[str]) -> float | None:
        """The share of its limits that it uses at most: 0 in the middle, 1 at a limit; None without bounds."""
        found = [self.bounds[key] for key in kinds if key in self.bounds]
        low, high = self.limits
        ends = [end for bound in found for end in (bound.least, bound.greatest)]
        return max((float(abs(2 * Fraction(end) - low - high) / (high - low)) for end in ends), default=None)

"""A number known by bounds proven from both sides, and where it is attained."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Witness:
    """Where the value proven from below is attained: time in s (if it matters) and state, shape (n,)."""

    t: float | None = None
    x: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Constant:
    """A supremum (or infimum) enclosed: proven to lie in [below, above]."""

    below: float
    above: float
    at: Witness | None = None

    def __post_init__(self) -> None:
        if not self.below <= self.above:  # NaN fails too
            raise ValueError(f"empty enclosure [{self.below}, {self.above}]")

    @staticmethod
    def exactly(value: float) -> Constant:
        """A value known exactly."""
        return Constant(below=value, above=value)

    @property
    def gap(self) -> float:
        """Relative width (above - below)/|above|; 0 for an exact value."""
        return 0.0 if self.above == self.below else (self.above - self.below) / abs(self.above)

"""What campaigns tell of their runs: how far these went, what they broke, how near they came to obstacles.

Records of `summary.json` as they are: runs by their numbers, times in s, None for what is no number or is not known.
Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class RunAt:
    """A run at a time."""

    run: int
    t: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopped(RunAt):
    """A run that ended early, and why."""

    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Peak(RunAt):
    """The largest value of a quantity over some runs, its bound, and the value as a share of that."""

    value: float
    bound: float | None
    share: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation(Peak):
    """A bound that a run broke: `of` what; `aimed`: what an adversary wanted, where it wanted one quantity."""

    of: str
    aimed: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Went:
    """Where an input was in some runs, and where it is proven to stay, if that is."""

    least: float
    greatest: float
    proven: tuple[float, float] | None

    def joined(self, other: Went) -> Went:
        """Over the runs of both."""
        least, greatest = min(self.least, other.least), max(self.greatest, other.greatest)
        return Went(least=least, greatest=greatest, proven=self.proven or other.proven)


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """The least distance to an obstacle (negative: by how much it is entered), and where it was met.

    `run` is None for what is no run: a plan, a tube.
    """

    clearance: float | None
    t: float | None
    collides: bool
    run: int | None = None

"""Verdicts about margins, and what is missing where a claim does not hold, as data."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tubecert.enclosure.interval import Interval


class Verdict(StrEnum):
    """Three values; undecided is never shown as either of the others."""

    CERTIFIED = "certified"
    REFUTED = "refuted"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True, kw_only=True)
class Shortfall:
    """A claim that is not proven: its margin (relative to what is allowed), both sides where known.

    `claim` is "26a", "26b", "26c", "distance", "sampled" at gains asked for; "26a", "dbar <= d0", "dbar <=
    delta/lambda" where no gains can help; "unbounded: NAME" where a constant has no finite bound;
    "as-printed" where the formulas themselves prove nothing; "nothing found" where the search failed.
    """

    claim: str
    margin: Interval
    allowed: float | None = None
    needed: float | None = None

    @property
    def missing(self) -> float | None:
        """By how much more is needed than allowed, where both are known."""
        return None if self.allowed is None or self.needed is None else self.needed - self.allowed


def verdict(margins: Iterable[Interval]) -> Verdict:
    """Certified if every margin is proven positive, refuted if one is proven not to be, else undecided."""
    values = list(margins)
    if all(margin.lo > 0 for margin in values):
        return Verdict.CERTIFIED
    return Verdict.REFUTED if any(margin.hi <= 0 for margin in values) else Verdict.UNDECIDED


UNKNOWN = Interval(-np.inf, np.inf)

NOTHING_FOUND = (Shortfall(claim="nothing found", margin=UNKNOWN),)


def unbounded(names: Iterable[str]) -> tuple[Shortfall, ...]:
    """One reason per constant without a finite bound: nothing follows from it, either way."""
    return tuple(Shortfall(claim=f"unbounded: {name}", margin=UNKNOWN) for name in names)

"""Verdicts about margins, and what is missing where a claim does not hold, as data."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from tubecert.enclosure.interval import Interval
from tubecert.verdict import Verdict

__all__ = ["NOTHING_FOUND", "UNKNOWN", "Shortfall", "Verdict", "unbounded"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Shortfall:
    """A claim that is not proven: its margin (relative to what is allowed), both sides where known.

    `claim` is `26a`, `26b`, `26c`, `distance` at gains asked for; `26a`, `initial_distance`, `plan_defect`,
    `parameters`, `wind` where no gains can help; `wind_not_covered` where nothing follows for a wind;
    `gain_not_covered` where nothing follows for an uncertain B; `bounded` where `constant` has no finite bound;
    `proven_gains` where the search failed (see `ConditionHolds`).
    """

    claim: str
    margin: Interval
    constant: str | None = None
    allowed: float | None = None
    needed: float | None = None

    @property
    def missing(self) -> float | None:
        """By how much more is needed than allowed, where both are known."""
        return None if self.allowed is None or self.needed is None else self.needed - self.allowed


UNKNOWN = Interval(-np.inf, np.inf)

NOTHING_FOUND = (Shortfall(claim="proven_gains", margin=UNKNOWN),)


def unbounded(names: Iterable[str]) -> tuple[Shortfall, ...]:
    """One reason per constant without a finite bound: nothing follows from it, either way."""
    return tuple(Shortfall(claim="bounded", constant=name, margin=UNKNOWN) for name in names)

"""A plan for a part of its time. Trusted: yes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property

import numpy as np

from tubecert.enclosure.domain import Range
from tubecert.enclosure.interval import fraction_bounds
from tubecert.model import TIME
from tubecert.trajectory.hermite import Pieces
from tubecert.trajectory.pieces import PiecewisePlan
from tubecert.trajectory.plan import Plan


@dataclass(frozen=True)
class PartOfPlan(Plan):
    """A plan in expressions of t, from `since` to its horizon."""

    since: Fraction

    @cached_property
    def time(self) -> dict[str, Range]:
        """The range of t; empty for a constant plan."""
        return {} if self.is_constant or self.horizon is None else {TIME: (self.since, self.horizon)}


@dataclass(frozen=True)
class SomePieces(PiecewisePlan):
    """The pieces of a plan that meet a part of its time, which begins `since`."""

    since: Fraction

    @cached_property
    def time(self) -> dict[str, Range]:
        """The range of t; empty for a constant plan."""
        return {} if self.is_constant or self.horizon is None else {TIME: (self.since, self.horizon)}


def during(plan: Plan, since: Fraction, until: Fraction) -> Plan:
    """The plan from `since` to `until`, in s; of one through knots, every piece that meets that part.

    What only depends on the plan is then bounded over whole pieces, which is a bound for the part.
    Raises `ValueError` for plans that are not known, or have no end.
    """
    if plan.horizon is None or plan.allowance is not None or not 0 <= since < until <= plan.horizon:
        raise ValueError("there is no such part of the plan")
    if isinstance(plan, PiecewisePlan):
        return SomePieces(plan.x, plan.u, until, plan.data, _meeting(plan.pieces, since, until), since)
    return PartOfPlan(plan.x, plan.u, until, since)


def _meeting(pieces: Pieces, since: Fraction, until: Fraction) -> Pieces:
    low, high = fraction_bounds(since)[0], fraction_bounds(until)[1]
    kept = np.flatnonzero((pieces.end.hi >= low) & (pieces.start.lo <= high))
    return replace(
        pieces,
        start=pieces.start[kept],
        end=pieces.end[kept],
        length=pieces.length[kept],
        x=pieces.x[kept],
        u=pieces.u[kept],
    )

"""Plans that are given up for new ones on the way: what a planner makes of a family.

A new plan starts where the old one is at that moment, x*_new(T) = x*_old(T); its u* may be any other, so u* jumps.
Together they are one plan of the family: x* is continuous, and boxes and defect are kept to at almost all times.
Untrusted, like the plans that it is made of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import accumulate

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.expression import Expression
from tubecert.spec import Knots
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import PiecewisePlan


@dataclass(frozen=True)
class Replanned(Plan):
    """Plans one after the other, each in times of its own from 0 to its horizon; `since`: when each is taken, in s."""

    parts: tuple[PiecewisePlan, ...]
    since: tuple[Fraction, ...]

    @cached_property
    def start(self) -> tuple[Expression, ...]:
        """x*(0), of the first part."""
        return self.parts[0].start

    @property
    def spans(self) -> Interval:
        """The times of the parts, (K,): between them u* jumps."""
        begin = np.array([float(t) for t in self.since])
        return Interval(begin, np.append(begin[1:], float(self.horizon or 0)))

    @property
    def knots(self) -> Knots:
        """Those that are reached; at a switch that of the new plan."""
        found = []
        for part, begin in zip(self.parts, self.since, strict=True):
            rows = zip(part.data.t, part.data.x, part.data.u, strict=True)
            last = part is self.parts[-1]
            found += [(begin + t, x, u) for t, x, u in rows if last or t < (part.horizon or 0)]
        t, x, u = zip(*found, strict=True)
        return Knots(t=t, x=x, u=u, interpolation=self.parts[0].data.interpolation)

    def enclose(self, lo: Array, hi: Array, span: Array | None = None) -> tuple[Interval, Interval]:
        """x* (N, n) and u* (N, m) over windows of time that lie in one part each, in that of `span` if it is given."""
        begin = self.spans.lo
        which = np.searchsorted(begin, lo, side="right") - 1 if span is None else np.rint(span)
        x, u = (Interval(np.empty((len(lo), len(e))), np.empty((len(lo), len(e)))) for e in (self.x, self.u))
        for number, part in enumerate(self.parts):
            rows = which == number
            own = part.enclose(lo[rows] - begin[number], hi[rows] - begin[number])
            for whole, found in zip((x, u), own, strict=True):
                whole.lo[rows], whole.hi[rows] = found.lo, found.hi
        return x, u


def joined(parts: Sequence[PiecewisePlan]) -> Replanned:
    """The parts one after the other."""
    ends = list(accumulate(Fraction(part.horizon or 0) for part in parts))
    return Replanned(parts[0].x, parts[0].u, ends[-1], tuple(parts), (Fraction(0), *ends[:-1]))

"""Every plan at once: all curves whose x* stays in a box P, whose u* stays in a box U, and whose defect is small.

Nothing else is known of such a plan, so a supremum along it is a supremum over P and U, and O(rho) is the set of all
states within rho of P. Sound for each member, because no constant contains x*' but in the defect, which is limited.
Implements: theory 4.7. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from tubecert.enclosure.domain import BoxDomain, Domain, Range
from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.expression import Expression, constant, symbol
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel
from tubecert.trajectory.plan import Plan

Ranges = tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True)
class Family(Plan):
    """x*, shape (n,), anywhere in `P`, u*, shape (m,), anywhere in `U`, and |x*' - f(x*) - B(x*) u*| <= `limit`.

    `names` are those of states and inputs; x and u are variables of their own, see `starred`.
    """

    names: tuple[str, ...]
    P: Ranges
    U: Ranges
    limit: Fraction

    @cached_property
    def is_constant(self) -> bool:
        """Nothing depends on t."""
        return True

    @property
    def allowance(self) -> Fraction:
        """The limit of the defect."""
        return self.limit

    @cached_property
    def start(self) -> tuple[Expression, ...]:
        """No start of its own; raises `ValueError`."""
        raise ValueError("a family of plans has no start of its own")

    @property
    def at_start(self) -> Plan:
        """Plans of the family start anywhere in P."""
        return self

    @cached_property
    def slope(self) -> tuple[Expression, ...]:
        """Not known; raises `ValueError`."""
        raise ValueError("the slopes of a family of plans are not known")

    @cached_property
    def domain(self) -> Domain:
        """P and U."""
        return BoxDomain(self._ranges)

    @cached_property
    def ranges(self) -> dict[str, Range]:
        """U by variable: u* is free of x* and of time."""
        inputs = [starred(name) for name in self.names[len(self.x) :]]
        return {name: self._ranges[name] for name in inputs}

    @cached_property
    def _ranges(self) -> dict[str, Range]:
        return dict(zip(map(starred, self.names), (*self.P, *self.U), strict=True))

    def enclose(self, lo: Array, hi: Array, span: Array | None = None) -> tuple[Interval, Interval]:
        """P (N, n) and U (N, m), whatever the windows [lo, hi] of time, each of shape (N,)."""
        del hi, span
        sides = np.array([(fraction_bounds(a)[0], fraction_bounds(b)[1]) for a, b in (*self.P, *self.U)]).T
        both = Interval(*(np.repeat(side[None], len(lo), axis=0) for side in sides))
        return both[:, : len(self.x)], both[:, len(self.x) :]

    def near(self, x: Interval, columns: Sequence[int], points: Array) -> Interval:
        """The nearest point of P, shape of `points`; where no float lies in a range of P, that range."""
        inner = np.array([(fraction_bounds(a)[1], fraction_bounds(b)[0]) for a, b in self.P])[list(columns)]
        low, high = inner[:, 0], inner[:, 1]
        moved, whole = np.clip(points, low, high), x[:, list(columns)]
        return Interval(np.where(low <= high, moved, whole.lo), np.where(low <= high, moved, whole.hi))

    def defect(self, model: ControlAffineModel) -> Matrix:
        """Not known; raises `ValueError`."""
        raise ValueError("the defects of a family of plans are not known")


def starred(name: str) -> str:
    """The variable for a state or an input on the plan; no name has a star."""
    return f"{name}*"


def family(
    states: Sequence[str],
    inputs: Sequence[str],
    boxes: tuple[Ranges, Ranges],
    limit: Fraction,
    horizon: Fraction | None,
) -> Family:
    """The plans in the boxes (P, U) over [0, horizon], or for ever."""
    P, U = boxes
    x, u = (
        tuple(
            constant(low) if low == high else symbol(starred(name))
            for name, (low, high) in zip(names, box, strict=True)
        )
        for names, box in ((states, P), (inputs, U))
    )
    return Family(x, u, horizon, (*states, *inputs), P, U, limit)

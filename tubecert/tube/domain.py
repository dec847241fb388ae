"""The tube as a domain that classifies boxes.

Time is a coordinate of the search. Within a window the plan lies in a box P; a state box X is cut to the ranges that a
point of a section around P can have given the gaps between X and P in the other coordinates. No cover of the tube by
boxes is ever fixed: a boxed ball would be up to sqrt(n) too wide.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.objective import Estimate
from tubecert.enclosure.outward import down, up
from tubecert.expression import free_symbols
from tubecert.model import TIME
from tubecert.trajectory import Plan
from tubecert.trajectory.plan import PIECE
from tubecert.tube.sections import Ball, Section

_WINDOWS = 64


class Tube:
    """O(rho) as a `Domain` over states, inputs (standing for u*(t)), time, and further independent ranges.

    `section` is what it is at one time; a number stands for the ball of that radius.
    """

    def __init__(
        self,
        plan: Plan,
        section: float | Section,
        *,
        states: tuple[str, ...],
        inputs: tuple[str, ...],
        time: Range | None,
        extra: dict[str, Range] | None = None,
    ) -> None:
        self._plan = plan
        self.section = Ball(section) if isinstance(section, (int, float)) else section
        self._states, self._inputs = states, inputs
        self._free = BoxDomain({**({} if time is None else {TIME: time}), **(extra or {})})
        self._resting: tuple[Interval, Interval] | None = None  # x* and u* where the plan does not move
        # what was asked for last, of moments and of windows
        self._last: dict[bool, tuple[tuple[Array, Array], tuple[Interval, Interval]]] = {}

    def variables(self, needed: tuple[str, ...]) -> tuple[str, ...]:
        """The needed variables, time if the plan moves in them, and the piece of the plan if several inputs jump.

        (One input at a jump may be searched as the range between its two sides: no convex objective is larger there.)
        """
        if not self._moves(needed):
            return needed
        jumping = self._plan.spans is not None and sum(v in self._inputs for v in needed) > 1
        return (*needed, *([] if TIME in needed else [TIME]), *([PIECE] if jumping else []))

    def _moves(self, needed: tuple[str, ...]) -> bool:
        """Whether the plan moves in the needed variables: a ball projected to others is a ball that stays."""
        if self._plan.is_constant:
            return False
        curves = zip((*self._states, *self._inputs), (*self._plan.x, *self._plan.u), strict=True)
        return bool(free_symbols([curve for name, curve in curves if name in needed]))

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """Boxes around the plan: one for every piece of it, or for every window of time if there are inputs.

        These are known through time only; states and inputs are unbounded at first.
        """
        others, spans = self._others(variables), self._plan.spans if PIECE in variables else None
        windows = _WINDOWS if TIME in others and any(v in self._inputs for v in variables) else 1
        count = windows if spans is None else len(spans.lo)
        free_lo, free_hi = (np.repeat(end, count, axis=0) for end in self._free.boxes(others))
        if TIME in others:
            column = others.index(TIME)
            edges = np.linspace(free_lo[0, column], free_hi[0, column], windows + 1)
            early, late = (edges[:-1], edges[1:]) if spans is None else (spans.lo, spans.hi)
            free_lo[:, column] = np.maximum(free_lo[:, column], early)
            free_hi[:, column] = np.minimum(free_hi[:, column], late)
        lo, hi = np.full((count, len(variables)), -np.inf), np.full((count, len(variables)), np.inf)
        own = [variables.index(name) for name in others]
        lo[:, own], hi[:, own] = free_lo, free_hi
        if spans is not None:
            lo[:, variables.index(PIECE)] = hi[:, variables.index(PIECE)] = np.arange(count)
        lo, hi, _ = self.contract(variables, lo, hi)
        return lo, hi

    def _others(self, variables: tuple[str, ...]) -> tuple[str, ...]:
        """Time and what is independent of the plan."""
        return tuple(v for v in variables if v not in (*self._states, *self._inputs, PIECE))

    def contract(
        self, variables: tuple[str, ...], lo: Array, hi: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Cut boxes to what the tube can reach, and tell which may still meet it."""
        x, u = self._window(variables, lo, hi)
        state, tied, state_column, tied_column = self._columns(variables)
        lo, hi = lo.copy(), hi.copy()
        lo[:, tied] = np.maximum(lo[:, tied], u.lo[:, tied_column])
        hi[:, tied] = np.minimum(hi[:, tied], u.hi[:, tied_column])
        centre = x[:, state_column]
        lo[:, state], hi[:, state], alive = self.section.cut(state_column, lo[:, state], hi[:, state], centre)
        return lo, hi, alive & np.all(lo <= hi, axis=1)

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """The points in the ranges of what is independent of the plan, pulled into the tube of their time.

        Thin boxes, those that are proven to lie in it; none if the ranges have no point in floats.
        """
        others = self._others(variables)
        other = [variables.index(v) for v in others]
        moved, _ = self._free.inside(others, points[:, other])
        if len(moved) < len(points):
            return points[:0], points[:0]
        points = points.copy()
        points[:, other] = moved
        if PIECE in variables:
            points = self._in_its_piece(variables, points)
        x, u = self._window(variables, points, points)
        state, tied, state_column, tied_column = self._columns(variables)
        centre = self._plan.near(x, state_column, points[:, state])
        points[:, state], ok = self.section.pull(state_column, points[:, state], centre)
        lo, hi = points.copy(), points.copy()
        lo[:, tied], hi[:, tied] = u.lo[:, tied_column], u.hi[:, tied_column]
        return lo[ok], hi[ok]

    def _in_its_piece(self, variables: tuple[str, ...], points: Array) -> Array:
        """The points whose time lies in their piece for certain."""
        spans = self._plan.spans
        assert spans is not None
        piece = np.rint(points[:, variables.index(PIECE)]).astype(np.intp)
        t = points[:, variables.index(TIME)]
        # the ends of a piece are known to a rounding: stay two floats away from them
        low, high = up(up(spans.lo[piece])), down(down(spans.hi[piece]))
        return points[(low <= t) & (t <= high)]

    def priorities(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> Array:
        """Split what causes the overestimate: curvature inside, the cut of the ball at its boundary, motion in time."""
        x, _ = self._window(variables, lo, hi)
        state, tied, state_column, _ = self._columns(variables)
        centre = x[:, state_column]
        crosses = self.section.crosses(state_column, lo[:, state], hi[:, state], centre)
        boundary = crosses.astype(float)[:, None]
        priority = estimate.caused.copy()
        priority[:, state] += boundary * estimate.spread[:, state]
        if TIME in variables and not self._plan.is_constant:
            width = np.maximum(hi[:, state] - lo[:, state], 1e-300)
            # a state box narrower than the plan's motion gains nothing from being split further
            share = np.minimum(1e9, (centre.hi - centre.lo) / width)
            moved = (boundary * estimate.spread[:, state] * share).sum(axis=1)
            priority[:, variables.index(TIME)] += moved + (estimate.spread + estimate.caused)[:, tied].sum(
                axis=1
            )
        priority[:, tied] = 0.0
        return np.where(hi > lo, priority, 0.0)

    def _window(self, variables: tuple[str, ...], lo: Array, hi: Array) -> tuple[Interval, Interval]:
        """x* and u* over the time windows of the boxes."""
        if TIME in variables and not self._plan.is_constant:
            column = variables.index(TIME)
            span = lo[:, variables.index(PIECE)] if PIECE in variables else None
            return self._over(lo[:, column], hi[:, column], span, thin=lo is hi)
        if self._resting is None:
            zero = np.zeros(1)
            self._resting = self._plan.enclose(zero, zero)
        x, u = (
            Interval(*(np.repeat(end.T, len(lo), axis=1).T for end in (part.lo, part.hi)))
            for part in self._resting
        )
        return x, u

    def _over(self, lo: Array, hi: Array, span: Array | None, *, thin: bool) -> tuple[Interval, Interval]:
        """x* and u* over windows of time; those that were asked for last are not enclosed again."""
        if span is None and thin in self._last:
            before, found = self._last[thin]
            same = (old is new or np.array_equal(old, new) for old, new in zip(before, (lo, hi), strict=True))
            if all(same):
                return found
        found = self._plan.enclose(lo, hi, span)
        if span is None:
            self._last[thin] = (lo.copy(), hi.copy()), found
        return found

    def _columns(self, variables: tuple[str, ...]) -> tuple[list[int], list[int], list[int], list[int]]:
        """Columns of the boxes that are states and inputs, and which states and inputs they are."""
        state = [i for i, v in enumerate(variables) if v in self._states]
        tied = [i for i, v in enumerate(variables) if v in self._inputs]
        which = [self._states.index(variables[i]) for i in state]
        return state, tied, which, [self._inputs.index(variables[i]) for i in tied]

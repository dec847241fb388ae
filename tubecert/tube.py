"""The tube O(rho): all states within rho of the plan, as a domain that classifies boxes.

In: a plan, a radius, a window of time. Out: for boxes in (x, u*, t): smaller boxes with the same points of the tube, or
"outside"; for points: thin boxes proven inside. Trusted: yes. Implements: (omega_norm_ball), (full_tube), assumption 1.

Time is a coordinate of the search. Within a window the plan lies in a box P; a state box X is cut to the ranges that a
point within rho of P can have given the gaps between X and P in the other coordinates. No cover of the tube by boxes
is ever fixed: a boxed ball would be up to sqrt(n) too wide.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.interval import Array, Interval, down, up
from tubecert.enclosure.objective import Estimate
from tubecert.enclosure.pencil import scalar
from tubecert.expression import free_symbols
from tubecert.model import TIME
from tubecert.trajectory import Plan
from tubecert.trajectory.plan import PIECE
from tubecert.verdict import Verdict

_WINDOWS = 64


class Tube:
    """O(rho) as a `Domain` over states, inputs (standing for u*(t)), time, and further independent ranges."""

    def __init__(
        self,
        plan: Plan,
        rho: float,
        *,
        states: tuple[str, ...],
        inputs: tuple[str, ...],
        time: Range | None,
        extra: dict[str, Range] | None = None,
    ) -> None:
        self._plan, self._rho = plan, rho
        self._states, self._inputs = states, inputs
        self._free = BoxDomain({**({} if time is None else {TIME: time}), **(extra or {})})

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
        curves = zip((*self._states, *self._inputs), (*self._plan.x, *self._plan.u), strict=True)
        return bool(free_symbols([curve for name, curve in curves if name in needed]))

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """Boxes around the plan, window by window of time if there are inputs: these are known through time only."""
        others = self._others(variables)
        free_lo, free_hi = self._free.boxes(others)
        if PIECE in variables:
            lo, hi = self._piecewise(variables, others, free_lo, free_hi)
            lo, hi, _ = self.contract(variables, lo, hi)
            return lo, hi
        if TIME in others:
            column = others.index(TIME)
            windows = _WINDOWS if any(v in self._inputs for v in variables) else 1
            edges = np.linspace(free_lo[0, column], free_hi[0, column], windows + 1)
            free_lo, free_hi = np.repeat(free_lo, windows, axis=0), np.repeat(free_hi, windows, axis=0)
            free_lo[:, column], free_hi[:, column] = edges[:-1], edges[1:]
        lo, hi = (
            np.full((len(free_lo), len(variables)), -np.inf),
            np.full((len(free_lo), len(variables)), np.inf),
        )
        for source, name in enumerate(others):
            lo[:, variables.index(name)], hi[:, variables.index(name)] = (
                free_lo[:, source],
                free_hi[:, source],
            )
        lo, hi, _ = self.contract(variables, lo, hi)
        return lo, hi

    def _others(self, variables: tuple[str, ...]) -> tuple[str, ...]:
        """Time and what is independent of the plan."""
        return tuple(v for v in variables if v not in (*self._states, *self._inputs, PIECE))

    def _piecewise(
        self, variables: tuple[str, ...], others: tuple[str, ...], free_lo: Array, free_hi: Array
    ) -> tuple[Array, Array]:
        """One box for every piece of the plan, unbounded in states and inputs."""
        spans = self._plan.spans
        assert spans is not None
        count = len(spans.lo)
        lo, hi = np.full((count, len(variables)), -np.inf), np.full((count, len(variables)), np.inf)
        for source, name in enumerate(others):
            column = variables.index(name)
            lo[:, column], hi[:, column] = free_lo[0, source], free_hi[0, source]
        column = variables.index(TIME)
        lo[:, column], hi[:, column] = (
            np.maximum(lo[:, column], spans.lo),
            np.minimum(hi[:, column], spans.hi),
        )
        lo[:, variables.index(PIECE)] = hi[:, variables.index(PIECE)] = np.arange(count)
        return lo, hi

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
        # squared gaps between box and plan, rounded down, coordinate by coordinate
        gap = np.maximum(0.0, np.maximum(down(lo[:, state] - centre.hi), down(centre.lo - hi[:, state])))
        square = np.maximum(0.0, down(gap * gap))
        square = np.where(np.isfinite(square), square, 0.0)
        others = square @ (1.0 - np.eye(len(state)))  # the gaps in all other coordinates
        room = up(up(np.square(self._rho)) - down(others * (1 - 1e-14)))
        alive = np.all(room >= 0, axis=1)
        reach = up(np.sqrt(up(np.maximum(room, 0.0))) * (1 + 1e-15))
        lo[:, state] = np.maximum(lo[:, state], down(centre.lo - reach))
        hi[:, state] = np.minimum(hi[:, state], up(centre.hi + reach))
        return lo, hi, alive & np.all(lo <= hi, axis=1)

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """The points, moved into the ball around the plan at their time where that can be proven."""
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
        centre = x[:, state_column]
        offset = points[:, state] - centre.mid
        length = np.sqrt(np.sum(offset * offset, axis=1, keepdims=True))
        blur = np.sum(centre.hi - centre.lo + 1e-15 * centre.magnitude, axis=1, keepdims=True)
        reach = np.maximum(self._rho * (1 - 1e-9) - 2 * blur, 0.0)
        scale = np.minimum(1.0, reach / np.maximum(length, 1e-300))
        points[:, state] = centre.mid + scale * offset
        distance = (Interval.exact(points[:, state]) - centre) ** 2
        total = distance.hi.sum(axis=1) * (1 + 1e-14)
        ok = total <= down(np.square(self._rho))
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
        far = np.maximum(np.abs(hi[:, state] - centre.lo), np.abs(lo[:, state] - centre.hi))
        boundary = (np.sum(far * far, axis=1) > self._rho**2).astype(float)[:, None]
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
            return self._plan.enclose(lo[:, column], hi[:, column], span)
        zero = np.zeros(len(lo))
        return self._plan.enclose(zero, zero)

    def _columns(self, variables: tuple[str, ...]) -> tuple[list[int], list[int], list[int], list[int]]:
        """Columns of the boxes that are states and inputs, and which states and inputs they are."""
        state = [i for i, v in enumerate(variables) if v in self._states]
        tied = [i for i, v in enumerate(variables) if v in self._inputs]
        which = [self._states.index(variables[i]) for i in state]
        return state, tied, which, [self._inputs.index(variables[i]) for i in tied]


@dataclass(frozen=True, slots=True, kw_only=True)
class Containment:
    """Whether O(rho) lies in the safe set (assumption 1): certified, refuted with place and time, or undecided."""

    verdict: Verdict
    state: str = ""
    side: str = ""
    t: float = 0.0
    x: tuple[float, ...] = ()
    excess: float = 0.0


def containment(
    plan: Plan,
    radius: Fraction,
    states: tuple[str, ...],
    safe_set: tuple[tuple[Fraction, Fraction], ...],
    effort: Effort,
) -> Containment:
    """Decide assumption 1: x*(t) is at least rho away from every face of the safe set, for all t."""
    radius = Fraction(radius)
    if not plan.defined:
        return _knots_outside(plan, radius, states, safe_set)
    undecided: Containment | None = None
    worst: Containment | None = None
    for i, (name, (lowest, highest)) in enumerate(zip(states, safe_set, strict=True)):
        for side, sign, limit in (("upper", 1, highest), ("lower", -1, -lowest)):
            exact = plan.x[i]
            if exact.is_constant:
                low = high = sign * exact.fraction
                t = 0.0
            else:
                width = 1e-7 * float(highest - lowest)
                # relative to the limit that is the same; to a curve far beyond it, it is all that matters
                fine = Effort(
                    gap=width / float(max(abs(highest), abs(lowest))), absolute=width, budget=effort.budget
                )
                found = supremum(scalar(sign * exact, plan.fixed), plan.domain, fine)
                t = plan.moment(found.at) or 0.0
                # what is not bounded is undecided
                low = Fraction(found.below) if np.isfinite(found.below) else limit - radius - 1
                high = Fraction(found.above) if np.isfinite(found.above) else limit + 1
            if high + radius <= limit:
                continue
            here, _ = plan.enclose(np.array([t]), np.array([t]))
            place = here.mid[0].copy()
            place[i] += sign * float(radius)
            case = Containment(
                verdict=Verdict.REFUTED if low + radius > limit else Verdict.UNDECIDED,
                state=name,
                side=side,
                t=t,
                x=tuple(float(value) for value in place),
                excess=float(low + radius - limit),
            )
            if case.verdict is Verdict.REFUTED and (worst is None or case.excess > worst.excess):
                worst = case
            elif case.verdict is Verdict.UNDECIDED:
                undecided = case
    return worst or undecided or Containment(verdict=Verdict.CERTIFIED)


def _knots_outside(
    plan: Plan,
    radius: Fraction,
    states: tuple[str, ...],
    safe_set: tuple[tuple[Fraction, Fraction], ...],
) -> Containment:
    """The knot that is farthest from being allowed, for a curve whose slopes are not defined everywhere.

    Inside the safe set they are, so that a knot outside is to be expected. Knots beyond the horizon shape the last
    piece only: the curve need not reach them.
    """
    worst = Containment(verdict=Verdict.UNDECIDED, excess=0.0)
    knots = plan.knots
    reached = zip(knots.t, knots.x, strict=True) if knots else ()
    for t, x in reached:
        if plan.horizon is not None and t > plan.horizon:
            break
        for i, (name, (lowest, highest)) in enumerate(zip(states, safe_set, strict=True)):
            for side, sign, excess in (("upper", 1, x[i] - highest), ("lower", -1, lowest - x[i])):
                if excess + radius > worst.excess:
                    place = [float(value) for value in x]
                    place[i] += sign * float(radius)
                    worst = Containment(
                        verdict=Verdict.REFUTED,
                        state=name,
                        side=side,
                        t=float(t),
                        x=tuple(place),
                        excess=float(excess + radius),
                    )
    return worst

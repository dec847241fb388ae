"""The tube: all states around the plan, as a domain that cuts boxes and tells which lie outside.

A box of states is compared with segments of the plan: what the offsets between them can be is cut to what the tube is
around one point (`around`: a ball, or an ellipsoid with half-widths). Segments are halved while they are
long against the box. Where a test depends on t or on u*, time is a coordinate and selects the segments.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from flint import arb

from tubecert.recheck.around import Around
from tubecert.recheck.balls import Ball, ceiling, floor
from tubecert.recheck.cover import Domain, Range, State, as_ball
from tubecert.recheck.curve import Curve, Segment

TIME = "t"

_MOST = 256  # segments that are looked at for one box: longer ones cover as well
_COARSE = 0.25  # a segment may be so long against the box


class Tube(Domain):
    """The tube over states, inputs (standing for u*), time, and ranges that do not depend on the plan."""

    def __init__(
        self,
        curve: Curve,
        around: Around,
        states: Sequence[str],
        inputs: Sequence[str],
        free: Mapping[str, Range] | None = None,
    ) -> None:
        self._curve, self._around = curve, around
        self._states = {name: i for i, name in enumerate(states)}
        self._inputs = {name: j for j, name in enumerate(inputs)}
        self._free = {v: (as_ball(lo), as_ball(hi)) for v, (lo, hi) in (free or {}).items()}

    def needed(self, variables: tuple[str, ...]) -> tuple[str, ...]:
        """Time beside what is given, where an input moves with the plan."""
        tied = any(v in self._inputs for v in variables) and self._curve.moves
        return (*variables, TIME) if tied and TIME not in variables else variables

    def start(self, variables: tuple[str, ...]) -> list[State]:
        """One box around everything."""
        root = self._curve.root
        box = []
        for v in variables:
            if v in self._states:
                lo, hi = root.x[self._states[v]]
                rho = self._around.extent(self._states[v])
                box.append((math.nextafter(lo - rho, -math.inf), math.nextafter(hi + rho, math.inf)))
            elif v in self._inputs:
                box.append(root.u[self._inputs[v]])
            elif v == TIME and self._curve.moves:
                box.append(root.when)
            else:
                box.append((floor(self._free[v][0]), ceiling(self._free[v][1])))
        return [(box, [root])]

    def cut(self, variables: tuple[str, ...], state: State) -> State | None:
        """The box cut to what the tube can reach, with the segments that matter for it."""
        box, segments = state
        columns = [(i, self._states[v]) for i, v in enumerate(variables) if v in self._states]
        tied = [(i, self._inputs[v]) for i, v in enumerate(variables) if v in self._inputs]
        window = box[variables.index(TIME)] if TIME in variables and self._curve.moves else None
        if not columns and not tied:
            return state
        width = max(((box[i][1] - box[i][0]) / self._around.extent(k) for i, k in columns), default=math.inf)
        kept: list[Segment] = []
        reach: dict[int, tuple[float, float]] = {}
        waiting = list(segments)
        while waiting:
            segment = waiting.pop()
            if window and (segment.when[1] < window[0] or segment.when[0] > window[1]):
                continue
            near = self._near(segment, columns, box)
            if near is None:
                continue
            few = len(kept) + len(waiting) < _MOST
            if few and self._is_long(segment, columns, width, window) and segment.halves:
                waiting.extend(segment.halves)
                continue
            kept.append(segment)
            for i, j in tied:
                near[i] = segment.u[j]
            reach = {i: _joined(reach.get(i), ends) for i, ends in near.items()}
            if not window and all(lo <= box[i][0] and hi >= box[i][1] for i, (lo, hi) in reach.items()):
                return box, kept + waiting  # nothing can be cut: look no closer
        if not kept:
            return None
        new = list(box)
        for i, (lo, hi) in reach.items():
            new[i] = max(box[i][0], lo), min(box[i][1], hi)
            if new[i][0] > new[i][1]:
                return None
        return new, kept

    def _near(
        self, segment: Segment, columns: list[tuple[int, int]], box: list[tuple[float, float]]
    ) -> dict[int, tuple[float, float]] | None:
        """Where the tube around a segment can meet the box; None if nowhere."""
        offsets = [_apart(box[i], segment.x[k]) for i, k in columns]
        cut = self._around.near([k for _, k in columns], offsets)
        if cut is None:
            return None
        return {
            i: (
                math.nextafter(segment.x[k][0] + lo, -math.inf),
                math.nextafter(segment.x[k][1] + hi, math.inf),
            )
            for (i, k), (lo, hi) in zip(columns, cut, strict=True)
        }

    def _is_long(
        self,
        segment: Segment,
        columns: list[tuple[int, int]],
        width: float,
        window: tuple[float, float] | None,
    ) -> bool:
        if window is not None:
            return segment.when[1] - segment.when[0] > max(window[1] - window[0], 1e-12)
        motion = max((segment.x[k][1] - segment.x[k][0]) / self._around.extent(k) for _, k in columns)
        return motion > _COARSE * width

    def point(self, variables: tuple[str, ...], state: State) -> list[Ball] | None:
        """The centre of the box, moved towards the plan into the tube."""
        box, segments = state
        segment = segments[len(segments) // 2]
        t, x, u = segment.middle()
        inside = [0.5 * lo + 0.5 * hi for lo, hi in box]
        columns = [(i, self._states[v]) for i, v in enumerate(variables) if v in self._states]
        for i, k in columns:
            x[k] = segment.nearest(k, inside[i], x[k])
        offset = [arb(inside[i]) - x[k] for i, k in columns]
        at = [arb(value) for value in inside]
        moved = self._around.inside([k for _, k in columns], offset)
        if moved is None:
            return None
        for (i, k), z in zip(columns, moved, strict=True):
            at[i] = x[k] + z
        for i, v in enumerate(variables):
            if v in self._inputs:
                at[i] = u[self._inputs[v]]
            elif v == TIME and self._curve.moves:
                at[i] = t
            elif v not in self._states:
                low, high = ceiling(self._free[v][0]), floor(self._free[v][1])
                if low > high:
                    return None
                at[i] = arb(min(max(inside[i], low), high))
        return at

    def pull(
        self, variables: tuple[str, ...], state: State, caused: list[float], spread: list[float]
    ) -> list[float]:
        """The width of the bound; where the tube cuts the box, also what varies in it, and the motion of the plan."""
        box, segments = state
        columns = [(i, self._states[v]) for i, v in enumerate(variables) if v in self._states]
        tied = [i for i, v in enumerate(variables) if v in self._inputs]
        hull = [(min(s.x[k][0] for s in segments), max(s.x[k][1] for s in segments)) for _, k in columns]
        far = [
            max(box[i][1] - lo, hi - box[i][0], 0.0) for (i, _), (lo, hi) in zip(columns, hull, strict=True)
        ]
        found = list(caused)
        if self._around.crosses([k for _, k in columns], far):
            for i, _ in columns:
                found[i] += spread[i]
        if TIME in variables and self._curve.moves:
            place = variables.index(TIME)
            for (i, _), (lo, hi) in zip(columns, hull, strict=True):
                width = max(box[i][1] - box[i][0], 1e-300)
                found[place] += spread[i] * min(1e9, (hi - lo) / width)
            found[place] += sum(spread[i] + caused[i] for i in tied)
        for i in tied:
            found[i] = 0.0
        return found


def _apart(box: tuple[float, float], plan: tuple[float, float]) -> tuple[float, float]:
    """x - x* for x in a box and x* in a segment, outward."""
    return math.nextafter(box[0] - plan[1], -math.inf), math.nextafter(box[1] - plan[0], math.inf)


def _joined(a: tuple[float, float] | None, b: tuple[float, float]) -> tuple[float, float]:
    return b if a is None else (min(a[0], b[0]), max(a[1], b[1]))

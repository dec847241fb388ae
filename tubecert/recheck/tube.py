"""The tube: all states around the plan, as a domain that cuts boxes and tells which lie outside.

A box of states is compared with segments of the plan: what the offsets between them can be is cut to what the tube is
around one point (a ball, or an ellipsoid with half-widths). Segments are halved while they are
long against the box. Where a test depends on t or on u*, time is a coordinate and selects the segments.

What the tube is around one point of the plan: a ball, or an ellipsoid cut to half-widths, as boxes see it.

Offsets are x - x*. Asked is about some of the states, `which`: then what is known is the projection of the set to them.
Implements: theory (0.3), (1.6).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, ceiling, exact, floor, length, root
from tubecert.recheck.coordinates import Coordinates, inverted, product
from tubecert.recheck.cover import Domain, Range, State, as_ball
from tubecert.recheck.curve import Curve, Segment
from tubecert.recheck.specified.numbers import Numbers, Rows

Ranges = list[tuple[float, float]]

# floats are correctly rounded: what they lose over a few operations is far below these factors
_LESS, _MORE = 1 - 1e-14, 1 + 1e-14
_SLACK = 4e-14  # relative to the sum of magnitudes: sums of at most 64 terms
_INNER = 1 - 1e-9
_FAR = 1e80  # from 1 in either direction: within it no square, product or quotient of these leaves the range of floats


def _check_floats(sizes: Iterable[Fraction]) -> None:
    """Raises `ValueError` where floats might lose points of a tube with such sizes."""
    if not all(1 / _FAR <= q <= _FAR for q in sizes):
        raise ValueError("the tube is too wide or too narrow for floats")


class Round:
    """|x - x*| <= rho."""

    def __init__(self, rho: Fraction) -> None:
        self._rho = exact(rho)
        _check_floats([rho])
        self._square = math.nextafter(float(rho * rho), math.inf)

    def extent(self, state: int) -> float:
        """The radius."""
        del state
        return ceiling(self._rho)

    def near(self, which: Sequence[int], offsets: Ranges) -> Ranges | None:
        """Smaller ranges with the same points of the set, None if there are none: each by the gaps in all others."""
        del which
        squares = []
        for lo, hi in offsets:
            gap = max(0.0, lo, -hi) * _LESS
            squares.append(gap * gap * _LESS)
        if sum(squares) * _LESS > self._square:
            return None
        found = []
        for place in range(len(offsets)):
            others = sum(squares[:place]) + sum(squares[place + 1 :])
            half = math.sqrt(max(0.0, self._square - others * _LESS)) * _MORE
            found.append((-half, half))
        return found

    def crosses(self, which: Sequence[int], far: Sequence[float]) -> bool:
        """Whether a box with such largest |offsets| may reach beyond the set, by its farthest corner; it steers."""
        del which
        return sum(x * x for x in far) > self._square

    def inside(self, which: Sequence[int], offset: Sequence[Ball]) -> list[Ball] | None:
        """An offset moved along the radius into the set; None if it could not be shown to lie there."""
        del which
        size = length(offset)
        scale = 1.0
        if not size <= self._rho:
            scale = float((self._rho / size.upper()).lower()) * _INNER if size > 0 else 0.0
        moved = [z * scale for z in offset]
        return moved if length(moved) <= self._rho else None

    def form(self, which: Sequence[int]) -> Rows:
        """Q with y'Q y <= rho^2 on the projection: the identity."""
        return tuple(tuple(Fraction(i == j) for j in which) for i in which)

    def directions(self, which: Sequence[int]) -> list[list[float]]:
        """C with C C' = Q^-1, in floats: a proposal."""
        return [[float(i == j) for j in which] for i in which]


class Ellipsoid:
    """|S (x - x*)| <= rho and |x_i - x*_i| <= sides_i.

    The projection of the ellipsoid to some states is y'Q y <= rho^2 with Q the inverse of their block of (S'S)^-1, and
    y'Q y = sum_k d_k r_k^2, r_k = y_k + sum_(j > k) l_kj y_j with exact d_k and l_kj.
    """

    def __init__(self, coordinates: Coordinates, rho: Fraction, sides: Numbers) -> None:
        self._spread, self._rho, self._sides = coordinates.spread, rho, sides
        _check_floats([rho, *sides])
        self._square = math.nextafter(float(rho * rho), math.inf)
        self._forms: dict[tuple[int, ...], _Form] = {}
        whole = [ceiling(exact(rho) * root(exact(row[i]))) for i, row in enumerate(self._spread)]
        self._extents = [min(reach, ceiling(exact(side))) for reach, side in zip(whole, sides, strict=True)]

    def extent(self, state: int) -> float:
        """The half-width, or what the ellipsoid leaves."""
        return self._extents[state]

    def _form(self, which: Sequence[int]) -> _Form:
        key = tuple(which)
        if key not in self._forms:
            self._forms[key] = _Form(self._spread, key)
        return self._forms[key]

    def near(self, which: Sequence[int], offsets: Ranges) -> Ranges | None:
        """To the half-widths; then each row by what the others leave of rho^2."""
        found = []
        for i, (lo, hi) in zip(which, offsets, strict=True):
            side = self.extent(i)
            low, high = max(lo, -side), min(hi, side)
            if low > high:
                return None
            found.append((low, high))
        return self._form(which).near(found, self._square) if which else found

    def crosses(self, which: Sequence[int], far: Sequence[float]) -> bool:
        """The largest values of the rows, and the half-widths."""
        if any(x > float(self._sides[i]) for i, x in zip(which, far, strict=True)):
            return True
        return bool(which) and self._form(which).most(far) > self._square

    def inside(self, which: Sequence[int], offset: Sequence[Ball]) -> list[Ball] | None:
        """Along the radius; the other states follow such that |S x| is least, and must keep their half-widths."""
        if not which:
            return []
        form, rho = self._form(which), exact(self._rho)
        size = root(form.value(offset))
        over = [abs(y) / exact(self._sides[i]) for i, y in zip(which, offset, strict=True)]
        excess = max(float((size / rho).upper()), *(float(x.upper()) for x in over))
        if not math.isfinite(excess):
            return None
        scale = 1.0 if excess <= 1 else _INNER / excess
        moved = [y * scale for y in offset]
        whole = form.completed(moved)
        kept = all(abs(y) <= exact(side) for y, side in zip(whole, self._sides, strict=True))
        return moved if kept and form.value(moved) <= rho * rho else None

    def form(self, which: Sequence[int]) -> Rows:
        """The inverse of the block of (S'S)^-1."""
        return self._form(which).Q

    def directions(self, which: Sequence[int]) -> list[list[float]]:
        """The block's own factor."""
        return self._form(which).directions


Around = Round | Ellipsoid


class _Form:
    """y'Q y for some of the states, exactly and in floats."""

    def __init__(self, spread: Rows, which: tuple[int, ...]) -> None:
        block = tuple(tuple(spread[i][j] for j in which) for i in which)
        self.Q = Q = inverted(block)
        weights, rows = _squares(block)
        # block = sum_k d_k r_k r_k'
        self.directions = [
            [math.sqrt(float(d)) * float(row[i]) for d, row in zip(weights, rows, strict=True)]
            for i in range(len(block))
        ]
        self._weights, self._rows = _squares(Q)
        _check_floats([*self._weights, *(abs(l) for row in self._rows for l in row if l)])
        self._least = [math.nextafter(float(d), 0.0) for d in self._weights]
        self._floats = [[float(l) for l in row] for row in self._rows]
        n = range(len(which))
        self._others = [[[0.0 if i == j else row[i] for i in n] for j in n] for row in self._floats]
        columns = [[Q[i][j] for i in n] for j in n]
        self._completion = [
            [product([row[i] for i in which], column) for column in columns] for row in spread
        ]

    def value(self, y: Sequence[Ball]) -> Ball:
        """y'Q y."""
        total = arb(0)
        for d, row in zip(self._weights, self._rows, strict=True):
            r = sum((exact(l) * x for l, x in zip(row, y, strict=True)), start=arb(0))
            total = total + exact(d) * r * r
        return total

    def completed(self, y: Sequence[Ball]) -> list[Ball]:
        """All offsets with these entries, |S x| least: spread_(:,V) Q y."""
        return [
            sum((exact(c) * x for c, x in zip(row, y, strict=True)), start=arb(0)) for row in self._completion
        ]

    def most(self, far: Sequence[float]) -> float:
        """What y'Q y can be for such |y|."""
        rows = (sum(abs(l) * x for l, x in zip(row, far, strict=True)) for row in self._floats)
        return sum(d * r * r for d, r in zip(self._least, rows, strict=True))

    def near(self, ranges: Ranges, square: float) -> Ranges | None:
        """Ranges cut to what y'Q y <= square leaves; None if it leaves nothing."""
        now = list(ranges)
        sums = [_sum(row, now) for row in self._floats]
        least = [max(0.0, lo, -hi) for lo, hi in sums]
        gaps = [d * (gap * gap) * _LESS for d, gap in zip(self._least, least, strict=True)]
        if sum(gaps) * _LESS > square:
            return None
        for k, row in enumerate(self._floats):
            others = sum(gaps[:k]) + sum(gaps[k + 1 :])
            room = max(0.0, square - others * _LESS)
            reach = math.sqrt(room / self._least[k]) * _MORE if self._least[k] > 0 else math.inf
            for j, weight in enumerate(row):
                if weight == 0 or not math.isfinite(reach):
                    continue
                rest = _sum(self._others[k][j], now)
                size = max(abs(rest[0]), abs(rest[1])) + reach
                ends = sorted(((-reach - rest[1]) / weight, (reach - rest[0]) / weight))
                blur = size / abs(weight) * _SLACK
                low, high = max(now[j][0], ends[0] - blur), min(now[j][1], ends[1] + blur)
                if low > high:
                    return None
                now[j] = low, high
        return now


def _sum(row: Sequence[float], ranges: Ranges) -> tuple[float, float]:
    """sum_j row_j y_j over ranges, outward; the row's entries are off by a rounding each."""
    lo = hi = size = 0.0
    for weight, (low, high) in zip(row, ranges, strict=True):
        a, b = weight * low, weight * high
        lo, hi = lo + min(a, b), hi + max(a, b)
        size += max(abs(a), abs(b))
    return lo - size * _SLACK, hi + size * _SLACK


def _squares(Q: Rows) -> tuple[list[Fraction], list[list[Fraction]]]:
    """d and l with y'Q y = sum_k d_k (sum_j l_kj y_j)^2, l_kk = 1, l_kj = 0 for j < k; Q is positive definite."""
    n = len(Q)
    rest = [list(row) for row in Q]
    weights, rows = [], []
    for k in range(n):
        d = rest[k][k]
        if d <= 0:
            raise ValueError("the tube is not bounded")
        row = [Fraction(0)] * k + [rest[k][j] / d for j in range(k, n)]
        weights.append(d)
        rows.append(row)
        for i in range(k, n):
            for j in range(k, n):
                rest[i][j] -= d * row[i] * row[j]
    return weights, rows


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

"""How far the tube stays from an obstacle: proven, over all times of the plan.

In: the plan, an obstacle in the plane of two states, how far the tube reaches in every direction of that plane. Out: an
enclosure of the clearance, with the time at which it is least; or a point of the obstacle that the tube contains.
Trusted: yes. Implements: theory section 4c.

At a time the tube lies in {x* + y: c'y <= s(c) for every c}. So it keeps away from a convex set O, in the direction c
of length one, by at least c'x* - max over O of c'o - s(c). A polygon is the union of its edges and of its inside: a
connected set around x*(t) that meets no edge lies on one side of it, and that side does not change while t runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array, Interval, fraction_bounds, sqrt
from tubecert.enclosure.outward import down, up
from tubecert.model import TIME
from tubecert.spec import Obstacle
from tubecert.trajectory import Plan
from tubecert.verdict import Verdict

_QUARTER = (
    16  # directions in a quarter turn: the best of them loses at most 1 - cos(pi/64), .12 % of a distance
)
_FIRST = 64  # windows of time to begin with
_MOST = 50_000  # windows
_SHARP = 1e-3  # of the largest extent of the tube: how closely the clearance is enclosed
Vector = tuple[Fraction, ...]


def directions() -> tuple[Vector, ...]:
    """Vectors of length one all around, exact: ((1 - q^2)/(1 + q^2), 2q/(1 + q^2)), theory 4c."""
    found = []
    for k in range(_QUARTER):
        q = Fraction(k, _QUARTER)
        c, s = (1 - q * q) / (1 + q * q), 2 * q / (1 + q * q)
        found += [(c, s), (-s, c), (-c, -s), (s, -c)]
    return tuple(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """Bounds over the tube of the block of W in the plane: of W11 and W22, and [low, high] of W12."""

    diagonal: tuple[float, float]
    beside: tuple[float, float]

    def square(self, c: Vector) -> Interval:
        """An upper bound of sup c'Wc, as its upper end: s(c)^2/dbar^2 of theory 4c."""
        x, y = map(Interval.of, c)
        turned = self.beside[c[0] * c[1] > 0]
        total = (
            x * x * Interval.exact(self.diagonal[0])
            + y * y * Interval.exact(self.diagonal[1])
            + 2 * x * y * Interval.exact(turned)
        )
        return Interval(np.zeros(()), np.maximum(total.hi, 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """[below, above] encloses what is proven by the directions; `t` is where it is least.

    `inside` is a point of the obstacle that is proven to lie in the tube at `t`, if one was found.
    """

    below: float
    above: float
    t: float
    inside: tuple[float, float] | None = None

    @property
    def verdict(self) -> Verdict:
        """Certified where there is clearance, refuted where a point of the obstacle lies in the tube."""
        if self.below > 0:
            return Verdict.CERTIFIED
        return Verdict.UNDECIDED if self.inside is None else Verdict.REFUTED


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """The tube in the plane: d < `reach`, the shape of W there, and M <= `upper` I."""

    columns: tuple[int, int]
    reach: Interval
    shape: Shape
    upper: float

    def extent(self, c: Vector) -> float:
        """s(c) = dbar sup sqrt(c'Wc), rounded up, theory 4c."""
        return float((self.reach * sqrt(self.shape.square(c))).hi)


def clearance(plan: Plan, obstacle: Obstacle, section: Section, effort: Effort) -> Clearance:
    """The clearance, or what was found of it within the budget."""
    gaps = _Gaps(plan, obstacle, section)
    found = _least(gaps, plan, effort)
    if found.below > 0 and gaps.starts_outside():
        return found
    # no proof: the tube meets an edge, or the plan runs inside
    point = _met(gaps, obstacle, section, found.t)
    return Clearance(below=min(found.below, 0.0), above=found.above, t=found.t, inside=point)


class _Gaps:
    """The gaps between the tube and the convex parts of an obstacle, over windows of time."""

    def __init__(self, plan: Plan, obstacle: Obstacle, section: Section) -> None:
        self._plan, self._obstacle, self._columns = plan, obstacle, list(section.columns)
        turned = directions()
        ends = [[fraction_bounds(c[i]) for c in turned] for i in (0, 1)]
        self._c = [Interval(*(np.array(end) for end in zip(*column, strict=True))) for column in ends]
        reach = [section.extent(direction) for direction in turned]
        tops = [[top + s for top, s in zip(row, reach, strict=True)] for row in _tops(obstacle, turned)]
        self._beyond = up(np.array(tops))  # (parts, directions)
        self.size = max(reach)

    def over(self, lo: Array, hi: Array) -> Interval:
        """The least gap over windows (N,): from below for all times in them, (4.12)."""
        x, _ = self._plan.enclose(lo, hi)
        p = x[:, self._columns]
        along = self._c[0] * p[:, :1] + self._c[1] * p[:, 1:]  # (N, directions)
        low = down(along.lo[:, None, :] - self._beyond).max(axis=2).min(axis=1)
        high = up(along.hi[:, None, :] - self._beyond).max(axis=2).min(axis=1)
        # where the curve is not bounded, nothing is known
        known = ~np.isnan(low) & ~np.isnan(high)
        return Interval(np.where(known, low, -np.inf), np.where(known, high, np.inf))

    def starts_outside(self) -> bool:
        """Whether x*(0) is proven to lie outside of the obstacle, if the tube meets none of its edges.

        The enclosure of x*(0) is one connected set: where it meets no edge its middle tells for all of it.
        """
        start = np.zeros(1)
        apart = bool(self.over(start, start).lo[0] > 0)
        return apart and not self._obstacle.contains(*map(Fraction, self.place(0.0)))

    def place(self, t: float) -> tuple[float, float]:
        """x* in the plane at a time, nearly."""
        first, second = map(float, self.around(t).mid)
        return first, second

    def around(self, t: float) -> Interval:
        """x* in the plane at a time, enclosed, shape (2,)."""
        x, _ = self._plan.enclose(np.array([t]), np.array([t]))
        return x[0, self._columns]


def _tops(obstacle: Obstacle, turned: tuple[Vector, ...]) -> list[list[float]]:
    """The largest c'o over every convex part, rounded up: over a disc, or over each edge of a polygon, (4.12)."""

    def along(c: Vector, p: Vector) -> Fraction:
        return c[0] * p[0] + c[1] * p[1]

    if obstacle.radius is not None:
        radius, center = obstacle.radius, obstacle.center
        return [[fraction_bounds(along(c, center) + radius)[1] for c in turned]]
    corners = obstacle.polygon
    return [
        [fraction_bounds(max(along(c, a), along(c, b)))[1] for c in turned]
        for a, b in zip(corners, (*corners[1:], corners[0]), strict=True)
    ]


def _least(gaps: _Gaps, plan: Plan, effort: Effort) -> Clearance:
    """The infimum over time, by halving the windows that may hold it, (4.12)."""
    span = plan.time.get(TIME, (Fraction(0), Fraction(0)))
    first, last = fraction_bounds(Fraction(span[0]))[0], fraction_bounds(Fraction(span[1]))[1]
    edges = np.linspace(first, last, _FIRST + 1) if last > first else np.array([first, first])
    lo, hi = edges[:-1], edges[1:]
    best, at, spent, done = np.inf, first, 0, np.inf
    while len(lo):
        middle = np.clip(0.5 * lo + 0.5 * hi, lo, hi)
        values, bounds = gaps.over(middle, middle).hi, gaps.over(lo, hi).lo
        least = int(np.argmin(values))
        if values[least] < best:
            best, at = float(values[least]), float(middle[least])
        spent += len(lo)
        fine = best - _SHARP * gaps.size
        # where the sign is open, more closely
        open_ = ((bounds < fine) | ((bounds <= 0) & (best > 0))) & (middle > lo) & (middle < hi)
        done = min(done, float(np.min(bounds[~open_], initial=np.inf)))
        if spent > min(effort.budget, _MOST):
            return Clearance(below=min(done, float(np.min(bounds))), above=best, t=at)
        lo, hi = (np.concatenate([lo[open_], middle[open_]]), np.concatenate([middle[open_], hi[open_]]))
    return Clearance(below=min(done, best), above=best, t=at)


def _met(gaps: _Gaps, obstacle: Obstacle, section: Section, t: float) -> tuple[float, float] | None:
    """A point of the obstacle, exact as floats, that is proven to lie in the tube at a time; None if none was found.

    |y - p| in the plane and no step in other states: the segment has the length sqrt(A)|y - p| at most.
    Theory 4c.
    """
    p, place = gaps.around(t), gaps.place(t)
    for y in _nearest(obstacle, place):
        away = [Interval.exact(y[i]) - p[i] for i in (0, 1)]
        square = Interval.exact(section.upper) * (away[0] ** 2 + away[1] ** 2)
        if bool(square.hi < (section.reach * section.reach).lo) and obstacle.contains(*map(Fraction, y)):
            return y
    return None


def _nearest(obstacle: Obstacle, p: tuple[float, float]) -> list[tuple[float, float]]:
    """Points of the obstacle near a point: candidates."""
    point = np.array(p)
    if obstacle.radius is not None:
        centre, radius = np.array([float(v) for v in obstacle.center]), float(obstacle.radius)
        away = point - centre
        size = float(np.hypot(*away))
        nearest = centre + away * min(1.0, 0.999999 * radius / size) if size > 0 else centre
        return [(float(nearest[0]), float(nearest[1]))]
    corners = np.array([[float(v) for v in corner] for corner in obstacle.polygon])
    middle = corners.mean(axis=0)
    found = [point]
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge = b - a
        share = float(np.clip((point - a) @ edge / (edge @ edge), 1e-6, 1 - 1e-6))
        on = a + share * edge
        # a step to either side of the edge, since a float need not lie on it
        side = 1e-6 * np.array([-edge[1], edge[0]])
        found += [on + side, on - side, on + 1e-6 * (middle - on)]
    order = sorted(found, key=lambda y: float(np.hypot(*(y - point))))
    return [(float(y[0]), float(y[1])) for y in order]

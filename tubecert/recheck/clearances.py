"""Clearance from obstacles: how far the tube stays away from each, over all times of the plan. Implements: theory 4c.

In: what a certificate states of every obstacle. Out: claims. The tube in the plane lies within s(c) = dbar sup
sqrt(c'Wc) of x*(t) in every direction c; an obstacle is a disc, or the edges of a polygon that x*(0) lies outside of.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import chain, pairwise
from math import isfinite

from tubecert.recheck.balls import Ball, ceiling, exact, floor, root
from tubecert.recheck.cover import CONFIRMED, Outcome, prove, stated, time_is_up, together
from tubecert.recheck.curve import Curve, Segment
from tubecert.recheck.obstacles import Cleared, Obstacle, Point, Shape
from tubecert.recheck.place import Place
from tubecert.recheck.statements import NotNegative
from tubecert.recheck.terms import number

_TURNS = 16  # directions in a quarter of a turn
_ASKED = 64  # every so many segments the time is looked at


def agrees(obstacles: Sequence[Obstacle], found: Sequence[Cleared]) -> Iterator[tuple[bool, str]]:
    """Every obstacle has its entry, and those that decide are cleared."""
    yield len(obstacles) == len(found), "clearance has not one entry for every obstacle"
    for obstacle, own in zip(obstacles, found, strict=False):
        yield own.decides == obstacle.decides, "clearance.decides is not what the specification says"
        yield own.verdict == "certified" or not own.decides, "an obstacle that decides is not cleared"
        below = own.clearance.below
        positive = below is not None and below > 0
        yield positive or own.verdict != "certified", "an obstacle is cleared by nothing"
        yield (
            own.verdict == "certified" or not positive,
            "an obstacle is cleared, and yet it is not certified",
        )
        yield own.clearance.is_interval, "a clearance is not an interval"


def shaped(place: Place, obstacle: Obstacle, shape: Shape) -> Outcome:
    """The block of W in the plane of the obstacle is bounded over the tube as stated, theory 4c."""
    i, j = (place.system.states.index(name) for name in obstacle.states)
    W, (low, high) = place.system.W, shape.beside
    above = (
        number(shape.diagonal[0]) - W[i][i],
        number(shape.diagonal[1]) - W[j][j],
        number(high) - W[i][j],
        W[i][j] - number(low),
    )
    return together([prove(NotNegative(e), place.tube(), place.budget) for e in above])


def keeps_away(place: Place, obstacle: Obstacle, own: Cleared, lower: Fraction) -> Outcome:
    """The clearance is at least what is stated, at all times, (4.12)."""
    least = own.clearance.below
    if least is None or least <= 0:
        return stated(False, "no clearance is stated")
    reach = root(exact(lower)) * exact(place.rho)
    test = _Test(place, obstacle, own.shape, reach, exact(least))
    if not test.outside():
        return Outcome(
            verdict="undecided", why="the plan could not be shown to start outside of the obstacle"
        )
    return along(place.curve.root, place.budget, test.clear)


class _Test:
    """Directions with how far the tube and each convex part of an obstacle reach in them."""

    def __init__(self, place: Place, obstacle: Obstacle, shape: Shape, reach: Ball, least: Ball) -> None:
        self._columns = tuple(place.system.states.index(name) for name in obstacle.states)
        self._curve: Curve = place.curve
        self._obstacle = obstacle
        self._least = least
        self._c = list(_turned())
        extents = [reach * root(exact(max(Fraction(0), _square(shape, c)))) for c in _turned()]
        self._beyond = [
            [exact(top) + extent for top, extent in zip(tops, extents, strict=True)]
            for tops in _tops(obstacle)
        ]

    def _apart(self, x: tuple[Ball, Ball], y: tuple[Ball, Ball], least: Ball) -> bool:
        """Whether every part is kept away from, by the least distance, from anywhere in a box, given by its ends.

        A direction is least at a corner. (A ball around a wide box would know its ends to nine digits only.)
        """
        along = [exact(c) * x[c < 0] + exact(s) * y[s < 0] for c, s in self._c]
        return all(
            any(value - top >= least for value, top in zip(along, tops, strict=True)) for tops in self._beyond
        )

    def outside(self) -> bool:
        """An x* lies outside: the ball around it meets no edge, so its middle tells for all of it."""
        start = self._curve.somewhere()
        x, y = (start[column] for column in self._columns)
        if not self._apart((x, x), (y, y), exact(0)):
            return False
        middle = (somewhere(x), somewhere(y))
        return self._obstacle.radius is not None or not contains(self._obstacle.corners, middle)

    def clear(self, segment: Segment) -> bool:
        """Whether the least distance is kept over a segment; not known of one without bounds."""
        x, y = (segment.x[column] for column in self._columns)
        return all(map(isfinite, chain(x, y))) and self._apart(_ends(x), _ends(y), self._least)


def along(whole: Segment, budget: int, clear: Callable[[Segment], bool]) -> Outcome:
    """Something is clear of a segment, or of its halves where that is needed."""
    waiting = [whole]
    for count in range(budget):
        if not waiting:
            return CONFIRMED
        segment = waiting.pop()
        if clear(segment):
            continue
        if not segment.halves or (count % _ASKED == 0 and time_is_up()):
            why = f"the clearance could not be shown near t = {segment.when[0]:.6g}"
            return Outcome(verdict="undecided", why=why)
        waiting.extend(segment.halves)
    return Outcome(verdict="undecided", why="the clearance could not be shown within the budget")


def _ends(ends: tuple[float, float]) -> tuple[Ball, Ball]:
    return exact(Fraction(ends[0])), exact(Fraction(ends[1]))


def somewhere(x: Ball) -> Fraction:
    """A number in the ball."""
    low, high = floor(x), ceiling(x)
    return (Fraction(low) + Fraction(high)) / 2


def _turned() -> Iterator[Point]:
    """Directions of length one, exact: tangents of half the angle that are multiples of 1/16, in all quarters."""
    for k in range(_TURNS):
        t = Fraction(k, _TURNS)
        cosine, sine = (1 - t**2) / (1 + t**2), 2 * t / (1 + t**2)
        yield cosine, sine
        yield -sine, cosine
        yield -cosine, -sine
        yield sine, -cosine


def _square(shape: Shape, c: Point) -> Fraction:
    """sup c'Wc at most: s(c)^2/dbar^2 of theory 4c."""
    product = 2 * c[0] * c[1]
    beside = max(product * value for value in shape.beside)
    return c[0] ** 2 * shape.diagonal[0] + c[1] ** 2 * shape.diagonal[1] + beside


def _tops(obstacle: Obstacle) -> Iterator[list[Fraction]]:
    """The largest c'o over every convex part, (4.12)."""
    if obstacle.center is not None and obstacle.radius is not None:
        center, radius = obstacle.center, obstacle.radius
        yield [c * center[0] + s * center[1] + radius for c, s in _turned()]
        return
    for a, b in pairwise((*obstacle.corners, obstacle.corners[0])):
        yield [max(c * a[0] + s * a[1], c * b[0] + s * b[1]) for c, s in _turned()]


def contains(corners: Sequence[Point], point: Point) -> bool:
    """Whether a polygon contains a point that is on none of its edges: how often a ray crosses them."""
    x, y = point
    crossed = 0
    for (ax, ay), (bx, by) in pairwise((*corners, corners[0])):
        if (ay <= y < by or by <= y < ay) and (bx - ax) * (y - ay) / (by - ay) + ax > x:
            crossed += 1
    return crossed % 2 == 1

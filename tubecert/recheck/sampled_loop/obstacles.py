"""Whether the tube keeps away from obstacles: rectangles about segments of the plan, halved where needed; exact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import inf, isfinite

from tubecert.recheck.clearances import along, contains, somewhere
from tubecert.recheck.cover import Outcome
from tubecert.recheck.curve import Segment
from tubecert.recheck.obstacles import Obstacle, Point
from tubecert.recheck.sampled_loop.record import Stage
from tubecert.recheck.sampled_loop.windows import Course
from tubecert.recheck.specified.numbers import Range


def cleared(course: Course, obstacle: Obstacle, stages: Sequence[Stage], budget: int) -> Outcome:
    """No rectangle of a stage that may last at a segment meets the obstacle, and the plan starts outside of it."""
    pair = [course.spec.plant.states.index(name) for name in obstacle.states]
    start = course.curve.somewhere()
    x, y = (somewhere(start[i]) for i in pair)
    if obstacle.radius is None and contains(obstacle.corners, (x, y)):
        return Outcome(verdict="undecided", why="the plan starts in the obstacle")

    def clear(segment: Segment) -> bool:
        widths, sides = _widths(course, segment, stages), [(i, *segment.x[i]) for i in pair]
        return all(isfinite(low) and isfinite(high) for _, low, high in sides) and _apart(
            obstacle, [(Fraction(low) - widths[i], Fraction(high) + widths[i]) for i, low, high in sides]
        )

    return along(course.curve.root, budget, clear)


def _widths(course: Course, segment: Segment, stages: Sequence[Stage]) -> list[Fraction]:
    """The widest stage that may last there: the plan's time is that of the loop, unless it repeats or is any."""
    spec = course.spec
    begin, end = segment.when
    horizon = spec.trajectory.horizon
    if horizon is None or spec.afterwards == "repeat" or course.family is not None or not course.curve.moves:
        begin, end = 0.0, inf
    elif spec.afterwards == "rest" and end >= float(horizon) * (1 - 1e-9):
        end = inf
    Ts = spec.hardware.sample_time
    ends = [own.start * Ts for own in stages[1:]]
    met = [
        own.half_widths
        for own, until in zip(stages, [*ends, None], strict=True)
        if own.start * Ts <= end and (until is None or until >= begin)
    ]
    return [max(own) for own in zip(*met, strict=True)]


def _apart(obstacle: Obstacle, box: Sequence[Range]) -> bool:
    if obstacle.center is not None and obstacle.radius is not None:
        away = [
            max(low - c, c - high, Fraction(0)) for c, (low, high) in zip(obstacle.center, box, strict=True)
        ]
        return away[0] ** 2 + away[1] ** 2 > obstacle.radius**2
    corners = obstacle.corners
    return all(_missed(a, b, box) for a, b in pairwise((*corners, corners[0])))


def _missed(a: Point, b: Point, box: Sequence[Range]) -> bool:
    """Whether an edge misses a rectangle: they are apart along an axis, or all corners are on one side of its line."""
    if any(max(a[k], b[k]) < box[k][0] or min(a[k], b[k]) > box[k][1] for k in (0, 1)):
        return True
    sides = [(b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]) for x in box[0] for y in box[1]]
    return min(sides) > 0 or max(sides) < 0

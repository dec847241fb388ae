"""Whether the tube keeps away from obstacles: rectangles about segments of the plan, halved where needed; exact."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from math import inf, isfinite

from tubecert.recheck.balls import ceiling, floor
from tubecert.recheck.clearances import contains
from tubecert.recheck.clock import time_is_up
from tubecert.recheck.cover import Outcome
from tubecert.recheck.curve import Segment
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.obstacles import Obstacle, Point
from tubecert.recheck.sampled_loop.record import Stage
from tubecert.recheck.sampled_loop.windows import Course
from tubecert.recheck.specified.numbers import Range


def cleared(course: Course, obstacle: Obstacle, stages: Sequence[Stage], budget: int) -> Outcome:
    """No rectangle of a stage that may last at a segment meets the obstacle, and the plan starts outside of it."""
    states = course.spec.plant.states
    pair = [states.index(name) for name in obstacle.states]
    start = [course.curve.somewhere()[i] for i in pair]
    x, y = ((Fraction(floor(own)) + Fraction(ceiling(own))) / 2 for own in start)
    if obstacle.radius is None and contains(obstacle.corners, (x, y)):
        return Outcome(verdict="undecided", why="the plan starts in the obstacle")
    waiting: list[Segment] = [course.curve.root]
    for count in range(budget):
        if not waiting:
            return CONFIRMED
        segment = waiting.pop()
        widths = _widths(course, segment, stages)
        sides = [segment.x[i] for i in pair]
        if all(map(isfinite, (*sides[0], *sides[1]))):
            box = [
                (Fraction(low) - widths[i], Fraction(high) + widths[i])
                for i, (low, high) in zip(pair, sides, strict=True)
            ]
            if _apart(obstacle, box):
                continue
        if not segment.halves or (count % 64 == 0 and time_is_up()):
            return Outcome(verdict="undecided", why=f"the tube may meet it near t = {segment.when[0]:.6g}")
        waiting.extend(segment.halves)
    return Outcome(verdict="undecided", why="it could not be shown within the budget")


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

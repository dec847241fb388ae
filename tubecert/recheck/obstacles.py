"""Obstacles as a certificate holds them: those of the specification, and what is stated of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, pairwise, product

from tubecert.recheck.document import Enclosure, Node, enclosure, one_of, reads

Point = tuple[Fraction, Fraction]
_MOST_CORNERS = 200


def _numbers(node: Node) -> Point:
    x, y = node.pair()
    return x.number(), y.number()


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A disc (radius) or a polygon (corners) in the plane of two states; whether the verdict asks for clearance."""

    states: tuple[str, str]
    corners: tuple[Point, ...]
    center: Point | None
    radius: Fraction | None
    decides: bool


@dataclass(frozen=True, slots=True)
class Shape:
    """Over the tube: W11, W22 <= `diagonal`, and W12 in `beside`."""

    diagonal: Point = reads(_numbers)
    beside: Point = reads(_numbers)


@dataclass(frozen=True, slots=True)
class Cleared:
    """What is stated of an obstacle."""

    verdict: str = reads(one_of("certified", "refuted", "undecided"))
    decides: bool = reads(Node.flag)
    clearance: Enclosure = reads(enclosure)
    shape: Shape = reads(lambda node: node.record(Shape))


def read_obstacle(node: Node, states: Sequence[str]) -> Obstacle:
    """An obstacle of the specification."""
    own = node.closed("states", optional=("polygon", "disc", "decide"))
    plane = own["states"].texts()
    if len(plane) != 2 or plane[0] == plane[1] or not set(plane) <= set(states):
        raise own["states"].refused("must name two states")
    if ("polygon" in own) == ("disc" in own):
        raise node.refused("must be a polygon or a disc")
    if own.get("decide", Node.flag) is True:
        raise own["decide"].refused("is there only where it is false")
    disc = own.get("disc", lambda at: at.closed("center", "radius"))
    corners = own.get("polygon", lambda rows: tuple(_point(row) for row in rows.entries())) or ()
    if disc is None and not (len(corners) <= _MOST_CORNERS and is_simple(corners)):
        raise node.refused(f"must be a polygon of <= {_MOST_CORNERS} edges that meet at common corners only")
    radius = None if disc is None else disc["radius"].exact()
    if radius is not None and radius <= 0:
        raise node.refused("must have a positive radius")
    return Obstacle(
        states=(plane[0], plane[1]),
        corners=corners,
        center=None if disc is None else _point(disc["center"]),
        radius=radius,
        decides="decide" not in own,
    )


def _point(node: Node) -> Point:
    x, y = node.pair()
    return x.exact(), y.exact()


# -- polygons: what lies inside is only clear for those whose edges meet at common corners, and nowhere else


def is_simple(corners: Sequence[Point]) -> bool:
    """Whether a closed chain of edges does not touch itself, decided exactly."""
    edges = list(pairwise((*corners, *corners[:1])))
    if len(corners) < 3 or any(a == b for a, b in edges):
        return False
    last = len(edges) - 1
    for i, j in combinations(range(len(edges)), 2):
        if j == i + 1 or (i, j) == (0, last):
            first, second = (edges[i], edges[j]) if j == i + 1 else (edges[j], edges[i])
            if _turns_back(*first, second[1]):
                return False
        elif _touch(edges[i], edges[j]):
            return False
    return True


def _area(a: Point, b: Point, c: Point) -> Fraction:
    """Twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _turns_back(a: Point, b: Point, c: Point) -> bool:
    """Whether the edge from b to c lies upon the one from a to b."""
    along = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return _area(a, b, c) == 0 and along < 0


def _touch(one: tuple[Point, Point], other: tuple[Point, Point]) -> bool:
    """Whether two edges have a point in common."""
    (a, b), (c, d) = one, other
    if any(max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]) for k in (0, 1)):
        return False  # as nearly all are: this takes a tenth of what follows
    sides = _area(a, b, c), _area(a, b, d), _area(c, d, a), _area(c, d, b)
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    ends = ((c, one), (d, one), (a, other), (b, other))
    return any(side == 0 and _spans(edge, p) for side, (p, edge) in zip(sides, ends, strict=True))


def _spans(edge: tuple[Point, Point], p: Point) -> bool:
    """Whether a point on the line of an edge lies on the edge."""
    (a, b) = edge
    return all(min(a[k], b[k]) <= p[k] <= max(a[k], b[k]) for k in (0, 1))


def apart(obstacle: Obstacle, box: Sequence[tuple[Fraction, Fraction]]) -> bool:
    """Whether a rectangle meets no edge of a polygon, or no point of a disc."""
    if obstacle.center is not None and obstacle.radius is not None:
        x, y = (max(a - c, c - b, Fraction(0)) for c, (a, b) in zip(obstacle.center, box, strict=True))
        return x**2 + y**2 > obstacle.radius**2
    return all(_missed(edge, box) for edge in pairwise((*obstacle.corners, obstacle.corners[0])))


def _missed(edge: tuple[Point, Point], box: Sequence[tuple[Fraction, Fraction]]) -> bool:
    """Whether an edge and a rectangle are apart along an axis, or all corners are on one side of the edge's line."""
    if any(
        max(ends) < low or min(ends) > high
        for ends, (low, high) in zip(zip(*edge, strict=True), box, strict=True)
    ):
        return True
    sides = [_area(*edge, (x, y)) for x, y in product(*box)]
    return min(sides) > 0 or max(sides) < 0

"""The section `obstacles`: polygons and discs in the plane of two states."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Final

from tubecert.spec import codes
from tubecert.spec.document import Scalar
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.types import Obstacle, Vector

KEYS: Final = ("states", "polygon", "disc", "decide")
DISC_KEYS: Final = ("center", "radius")
MAX_OBSTACLES: Final = 1_000
MAX_VERTICES: Final = 200

Segment = tuple[Vector, Vector]


def read_obstacles(field: Field | None, names: Names) -> tuple[Obstacle, ...] | None:
    """The obstacles in the order of the file; None if one of them is unsound."""
    if field is None:
        return ()
    items = field.items(None, "obstacles")
    if items is None:
        return None
    if len(items) > MAX_OBSTACLES:
        field.fail(codes.LIMIT, f"there are {len(items)} obstacles; at most {MAX_OBSTACLES} are read")
        return None
    found = [_obstacle(item, names) for item in items]
    kept = tuple(obstacle for obstacle in found if obstacle)
    return kept if len(kept) == len(items) else None


def _obstacle(field: Field, names: Names) -> Obstacle | None:
    entries = field.mapping(optional=KEYS)
    if entries is None:
        return None
    plane = read_plane(entries.get("states"), field, names)
    if ("polygon" in entries) == ("disc" in entries):
        message = "an obstacle is either a polygon or a disc"
        help = "write polygon: [[...], ...], or disc: {center: [...], radius: r}"
        field.fail(codes.MISSING_KEY, message, help)
        return None
    decides = entries["decide"].word(("true", "false")) != "false" if "decide" in entries else True
    if "polygon" in entries:
        corners = _polygon(entries["polygon"], names)
        return Obstacle(states=plane, polygon=corners, decides=decides) if plane and corners else None
    disc = _disc(entries["disc"], plane, names)
    return None if disc is None else replace(disc, decides=decides)


def read_plane(field: Field | None, owner: Field, names: Names) -> tuple[str, str] | None:
    """Two different states, by default the only two that there are."""
    if field is None:
        if len(names.states) == 2:
            return names.states[0], names.states[1]
        owner.fail(codes.MISSING_KEY, "the obstacle lacks states", f"add states: [{_example(names)}]")
        return None
    items = field.items(2, "names of states", f"write [{_example(names)}]") or []
    chosen = [item.word(names.states) for item in items]
    if len(chosen) != 2 or chosen[0] is None or chosen[1] is None:
        return None
    if chosen[0] == chosen[1]:
        items[1].fail(codes.RANGE, f"{chosen[1]} occurs twice", f"write [{_example(names)}]")
        return None
    return chosen[0], chosen[1]


def _example(names: Names) -> str:
    return ", ".join(names.states[:2])


def _disc(field: Field, plane: tuple[str, str] | None, names: Names) -> Obstacle | None:
    entries = field.mapping(required=DISC_KEYS)
    if entries is None:
        return None
    center = entries["center"].numbers(2, names.values) if "center" in entries else None
    radius = entries["radius"].number(names.values, above=0, side="above") if "radius" in entries else None
    if plane is None or center is None or radius is None:
        return None
    return Obstacle(states=plane, center=center, radius=radius)


def _polygon(field: Field, names: Names) -> tuple[Vector, ...] | None:
    """The corners of a simple polygon: its edges meet at common corners only."""
    if isinstance(field.node, Scalar):
        field.items(None, "corners")
        return None
    items = field.items(None, "corners") or []
    if not 3 <= len(items) <= MAX_VERTICES:
        field.fail(codes.WRONG_SHAPE, f"{field.path} has {len(items)} corners; it needs 3 to {MAX_VERTICES}")
        return None
    corners = [item.numbers(2, names.values) for item in items]
    found = tuple(corner for corner in corners if corner is not None)
    if len(found) < len(items):
        return None
    for i, j in _crossings(found):
        items[j].fail(
            codes.RANGE,
            f"{field.path}: the edges from corners {i + 1} and {j + 1} touch or cross",
            "list the corners once, in the order in which one meets them going round",
        )
        return None
    return found


def _crossings(corners: tuple[Vector, ...]) -> Iterator[tuple[int, int]]:
    """Pairs of edges, by their first corners, that have more in common than a corner between them (exact)."""
    count = len(corners)
    edges = [(corners[i], corners[(i + 1) % count]) for i in range(count)]
    for i, j in combinations(range(count), 2):
        follows, precedes = j == i + 1, (j + 1) % count == i
        if follows or precedes:
            first, second = (edges[i], edges[j]) if follows else (edges[j], edges[i])
            if _folded(first, second):
                yield i, j
        elif _meet(edges[i], edges[j]):
            yield i, j


def _turn(a: Vector, b: Vector, c: Vector) -> int:
    """1 if a, b, c turn left, -1 if right, 0 if they are on a line."""
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return (area > 0) - (area < 0)


def _folded(first: Segment, second: Segment) -> bool:
    """Whether an edge runs back along the one before it, or has no length."""
    (a, b), (_, c) = first, second
    if b in (a, c):
        return True
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return _turn(a, b, c) == 0 and ahead < 0


def _meet(first: Segment, second: Segment) -> bool:
    """Whether two segments have a point in common."""
    (a, b), (c, d) = first, second
    turns = _turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)
    if turns[0] != turns[1] and turns[2] != turns[3]:
        return True
    return any(
        turn == 0 and _between(ends, point)
        for turn, ends, point in zip(turns, (first, first, second, second), (c, d, a, b), strict=True)
    )


def _between(ends: Segment, point: Vector) -> bool:
    """Whether a point on the line of a segment lies in the segment's bounding box."""
    return all(min(p, q) <= value <= max(p, q) for p, q, value in zip(*ends, point, strict=True))

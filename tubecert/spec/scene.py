"""The sections `obstacles` and `simulation`: what stands around, and what `simulate` does, which proves nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from typing import Any, Final

from tubecert import letters
from tubecert.spec import codes, keys
from tubecert.spec.keys import PAIR, YES, Kind, expressions, inside, key, number, section
from tubecert.spec.names import Names
from tubecert.spec.plan import Trajectory
from tubecert.spec.reader import Field, whole
from tubecert.spec.values import Matrix, Term, Vector

CONTROLLERS: Final = ("nominal", "ccm", "reference", "l1")
MAX_OBSTACLES: Final = 1_000
MAX_VERTICES: Final = 200
MAX_RUNS: Final = 1_000_000
MAX_SEED: Final = 2**63 - 1

Segment = tuple[Vector, Vector]

_GAINS: Final = letters.words_of(letters.ADAPTIVE)
_CORNERS: Final = {"type": "array", "items": PAIR, "minItems": 3, "maxItems": MAX_VERTICES}
_CONTROLLER: Final = {"enum": list(CONTROLLERS), "description": "A controller."}
_PLANE: Final = {"type": "array", "items": keys.NAME, "minItems": 2, "maxItems": 2}


def _read_plane(field: Field, names: Names) -> tuple[str, str] | None:
    """Two different states."""
    help = f"write [{', '.join(names.states[:2])}]"
    items = field.items(2, "names of states", help) or []
    chosen = [item.word(names.states) for item in items]
    if len(chosen) != 2 or chosen[0] is None or chosen[1] is None:
        return None
    if chosen[0] == chosen[1]:
        return items[1].fail(codes.RANGE, f"{chosen[1]} occurs twice", help)
    return chosen[0], chosen[1]


def _polygon(field: Field, names: Names) -> Matrix | None:
    """The corners of a simple polygon: its edges meet at common corners only."""
    if field.node.kind == "scalar":
        field.items(None, "corners")
        return None
    items = field.items(None, "corners") or []
    if not 3 <= len(items) <= MAX_VERTICES:
        return field.fail(
            codes.WRONG_SHAPE, f"{field.path} has {len(items)} corners; it needs 3 to {MAX_VERTICES}"
        )
    found = whole(item.numbers(2, names.values) for item in items)
    for i, j in _crossings(found or ()):
        message = f"{field.path}: the edges from corners {i + 1} and {j + 1} touch or cross"
        help = "list the corners once, in the order in which one meets them going round"
        return items[j].fail(codes.RANGE, message, help)
    return found


def _crossings(corners: Matrix) -> Iterator[tuple[int, int]]:
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
    a, b, c = *first, second[1]
    return _turn(a, b, c) == 0 and (_between(first, c) or _between(second, a))


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Disc:
    """A disc."""

    center: Vector = key(keys.numbers(2, PAIR))
    """Its centre."""
    radius: Fraction = key(number(above=0, side="above"))
    """Its radius; > 0."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """An obstacle: a polygon or a disc.

    In the plane of two states, corners (K, 2) of the one; `decides`: whether the verdict asks for clearance from it.
    """

    states: tuple[str, str] = key(Kind(_read_plane, _PLANE), late=True, needed=False, example=["px", "pz"])
    """The two states of its plane; may be left out if there are only two."""
    polygon: Matrix = key(
        Kind(_polygon, _CORNERS, keys.rows_of_numbers), (), example=[[0.5, 0.5], [0.9, 0.5], [0.7, 0.9]]
    )
    """Corners, once each, in the order in which one meets them going round."""
    disc: Disc | None = key(inside(section(Disc)), None)
    decides: bool = key(replace(YES, write=lambda told, _: told), True, name="decide", said=True)
    """false: the clearance is told and does not decide the verdict."""

    def __post_init__(self) -> None:
        assert (len(self.polygon) >= 3) == (self.disc is None)

    @property
    def center(self) -> Vector:
        """The centre of a disc."""
        return self.disc.center if self.disc else ()

    @property
    def radius(self) -> Fraction | None:
        """The radius of a disc; None of a polygon."""
        return self.disc.radius if self.disc else None

    def contains(self, x: Fraction | float, y: Fraction | float) -> bool:
        """Whether a point that is on no edge lies in it, exactly for fractions: by Jordan's lemma for polygons."""
        if self.radius is not None:
            return bool((x - self.center[0]) ** 2 + (y - self.center[1]) ** 2 <= self.radius**2)
        inside = False
        for (ax, ay), (bx, by) in zip(self.polygon, (*self.polygon[1:], self.polygon[0]), strict=True):
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                inside = not inside
        return inside


OBSTACLE: Final = section(Obstacle, oneOf=[{"required": ["polygon"]}, {"required": ["disc"]}])


def read_obstacles(field: Field, names: Names) -> tuple[Obstacle, ...] | None:
    """The obstacles in the order of the file; None if one of them is unsound."""
    items = field.items(None, "obstacles")
    if items is None:
        return None
    if len(items) > MAX_OBSTACLES:
        return field.fail(codes.LIMIT, f"there are {len(items)} obstacles; at most {MAX_OBSTACLES} are read")
    return whole(_obstacle(item, names) for item in items)


def _obstacle(field: Field, names: Names) -> Obstacle | None:
    entries = OBSTACLE.entries(field)
    if entries is None:
        return None
    plane = _plane(entries.get("states"), field, names)
    if ("polygon" in entries) == ("disc" in entries):
        message = "an obstacle is either a polygon or a disc"
        help = "write polygon: [[...], ...], or disc: {center: [...], radius: r}"
        return field.fail(codes.MISSING_KEY, message, help)
    found = OBSTACLE.sound(entries, names)
    return None if plane is None or found is None else Obstacle(states=plane, **found)


def _plane(field: Field | None, owner: Field, names: Names) -> tuple[str, str] | None:
    """Two different states, by default the only two that there are."""
    if field is not None:
        return _read_plane(field, names)
    if len(names.states) == 2:
        return names.states[0], names.states[1]
    help = f"add states: [{', '.join(names.states[:2])}]"
    return owner.fail(codes.MISSING_KEY, "the obstacle lacks states", help)


def obstacles_data(obstacles: Iterable[Obstacle], spec: Any) -> list[dict[str, Any]]:
    """The canonical form; that one decides goes without saying."""
    found = (OBSTACLE.written(own, spec) for own in obstacles)
    return [{name: told for name, told in own.items() if told is not True} for own in found]


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """What `simulate` does if the command line does not say otherwise. It proves nothing.

    h (m) is the uncertainty that acts in place of `uncertainty.h`.
    """

    controllers: tuple[str, ...] = key(
        keys.several(
            CONTROLLERS, "controller", "controllers", items=_CONTROLLER, minItems=1, uniqueItems=True
        ),
        (),
        example=["ccm", "l1"],
    )
    """The loops to run, each once."""
    gains: str | None = key(
        keys.word(*_GAINS, also=(26,), means={each: letters.name_of(each).option for each in _GAINS}), None
    )
    """Whose gains of a certificate are used."""
    duration: Fraction | None = key(number(above=0), None)
    """How long is simulated, in s; at most the horizon."""
    runs: int | None = key(number(least=1, most=MAX_RUNS, whole=""), None)
    """Number of random runs; a whole number."""
    seed: int | None = key(number(least=0, most=MAX_SEED, whole=""), None)
    """Seed of the random runs; a whole number."""
    plane: tuple[str, str] | None = key(Kind(_read_plane, _PLANE), None)
    """The two states that are drawn."""
    h: tuple[Term, ...] | None = key(expressions("inputs", "uncertainty"), None)
    """The uncertainty to simulate, one expression of t and the states per input; by default the one of
    `uncertainty`."""


SIMULATION: Final = section(Simulation)


def read_simulation(field: Field | None, plan: Trajectory | None, names: Names) -> Simulation | None:
    """Defaults of the command `simulate`; None if the section is absent or unsound."""
    entries = SIMULATION.entries(field)
    if entries is None:
        return None
    values = SIMULATION.values(entries, names)
    duration, horizon = values.get("duration"), plan and plan.horizon
    if duration is not None and horizon is not None and duration > horizon:
        message = "the duration exceeds trajectory.horizon"
        return entries["duration"].fail(codes.RANGE, message, "the plan ends there")
    return Simulation(**values) if SIMULATION.holds(values, entries) else None

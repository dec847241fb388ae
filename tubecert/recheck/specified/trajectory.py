"""The plan that a specification names, and the start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.grammar import Owed
from tubecert.recheck.specified.numbers import (
    TIME,
    Column,
    Numbers,
    Range,
    Reader,
    not_negative,
    positive,
    several,
    span,
    square,
    whole,
)
from tubecert.recheck.specified.plant import Plant


@dataclass(frozen=True, slots=True)
class Resting:
    """A plan that stays at a point: for ever, or until the horizon."""

    at: Numbers
    input: Numbers
    horizon: Fraction | None
    kind: str = "equilibrium"


@dataclass(frozen=True, slots=True)
class Expressed:
    """x* and u* as expressions of t on [0, horizon]."""

    x: Column
    u: Column
    horizon: Fraction
    duties: tuple[Owed, ...]
    kind: str = "expressions"


@dataclass(frozen=True, slots=True)
class Tabled:
    """A plan from a file: its knots are in the certificate."""

    between: str  # hold, linear, hermite-simpson
    horizon: Fraction
    kind: str = "csv"


@dataclass(frozen=True, slots=True)
class Planned:
    """A plan from `start` that the planner made: its knots are in the certificate; with a goal it ends in `target`."""

    start: Numbers
    target: Numbers
    goal: bool
    between: str  # hold, linear
    horizon: Fraction
    kind: str = "ilqr"


@dataclass(frozen=True, slots=True)
class AnyPlan:
    """Every plan with x* and u* in boxes, by name, and |x*' - f - B u*| <= `defect`.

    `input_rate` (m): |u_j*'| where it is bounded; None in a sampled loop: u* is held as its inputs are.
    """

    x: dict[str, Range]
    u: dict[str, Range]
    defect: Fraction
    horizon: Fraction | None
    kind: str = "any"
    input_rate: Numbers | None = None


Trajectory = Resting | Expressed | Tabled | Planned | AnyPlan


def read_trajectory(node: Node, plant: Plant) -> Trajectory:
    """`trajectory`, by its kind."""
    kind, n, m = node.mapping().get("kind"), len(plant.states), len(plant.inputs)
    if kind == "any":
        return _any(node, plant)
    if kind == "expressions":
        return _expressed(node, plant)
    readers: dict[object, Callable[[Node, int, int], Trajectory]] = {
        "equilibrium": _resting,
        "csv": _tabled,
        "ilqr": _planned,
    }
    if not isinstance(kind, str) or kind not in readers:
        raise node.refused(f"must have a kind, one of {', '.join(map(str, readers))}, expressions, any")
    return readers[kind](node, n, m)


def read_lasting(node: Node, plant: Plant) -> tuple[Trajectory, str]:
    """The plan of a sampled loop, and what holds when its horizon is over: nothing, rest or repeat."""
    own = dict(node.items())
    if ("afterwards" in own) != ("horizon" in own):
        raise node.refused("must say what holds afterwards if it has a horizon, and only then")
    plan = read_trajectory(node.without("afterwards", "input_rate"), plant)
    words = ("nothing",) if isinstance(plan, AnyPlan) else ("nothing", "rest", "repeat")
    after = own["afterwards"].word(*words) if "afterwards" in own else "nothing"
    if "input_rate" not in own:
        return plan, after
    if not isinstance(plan, AnyPlan):
        raise own["input_rate"].refused("is not known in this place")
    rates = own["input_rate"].closed(*plant.inputs)
    return replace(plan, input_rate=tuple(not_negative(rates[name]) for name in plant.inputs)), after


def _resting(node: Node, n: int, m: int) -> Resting:
    own = node.closed("kind", "at", "input", optional=("horizon",))
    return Resting(several(own["at"], n), several(own["input"], m), own.get("horizon", positive))


def _expressed(node: Node, plant: Plant) -> Expressed:
    own = node.closed("kind", "x", "u", "horizon")
    reader = Reader.of((TIME,), plant.tables)
    x, u = reader.column(own["x"], len(plant.states)), reader.column(own["u"], len(plant.inputs))
    return Expressed(x, u, positive(own["horizon"]), tuple(reader.duties))


def _any(node: Node, plant: Plant) -> AnyPlan:
    own = node.closed("kind", "x", "u", "defect", optional=("horizon",))
    x, u = (
        {name: span(ends[name]) for name in names}
        for names, ends in (
            (plant.states, own["x"].closed(*plant.states)),
            (plant.inputs, own["u"].closed(*plant.inputs)),
        )
    )
    return AnyPlan(x, u, not_negative(own["defect"]), own.get("horizon", positive))


def _tabled(node: Node, n: int, m: int) -> Tabled:
    del n, m
    own = node.closed("kind", "file", "interpolation", "horizon")
    own["file"].text()
    between = own["interpolation"].word("hold", "linear", "hermite-simpson")
    return Tabled(between, positive(own["horizon"]))


def _planned(node: Node, n: int, m: int) -> Planned:
    keys = ("kind", "start", "target", "knots", "Q", "R", "goal", "interpolation", "horizon")
    own = node.closed(*keys, optional=("input",))
    own.get("input", lambda item: several(item, m))
    square(own["Q"], n)
    square(own["R"], m)
    whole(own["knots"])
    return Planned(
        start=several(own["start"], n),
        target=several(own["target"], n),
        goal=own["goal"].word("true", "false") == "true",
        between=own["interpolation"].word("hold", "linear"),
        horizon=positive(own["horizon"]),
    )


_MOST_WIDE = 10  # sides of a box of starts: all its corners are examined


@dataclass(frozen=True, slots=True)
class Start:
    """x(0): a point, anything within a radius of x*(0), or anything in a box."""

    at: Numbers | None
    within: Fraction | None
    box: dict[str, Range] | None


def read_start(node: Node, states: Sequence[str]) -> Start:
    """The start; a claim says it in the same words."""
    own = node.closed(optional=("at", "within", "box"))
    if len(node.mapping()) != 1:
        raise node.refused("must be `at`, `within` or `box`")
    return Start(
        own.get("at", lambda item: several(item, len(states))),
        own.get("within", not_negative),
        own.get("box", lambda item: _start_box(item, states)),
    )


def _start_box(node: Node, states: Sequence[str]) -> dict[str, Range]:
    """A range for every state, which may be a point, but not all of them."""
    own = node.closed(*states)
    box: dict[str, Range] = {}
    for name in states:
        box[name] = span(own[name])
    if not 0 < sum(low < high for low, high in box.values()) <= _MOST_WIDE:
        raise node.refused(f"must have a width in 1 to {_MOST_WIDE} states")
    return box

"""The section `initial_state`: where the system starts."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Final

from tubecert.digits import near
from tubecert.expression import ZERO, Expression, number_text, substitute, to_text
from tubecert.expression.balls import values
from tubecert.spec import codes
from tubecert.spec.keys import LIST, PAIR, by_name, form, key, number, numbers_text, section
from tubecert.spec.names import TIME, Names
from tubecert.spec.plan import Trajectory, read_ends
from tubecert.spec.reader import Field, whole
from tubecert.spec.values import Ends, Vector

_AT: Final = {"anyOf": [LIST, {"$ref": "#/$defs/start_by_state"}], "examples": [[0.01, 0], {"phi": "30 deg"}]}
_BOX: Final = by_name(PAIR)
MAX_WIDE: Final = 10  # sides of a box of starts: all its corners are examined


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState:
    """Where the system starts: a point, anywhere in a box, or anywhere within a radius of the plan's start. By default
    on the plan.

    `x0` None if unreadable, the centre of the `box` (n pairs) if there is one.
    """

    x0: Vector | None = key(form(_AT), None, name="at")
    """The initial state: one number per state, or numbers by state (others start on the plan)."""
    within: Fraction | None = key(number(above=0, side="above"), None)
    """Radius around the plan's start, in the Euclidean norm; > 0."""
    box: tuple[Ends, ...] = key(form(_BOX), (), example={"x": [-0.1, 0.1]})
    """[lower, upper] by state: the claim is for every start in the box. States that are not named start on the plan."""


INITIAL_STATE: Final = section(InitialState, oneOf=[{"required": [way]} for way in ("at", "box", "within")])


def initial_state_data(x0: Vector, spec: Any) -> dict[str, Any]:
    """The canonical form: the one of the three ways that counts."""
    if spec.within is not None:
        return {"within": number_text(spec.within)}
    ends = zip(spec.states, map(numbers_text, spec.start_box), strict=False)
    return {"box": dict(ends)} if spec.start_box else {"at": numbers_text(x0)}


def read_initial_state(
    field: Field | None, trajectory: Field | None, plan: Trajectory | None, names: Names
) -> InitialState:
    """The initial state, by default the start of the plan."""

    def planned(given: Collection[str] = ()) -> Vector | None:
        return _start(trajectory, plan, names, given) if trajectory and plan else None

    nowhere, where = InitialState(), field or trajectory
    if where and plan and plan.bundle and (field is None or field.get("within") is None):
        help = "write initial_state: {within: r}: how far from the start of its plan the state may be"
        return where.fail(codes.MISSING_KEY, "a family of plans has no start of its own", help) or nowhere
    if field is None:
        return InitialState(x0=planned())
    entries = INITIAL_STATE.entries(field)
    if entries is None:
        return nowhere
    if len(entries) != 1:
        message = "the initial state is a point, a box, or a radius around the plan's start"
        help = "write at: [...], box: {x: [low, high], ...}, or within: r"
        return field.fail(codes.MISSING_KEY, message, help) or nowhere
    if "within" in entries:
        radius = entries["within"].number(names.values, above=0, side="above")
        return InitialState(x0=planned(), within=radius)
    (given,) = entries.values()
    box = _box(given, planned, names, point="at" in entries) or ()
    if (wide := sum(low < high for low, high in box)) > MAX_WIDE:
        message = f"the box of starts has {wide} sides of some width; at most {MAX_WIDE} are read"
        return field.fail(codes.LIMIT, message) or nowhere
    return InitialState(x0=tuple((low + high) / 2 for low, high in box) or None, box=box if wide else ())


def _box(
    field: Field, planned: Callable[[Collection[str]], Vector | None], names: Names, *, point: bool
) -> tuple[Ends, ...] | None:
    """Values or ranges of every state, or by state; a state that is not named starts on the plan."""
    if field.node.kind != "mapping":
        items = field.items(len(names.states), "numbers") or ()
        return whole(read_ends(item, names, point=point) for item in items)
    entries = field.mapping(optional=names.states)
    if entries is None:
        return None
    start = planned(entries) if len(entries) < len(names.states) else None
    others: Sequence[Ends | None] = [(own, own) for own in start] if start else [None] * len(names.states)
    return whole(
        read_ends(entries[name], names, point=point) if name in entries else other
        for name, other in zip(names.states, others, strict=True)
    )


def _start(field: Field, plan: Trajectory, names: Names, given: Collection[str]) -> Vector | None:
    """x*(0), which must be rational; where it is not, 0 stands in for a state whose start is `given` anyhow."""
    if plan.table is not None:
        return plan.table.knots.x[0]
    if plan.bundle is not None:
        return tuple((low + high) / 2 for low, high in plan.bundle.x)  # one of the starts that there may be
    if plan.task is not None:
        if not plan.task.start:
            help = "add initial_state: {at: [...]}, or trajectory.start"
            return field.fail(codes.MISSING_KEY, "the planner needs a start", help)
        return plan.task.start
    start: dict[str, Expression] = {}
    for name, term in zip(names.states, plan.x, strict=True):
        try:
            start[name] = substitute([term.expression], {TIME: ZERO})[0]
        except ZeroDivisionError:
            message = "the plan is not defined at t = 0"
            return field.reader.report(codes.RANGE, term.location, message, "the horizon begins at t = 0")
    known = {name: value.fraction for name, value in start.items() if value.is_constant}
    strange = [name for name in start if name not in known and name not in given]
    if not strange:
        return tuple(known.get(name, Fraction(0)) for name in names.states)
    found = values([start[name] for name in strange], {}) or ()
    at = ", ".join(f"{name}: {near(float(own.mid()), 12)}" for name, own in zip(strange, found, strict=False))
    message = f"the plan starts at {strange[0]} = {to_text(start[strange[0]])[:60]}, which is not rational"
    help = f"write decimals near it: initial_state: {{at: {{{at}}}}}, or a box that has them in it"
    place = plan.x[names.states.index(strange[0])].location
    return field.reader.report(codes.MISSING_KEY, place, message, help)

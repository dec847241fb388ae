"""The sections `trajectory` and `initial_state`."""

from __future__ import annotations

from fractions import Fraction

from tubecert.expression import ZERO, constant, substitute, to_text
from tubecert.spec import codes
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field
from tubecert.spec.types import Term, Trajectory, Vector

KINDS = ("equilibrium", "expressions")
LATER_KINDS = ("csv", "ilqr")


def read_trajectory(field: Field, names: Names) -> Trajectory | None:
    """The plan."""
    kind = _kind(field)
    if kind == "equilibrium":
        return _equilibrium(field, names)
    if kind == "expressions":
        return _expressions(field, names)
    return None


def _kind(field: Field) -> str | None:
    pairs = field.pairs("with a kind: equilibrium or expressions")
    if pairs is None:
        return None
    kind = next((field.child(key, node) for key, node in pairs if key.text == "kind"), None)
    if kind is None:
        field.fail(codes.MISSING_KEY, "trajectory lacks kind", f"add kind: {' or '.join(KINDS)}")
        return None
    return kind.word(KINDS, LATER_KINDS)


def _equilibrium(field: Field, names: Names) -> Trajectory | None:
    entries = field.mapping(required=("kind", "at"), optional=("input", "horizon"))
    if entries is None:
        return None
    n, m = len(names.states), len(names.inputs)
    x = _constants(entries.get("at"), n, names)
    u: tuple[Term, ...] | None
    if "input" in entries:
        u = _constants(entries["input"], m, names)
    else:
        u = tuple(_constant_term(field, Fraction(0)) for _ in range(m))
    horizon, sound = _horizon(entries.get("horizon"), names)
    if x is None or u is None or not sound:
        return None
    return Trajectory(kind="equilibrium", x=x, u=u, horizon=horizon)


def _expressions(field: Field, names: Names) -> Trajectory | None:
    entries = field.mapping(required=("kind", "x", "u", "horizon"))
    if entries is None:
        return None
    scope = names.of_plan()
    x = entries["x"].terms(len(names.states), scope, "expressions, one per state") if "x" in entries else None
    u = entries["u"].terms(len(names.inputs), scope, "expressions, one per input") if "u" in entries else None
    horizon, _ = _horizon(entries.get("horizon"), names)
    if x is None or u is None or horizon is None:
        return None
    return Trajectory(kind="expressions", x=x, u=u, horizon=horizon)


def _horizon(field: Field | None, names: Names) -> tuple[Fraction | None, bool]:
    """The horizon in s, and whether what is written is sound."""
    if field is None:
        return None, True
    horizon = field.number(names.values, above=0)
    return horizon, horizon is not None


def _constants(field: Field | None, count: int, names: Names) -> tuple[Term, ...] | None:
    items = field.items(count, "numbers") if field else None
    terms = [(item, item.number(names.values)) for item in items or []]
    found = tuple(_constant_term(item, value) for item, value in terms if value is not None)
    return found if len(found) == count else None


def _constant_term(field: Field, value: Fraction) -> Term:
    e = constant(value)
    return Term(expression=e, obligations=(), places=(), text=to_text(e), location=field.location)


def read_initial_state(
    field: Field | None, trajectory: Field | None, plan: Trajectory | None, names: Names
) -> Vector | None:
    """The initial state; by default the start of the plan."""
    if field is None:
        return _start(trajectory, plan) if trajectory and plan else None
    entries = field.mapping(required=("at",), reserved=("within",))
    if entries is None or "at" not in entries:
        return None
    return entries["at"].numbers(len(names.states), names.values)


def _start(field: Field, plan: Trajectory) -> Vector | None:
    """x*(0), if it is rational."""
    start = []
    for term in plan.x:
        try:
            value = substitute([term.expression], {TIME: ZERO})[0]
        except ZeroDivisionError:
            message = "the plan is not defined at t = 0"
            field.reader.report(codes.RANGE, term.location, message, "the horizon begins at t = 0")
            return None
        if not value.is_constant:
            field.reader.report(
                codes.MISSING_KEY,
                term.location,
                f"the plan starts at {to_text(value)[:60]}, which is not rational; initial_state is needed",
                "add initial_state: {at: [...]}",
            )
            return None
        start.append(value.fraction)
    return tuple(start)

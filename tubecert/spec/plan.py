"""The sections `trajectory` and `initial_state`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, get_args

from tubecert.expression import ZERO, ExpressionError, constant, parse_number, substitute, to_text
from tubecert.spec import codes
from tubecert.spec.algebra import is_positive_definite, is_positive_semidefinite
from tubecert.spec.document import MappingNode, Scalar
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field
from tubecert.spec.table import read_table
from tubecert.spec.types import (
    Afterwards,
    Bundle,
    Interpolation,
    Matrix,
    PlanKind,
    Task,
    Term,
    Trajectory,
    Uncertainty,
    Vector,
)

KINDS: Final[tuple[PlanKind, ...]] = get_args(PlanKind)
_AFTERWARDS: Final[tuple[Afterwards, ...]] = get_args(Afterwards)
MAX_KNOTS: Final = 2_001
MAX_WIDE: Final = 10  # sides of a box of starts: all its corners are examined

_KNOTS: Final = 101

_OF_FILES: tuple[Interpolation, ...] = ("hold", "linear", "hermite-simpson")


def read_trajectory(field: Field, names: Names) -> Trajectory | None:
    """The plan; what a planner's start is by default is not known yet (see `completed`)."""
    readers = {
        "equilibrium": _equilibrium,
        "expressions": _expressions,
        "csv": _csv,
        "ilqr": _ilqr,
        "any": _any,
    }
    kind = _kind(field)
    plan = readers[kind](field, names) if kind else None
    return _continued(field.get("afterwards"), plan) if plan else None


def _continued(field: Field | None, plan: Trajectory) -> Trajectory | None:
    """The plan with what holds when its horizon is over."""
    if field is None:
        return plan
    word = field.word(_AFTERWARDS)
    if plan.horizon is None:
        help = "the plan lasts for ever: leave afterwards out, or give trajectory.horizon, in s"
        field.fail(codes.RANGE, f"{field.path} without a horizon", help)
    elif plan.bundle is not None and word in ("rest", "repeat"):
        help = "leave the horizon out: a family without one lasts for ever"
        field.fail(codes.RANGE, f"{field.path} is {word}, and a family of plans has no end of its own", help)
    return next(
        (replace(plan, afterwards=each) for each in _AFTERWARDS if each == word and plan.horizon), None
    )


def at_rest(
    field: Field, box: Sequence[tuple[Fraction, Fraction]], inputs: int
) -> tuple[Trajectory, Uncertainty]:
    """Rest in the middle of a box, and no uncertainty: where a plan is of no account. `field` is what it is about."""
    x = tuple(_constant_term(field, (low + high) / 2) for low, high in box)
    none = no_uncertainty(field, inputs)
    return Trajectory(kind="equilibrium", x=x, u=none.h or (), horizon=None), none


def no_uncertainty(field: Field, inputs: int) -> Uncertainty:
    """h = 0, where nothing is said of it."""
    return Uncertainty(h=tuple(_constant_term(field, Fraction(0)) for _ in range(inputs)), bounds=None)


def _kind(field: Field) -> str | None:
    pairs = field.pairs(f"with a kind: {' or '.join(KINDS)}")
    if pairs is None:
        return None
    kind = field.get("kind")
    if kind is None:
        field.fail(codes.MISSING_KEY, "trajectory lacks kind", f"add kind: {' or '.join(KINDS)}")
        return None
    return kind.word(KINDS)


def _equilibrium(field: Field, names: Names) -> Trajectory | None:
    entries = field.mapping(required=("kind", "at"), optional=("input", "horizon", "afterwards"))
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
    entries = field.mapping(required=("kind", "x", "u", "horizon"), optional=("afterwards",))
    if entries is None:
        return None
    scope = names.of_plan()
    x = entries["x"].terms(len(names.states), scope, "expressions, one per state") if "x" in entries else None
    u = entries["u"].terms(len(names.inputs), scope, "expressions, one per input") if "u" in entries else None
    horizon, _ = _horizon(entries.get("horizon"), names)
    if x is None or u is None or horizon is None:
        return None
    return Trajectory(kind="expressions", x=x, u=u, horizon=horizon)


def _csv(field: Field, names: Names) -> Trajectory | None:
    entries = field.mapping(required=("kind", "file"), optional=("interpolation", "horizon", "afterwards"))
    if entries is None:
        return None
    interpolation, sound = _interpolation(entries.get("interpolation"), "linear", _OF_FILES)
    horizon, readable = _horizon(entries.get("horizon"), names)
    table = read_table(entries["file"], names, interpolation) if "file" in entries else None
    if table is None or not sound or not readable:
        return None
    last = table.knots.t[-1]
    if horizon is not None and horizon > last:
        help = f"give a horizon of at most {to_text(constant(last))}, or leave it out"
        entries["horizon"].fail(codes.RANGE, "the horizon lies beyond the plan's last time", help)
        return None
    return Trajectory(kind="csv", horizon=last if horizon is None else horizon, table=table)


def _ilqr(field: Field, names: Names) -> Trajectory | None:
    optional = ("start", "input", "knots", "Q", "R", "goal", "interpolation", "afterwards")
    entries = field.mapping(required=("kind", "target", "horizon"), optional=optional)
    if entries is None:
        return None
    before = len(field.reader.findings)
    n, m = len(names.states), len(names.inputs)
    points = {
        key: entries[key].numbers(count, names.values) if key in entries else None
        for key, count in (("target", n), ("start", n), ("input", m))
    }
    horizon, _ = _horizon(entries.get("horizon"), names)
    knots = _count(entries.get("knots"), names)
    Q = _weight(entries.get("Q"), n, names, definite=False)
    R = _weight(entries.get("R"), m, names, definite=True)
    goal = entries["goal"].word(("true", "false")) if "goal" in entries else "true"
    interpolation, _ = _interpolation(entries.get("interpolation"), "hold")
    target = points["target"]
    if len(field.reader.findings) > before or target is None or horizon is None or not (knots and Q and R):
        return None
    task = Task(
        start=points["start"] or (),
        target=target,
        input=points["input"],
        knots=knots,
        Q=Q,
        R=R,
        goal=goal == "true",
        interpolation=interpolation,
    )
    return Trajectory(kind="ilqr", horizon=horizon, task=task)


def _any(field: Field, names: Names) -> Trajectory | None:
    optional = ("defect", "input_rate", "horizon", "afterwards")
    entries = field.mapping(required=("kind", "x", "u"), optional=optional)
    if entries is None:
        return None
    x = _ranges(entries.get("x"), names.states, names)
    u = _ranges(entries.get("u"), names.inputs, names)
    defect = (
        entries["defect"].number(names.values, least=0, side="above") if "defect" in entries else Fraction(0)
    )
    rate = _input_rate(entries["input_rate"], names) if "input_rate" in entries else None
    horizon, sound = _horizon(entries.get("horizon"), names)
    if x is None or u is None or defect is None or not sound or (rate is None and "input_rate" in entries):
        return None
    return Trajectory(kind="any", horizon=horizon, bundle=Bundle(x=x, u=u, defect=defect, input_rate=rate))


def _input_rate(field: Field, names: Names) -> Vector | None:
    """|u*'| of every input, by one number or input by input, rounded up."""
    if not isinstance(field.node, MappingNode):
        found = [field.number(names.values, least=0, side="above")] * len(names.inputs)
    else:
        entries = field.mapping(required=names.inputs) or {}
        own = (entries[name] for name in names.inputs if name in entries)
        found = [each.number(names.values, least=0, side="above") for each in own]
    rates = tuple(rate for rate in found if rate is not None)
    return rates if len(rates) == len(names.inputs) else None


def _ranges(
    field: Field | None, wanted: Sequence[str], names: Names
) -> tuple[tuple[Fraction, Fraction], ...] | None:
    """[low, high] for every name, in their order, rounded outward: what is proven holds for all that was asked for."""
    entries = field.mapping(required=tuple(wanted)) if field else None
    found = [_ends(entries[name], names) for name in wanted if name in entries] if entries else []
    kept = tuple(ends for ends in found if ends)
    return kept if len(kept) == len(wanted) else None


def completed(plan: Trajectory, x0: Vector | None) -> Trajectory | None:
    """The plan with the start that a planner takes if none is given: the initial state."""
    if plan.task is None or plan.task.start:
        return plan
    if x0 is None:
        return None
    return replace(plan, task=replace(plan.task, start=x0))


def _interpolation(
    field: Field | None, default: Interpolation, known: tuple[Interpolation, ...] = ("hold", "linear")
) -> tuple[Interpolation, bool]:
    """What u does between knots, and whether what is written is sound."""
    if field is None:
        return default, True
    word = field.word(known)
    return next((each for each in known if each == word), default), word is not None


def _count(field: Field | None, names: Names) -> int | None:
    if field is None:
        return _KNOTS
    value = field.number(names.values, least=2, most=MAX_KNOTS)
    if value is None or value.denominator == 1:
        return None if value is None else int(value)
    field.fail(codes.RANGE, f"{field.path} must be a whole number")
    return None


def _weight(field: Field | None, n: int, names: Names, *, definite: bool) -> Matrix | None:
    """A weight of the planner's cost; by default the identity."""
    if field is None:
        return tuple(tuple(Fraction(i == j) for j in range(n)) for i in range(n))
    weight = field.matrix(n, names.values)
    if weight is None:
        return None
    symmetric = all(weight[i][j] == weight[j][i] for i in range(n) for j in range(i))
    sound = is_positive_definite(weight) if definite else is_positive_semidefinite(weight)
    if symmetric and sound:
        return weight
    word = "positive definite" if definite else "positive semidefinite"
    field.fail(
        codes.RANGE,
        f"{field.path} must be symmetric and {word}",
        "write one positive number, which stands for a multiple of the identity",
    )
    return None


def _horizon(field: Field | None, names: Names) -> tuple[Fraction | None, bool]:
    """The horizon in s, and whether what is written is sound."""
    if field is None:
        return None, True
    horizon = field.number(names.values, above=0, side="above")
    return horizon, horizon is not None


def _constants(field: Field | None, count: int, names: Names) -> tuple[Term, ...] | None:
    items = field.items(count, "numbers") if field else None
    terms = [(item, item.number(names.values)) for item in items or []]
    found = tuple(_constant_term(item, value) for item, value in terms if value is not None)
    return found if len(found) == count else None


def _constant_term(field: Field, value: Fraction) -> Term:
    e = constant(value)
    return Term(expression=e, obligations=(), places=(), text=to_text(e), location=field.location)


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialState:
    """A point, or the plan's start with a radius around it, or a box (n pairs) and its centre; None if unreadable."""

    x0: Vector | None
    within: Fraction | None = None
    box: tuple[tuple[Fraction, Fraction], ...] = ()


def read_initial_state(
    field: Field | None, trajectory: Field | None, plan: Trajectory | None, names: Names
) -> InitialState:
    """The initial state, by default the start of the plan."""

    def planned() -> Vector | None:
        return _start(trajectory, plan) if trajectory and plan else None

    if plan is not None and plan.bundle is not None and (field is None or field.get("within") is None):
        message = "a family of plans has no start of its own"
        where = trajectory if field is None else field
        if where is not None:
            help = "write initial_state: {within: r}: how far from the start of its plan the state may be"
            where.fail(codes.MISSING_KEY, message, help)
        return InitialState(x0=None)
    if field is None:
        return InitialState(x0=planned())
    entries = field.mapping(optional=("at", "within", "box"))
    if entries is None:
        return InitialState(x0=None)
    if len(entries) != 1:
        message = "the initial state is a point, a box, or a radius around the plan's start"
        field.fail(codes.MISSING_KEY, message, "write at: [...], box: {x: [low, high], ...}, or within: r")
        return InitialState(x0=None)
    if "within" in entries:
        radius = entries["within"].number(names.values, above=0, side="above")
        return InitialState(x0=planned(), within=radius)
    (given,) = entries.values()
    if isinstance(given.node, MappingNode):
        ends = _named_ends(given, planned, names, point="at" in entries)
    else:
        items = given.items(len(names.states), "numbers") or []
        ends = [_ends(item, names, point="at" in entries) for item in items]
    box = tuple(end for end in ends if end is not None)
    if len(box) < len(names.states):
        return InitialState(x0=None)
    if (wide := sum(low < high for low, high in box)) > MAX_WIDE:
        field.fail(
            codes.LIMIT, f"the box of starts has {wide} sides of some width; at most {MAX_WIDE} are read"
        )
        return InitialState(x0=None)
    centre = tuple((low + high) / 2 for low, high in box)
    return InitialState(x0=centre, box=box if any(low < high for low, high in box) else ())


def _named_ends(
    field: Field, planned: Callable[[], Vector | None], names: Names, *, point: bool
) -> list[tuple[Fraction, Fraction] | None]:
    """Values or ranges by state; a state that is not named starts on the plan."""
    entries = field.mapping(optional=names.states)
    if entries is None:
        return []
    start = planned() if len(entries) < len(names.states) else None
    found: list[tuple[Fraction, Fraction] | None] = []
    for i, name in enumerate(names.states):
        if name in entries:
            found.append(_ends(entries[name], names, point=point))
        else:
            found.append(None if start is None else (start[i], start[i]))
    return found


def _ends(field: Field, names: Names, *, point: bool = False) -> tuple[Fraction, Fraction] | None:
    """A range, of a `point` also a number, one without width; with pi in it, the least one that contains it."""
    if point and isinstance(field.node, Scalar):
        fields = [field, field]
    else:
        what = "numbers, or one number" if point else "numbers"
        fields = field.items(2, what, _of_one_number(field, names)) or []
    if not fields:
        return None
    low, high = fields[0].number(names.values, side="below"), None
    if low is not None:
        high = fields[1].number(names.values, side="above")
    if low is None or high is None:
        return None
    if low > high:
        field.fail(
            codes.RANGE, f"{field.path}: the lower end must not exceed the upper end", "write [lower, upper]"
        )
        return None
    return low, high


def _of_one_number(field: Field, names: Names) -> str:
    """The two ways to write a number that stands where a range belongs; empty for anything else."""
    text = field.node.text.strip() if isinstance(field.node, Scalar) else ""
    try:
        value = parse_number(text, names.values)
    except ExpressionError:
        return ""
    name = "" if field.key is None else f"{field.key.text}: "
    point = f"{name}[{text}, {text}]"
    if value == 0:
        return f"write {point}"
    size = text.removeprefix("-")
    minus = f"-({size})" if set(size) & {"+", "-"} else f"-{size}"
    return f"write {name}[{minus}, {size}] for the interval, {point} for the point"


def _start(field: Field, plan: Trajectory) -> Vector | None:
    """x*(0), if it is rational."""
    if plan.table is not None:
        return plan.table.knots.x[0]
    if plan.bundle is not None:
        return tuple((low + high) / 2 for low, high in plan.bundle.x)  # one of the starts that there may be
    if plan.task is not None:
        if not plan.task.start:
            message = "the planner needs a start"
            field.fail(codes.MISSING_KEY, message, "add initial_state: {at: [...]}, or trajectory.start")
        return plan.task.start or None
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

"""The section `trajectory`: a union of five kinds of plans, told apart by `kind`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, ClassVar, Final, Literal, get_args

from tubecert.expression import ExpressionError, constant, free_symbols, parse_number, to_text
from tubecert.expression.matrix import is_positive_definite, is_positive_semidefinite
from tubecert.spec import codes, keys
from tubecert.spec.keys import SIZE, Kind, each, entry, expressions, form, key, number, numbers, section, word
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field
from tubecert.spec.system import Plant, Uncertainty, equilibrium, no_uncertainty
from tubecert.spec.table import COLUMNS, read_table
from tubecert.spec.values import Ends, Interpolation, Matrix, Table, Term, Vector

PlanKind = Literal["equilibrium", "expressions", "csv", "ilqr", "any"]
Afterwards = Literal["nothing", "rest", "repeat"]

MAX_KNOTS: Final = 2_001

_AFTERWARDS: Final = word(*get_args(Afterwards))


def read_ends(field: Field, names: Names, *, point: bool = False) -> Ends | None:
    """A range, of a `point` also a number, one without width; with pi in it, the least one that contains it."""
    if point and field.node.kind == "scalar":
        low = field.number(names.values, side="below")
        high = None if low is None else field.number(names.values, side="above")
        return None if low is None or high is None else (low, high)
    what = "numbers, or one number" if point else "numbers"
    order = "the lower end must not exceed the upper end"
    counted = _of_one_number(field, names)
    return field.ends(names.values, what=what, order=order, counted=counted, equal=True)


def _of_one_number(field: Field, names: Names) -> str:
    """The two ways to write a number that stands where a range belongs; empty for anything else."""
    text = field.node.text.strip()
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


_ENDS: Final = Kind(read_ends, keys.PAIR, keys.numbers_text)


def _weight(whose: keys.Whose, what: str) -> Kind:
    """A weight of the planner's cost, by default the identity."""

    def read(field: Field, names: Names) -> Matrix | None:
        n = len(getattr(names, whose))
        weight = field.matrix(n, names.values)
        if weight is None:
            return None
        symmetric = all(weight[i][j] == weight[j][i] for i in range(n) for j in range(i))
        sound = is_positive_definite if what == "positive definite" else is_positive_semidefinite
        if symmetric and sound(weight):
            return weight
        help = "write one positive number, which stands for a multiple of the identity"
        return field.fail(codes.RANGE, f"{field.path} must be symmetric and {what}", help)

    return Kind(read, {"$ref": "#/$defs/matrix"}, keys.rows_of_numbers)


def _kind(kind: PlanKind) -> keys.Key:
    return entry(form({"const": kind}), needed=True, late=True)


def _horizon(*, needed: bool = False) -> keys.Key:
    return entry(number(above=0, side="above"), needed=needed, example=10)


def _afterwards(words: str, *choices: Afterwards) -> keys.Key:
    """What comes after the plan: read with the horizon, and written only beside hardware."""
    schema = {"enum": list(choices or get_args(Afterwards))}
    return entry(form(schema), into="", late=True, words=f"Beside hardware: {words}", said="nothing")


_AFTER: Final = (
    "what the controller does when the horizon is over, and the tube still holds. nothing: nothing is said; "
)
_STAYS: Final = f"{_AFTER}rest: x* and u* stay as they are at the end; repeat: "
_AGAIN: Final = (
    f"{_STAYS}the plan begins again, which needs equal %s at both ends and a horizon of whole samples."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A plan of the built-in planner.

    It minimises the integral of (x - target)' Q (x - target) + (u - input)' R (u - input) from `start`, with `knots`
    knots over the horizon, and ends in `target` if that is the `goal`. `input` None: what best holds the target.
    """

    kind: ClassVar = _kind("ilqr")
    """A plan of the built-in planner."""
    target: Vector = key(numbers("states"), example=[0, 0])
    """Where the plan shall end, one number per state."""
    horizon: ClassVar = _horizon(needed=True)
    """How long the plan is followed, in s; > 0. The certificate claims [0, horizon]."""
    start: Vector = key(numbers("states"), ())
    """Where the plan begins, one number per state; by default the initial state."""
    input: Vector | None = key(numbers("inputs"), None)
    """The input that is not penalised, one number per input; by default what best holds the target."""
    knots: int = key(number(least=2, most=MAX_KNOTS, whole=""), 101, said=101)
    """Number of knots, 2 to 2001."""
    Q: Matrix = key(_weight("states", "positive semidefinite"), needed=False, said=1)
    """Weight of the state, positive semidefinite."""
    R: Matrix = key(_weight("inputs", "positive definite"), needed=False, said=1)
    """Weight of the input, positive definite."""
    goal: bool = key(keys.YES, True, said=True)
    """Whether the plan must end in the target."""
    interpolation: Interpolation = key(word("hold", "linear"), "hold", said="hold")
    """What u* does between knots."""
    afterwards: ClassVar = _afterwards(_AGAIN % "knots")


_RATES: Final = each("inputs", SIZE)


def _input_rate(field: Field, names: Names) -> Vector | None:
    """|u*'| of every input, by one number or input by input."""
    if field.node.kind == "mapping":
        found: Vector | None = _RATES.read(field, names)
        return found
    rate = field.number(names.values, least=0, side="above")
    return None if rate is None else (rate,) * len(names.inputs)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bundle:
    """A family: every plan whose x* and u* stay in boxes. One certificate serves all of them, and a planner that keeps
    to the boxes.

    x* (n ranges), u* (m ranges); the defect in state units per s; `input_rate` (m), where it is known.
    """

    kind: ClassVar = _kind("any")
    """Every plan within the boxes."""
    x: tuple[Ends, ...] = key(each("states", _ENDS), example={"p": [-1, 1], "v": [-0.5, 0.5]})
    """[lower, upper] of x* for every state; the tube around the box must lie in the safe set."""
    u: tuple[Ends, ...] = key(each("inputs", _ENDS), example={"u": [-2, 2]})
    """[lower, upper] of u* for every input."""
    defect: Fraction = key(SIZE, Fraction(0), example=0.01)
    """How large |x*' - f(x*) - B(x*) u*| may be at any time, in units of the states per s; 0 if left out: plans satisfy
    the dynamics."""
    input_rate: Vector | None = key(
        Kind(_input_rate, {"anyOf": [keys.NUMBER, _RATES.schema]}, _RATES.write), None, example=2
    )
    """Beside hardware: how fast every input of a plan may change, |du*/dt| in units of the input per s, by one number
    or by input. Left out: a planner holds its inputs as the computer does."""
    horizon: ClassVar = _horizon()
    """How long a plan is followed, in s; needed unless h is free of t or periodic (then the claim is for all time)."""
    afterwards: ClassVar = _afterwards(
        "nothing is said of what comes after the horizon; without a horizon the family lasts for ever.",
        "nothing",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """The plan: horizon in s, and what its kind needs.

    x (n) and u (m) are expressions of t (constants for an equilibrium); csv has a `table`, ilqr a `task`, any
    a `bundle` instead. `afterwards`: what a computer does when the horizon is over, of which the tube holds as well.
    """

    kind: PlanKind
    x: tuple[Term, ...] = ()
    u: tuple[Term, ...] = ()
    horizon: Fraction | None
    table: Table | None = None
    task: Task | None = None
    bundle: Bundle | None = None
    afterwards: Afterwards = "nothing"
    about: Vector = field(default=(), compare=False)  # with at: auto, the point near which x is looked for

    def __post_init__(self) -> None:
        assert self.horizon is not None or self.afterwards == "nothing"
        assert (self.table is not None) == (self.kind == "csv")
        assert (self.task is not None) == (self.kind == "ilqr")
        assert (self.bundle is not None) == (self.kind == "any")

    @property
    def written(self) -> bool:
        """Whether x* and u* are written down as expressions, and neither data nor still to be found."""
        return bool(self.x)

    @property
    def known(self) -> bool:
        """Whether it is one plan that the file fixes: no family, and nothing that a planner has still to find."""
        return self.task is None and self.bundle is None

    @property
    def moves(self) -> bool:
        """Whether it is one plan along which x* may move: no point that is held, and no family."""
        return self.kind not in ("equilibrium", "any")


class Held:
    """A point that is held."""

    kind = _kind("equilibrium")
    """Hold a point."""
    at = entry(keys.or_auto(keys.constants("states")), "x", needed=True, example=[0, 0])
    """The point x*, one number per state; auto: an equilibrium near `near`, x* and u*, to 20 digits."""
    near = entry(numbers("states"), "", example=[3.18, 4.96])
    """With at: auto: the point near which it is, one number per state; the middle of the safe set if left out."""
    input = entry(keys.constants("inputs"), "u", example=[0])
    """The input u* that holds it, one number per input; 0 if left out. With at: auto: about what that is."""
    horizon = _horizon()
    """How long the point is held, in s; needed unless h is free of t or periodic (then the claim is for all time)."""
    afterwards = _afterwards(f"{_AFTER}rest, repeat: the point is held for ever.")


class Formulas:
    """A curve as expressions of t."""

    kind = _kind("expressions")
    """A curve as expressions of t."""
    x = entry(expressions("states", "plan"), needed=True, example=["sin(t)", "cos(t)"])
    """x*(t), one expression of t per state."""
    u = entry(expressions("inputs", "plan"), needed=True, example=["0"])
    """u*(t), one expression of t per input."""
    horizon = _horizon(needed=True)
    """How long the plan is followed, in s; > 0. The certificate claims [0, horizon]."""
    afterwards = _afterwards(f"{_STAYS}the formulas go on, whose common period is at most the horizon.")


class FromFile:
    """Knots from a file, made by any planner."""

    kind = _kind("csv")
    """Knots from a file."""
    file = entry(form({"type": "string"}), "table.file", needed=True, late=True, example="plan.csv")
    """CSV file with a header that names t, every state and every input; relative to the folder of the specification.
    Its first time becomes t = 0; in its last row inputs may be left out: they stay as in the row before it."""
    columns = entry(
        COLUMNS,
        "",
        example={"t": {"name": "time_ms", "scale": "1/1000"}, "q": {"scale": "1 deg"}, "u": "u_0"},
    )
    """Columns of the file that have another name than t, a state or an input, or another unit: its name, or name and
    scale. With it, {} as well, columns that are not needed are skipped."""
    interpolation = entry(word(*get_args(Interpolation)), "table.knots.interpolation", said="linear")
    """What u* does between knots; hermite-simpson: rows are in turn a knot and the point between it and the next, u* is
    quadratic through the three."""
    horizon = _horizon()
    """How long the plan is followed, in s; at most the last time of the file, which is the default."""
    afterwards = _afterwards(_AGAIN % "rows")


PLANS: Final[Mapping[PlanKind, keys.Section]] = {
    "equilibrium": section(Held),
    "expressions": section(Formulas),
    "csv": section(FromFile),
    "ilqr": section(Task, within="task"),
    "any": section(Bundle, within="bundle"),
}


def trajectory_data(plan: Trajectory, spec: Any) -> dict[str, Any]:
    """The canonical form; what comes after the plan is told beside hardware only."""
    after = {"afterwards": plan.afterwards} if spec.hardware and plan.horizon else {}
    return PLANS[plan.kind].written(plan, spec) | after


def read_trajectory(field: Field, names: Names, plant: Plant | None) -> Trajectory | None:
    """The plan; what a planner's start is by default is not known yet (see `completed`); `plant` None: unreadable."""
    choices = " or ".join(PLANS)
    if field.pairs(f"with a kind: {choices}") is None:
        return None
    told = field.get("kind")
    if told is None:
        return field.fail(codes.MISSING_KEY, "trajectory lacks kind", f"add kind: {choices}")
    word = told.word(tuple(PLANS))
    kind = next((each for each in PLANS if each == word), None)
    entries = PLANS[kind].entries(field) if kind else None
    if kind is None or entries is None:
        return None
    values = PLANS[kind].values(entries, names)
    more: Mapping[str, Any] | None = {}
    if kind == "csv":
        more = _table(entries, values, names)
    elif kind == "equilibrium":
        more = _trimmed(entries, values, plant)
    if not PLANS[kind].holds(values, entries) or more is None:
        return None
    plan = _made(kind, {**values, **more}, field, names)
    return _continued(entries.get("afterwards"), names, plan)


def _table(entries: Mapping[str, Field], values: Mapping[str, Any], names: Names) -> dict[str, Any] | None:
    """The table of a file, and how long it lasts."""
    if "file" not in entries or ("columns" in entries and "columns" not in values):
        return None
    table = read_table(entries["file"], values.get("columns"), names, values.get("interpolation", "linear"))
    if table is None:
        return None
    last, horizon = table.knots.t[-1], values.get("horizon")
    if horizon is not None and horizon > last:
        help = f"give a horizon of at most {to_text(constant(last))}, or leave it out"
        return entries["horizon"].fail(codes.RANGE, "the horizon lies beyond the plan's last time", help)
    return {"table": table, "horizon": last if horizon is None else horizon}


def _trimmed(
    entries: Mapping[str, Field], values: dict[str, Any], plant: Plant | None
) -> dict[str, Any] | None:
    """What at: auto stands for; `near` goes with nothing else."""
    at = entries.get("at")
    if at is None or values.get("x", at) is not None:
        if at is not None and "near" in entries:
            help = "write at: auto, or leave near out"
            entries["near"].fail(codes.RANGE, "trajectory.near beside a point that is given", help)
        return {}
    if plant is None:
        return None
    middle = tuple((low + high) / 2 for low, high in plant.box)
    given = [term.expression.fraction for term in values.get("u", ())]
    about = values.get("near", middle)
    found = equilibrium(plant, about, tuple(given or [Fraction(0)] * len(plant.inputs)))
    if found is None:
        help = "give near: [...], a point beside one, or at and input with f(at) + B(at) input = 0"
        moving = TIME in free_symbols(term.expression for term in plant.f)
        where = "of an f that depends on t" if moving else "there in the safe set"
        return at.fail(codes.RANGE, f"no equilibrium is found {where}", help)
    x, u = (tuple(keys.constant_term(at, own) for own in each) for each in found)
    return {"x": x, "u": u, "about": about}


def _made(kind: PlanKind, values: dict[str, Any], field: Field, names: Names) -> Trajectory:
    horizon = values.pop("horizon", None)
    match kind:
        case "equilibrium":
            none = tuple(keys.constant_term(field, Fraction(0)) for _ in names.inputs)
            values = {"x": values["x"], "u": values.get("u", none), "about": values.get("about", ())}
        case "csv":
            values = {"table": values["table"]}
        case "ilqr":
            weights = {"Q": _identity(len(names.states)), "R": _identity(len(names.inputs))}
            values = {"task": Task(**weights | values)}
        case "any":
            values = {"bundle": Bundle(**values)}
    return Trajectory(kind=kind, horizon=horizon, **values)


def _identity(n: int) -> Matrix:
    return tuple(tuple(Fraction(i == j) for j in range(n)) for i in range(n))


def _continued(own: Field | None, names: Names, plan: Trajectory) -> Trajectory | None:
    """The plan with what holds when its horizon is over."""
    if own is None:
        return plan
    afterwards = _AFTERWARDS.read(own, names)
    if plan.horizon is None:
        help = "the plan lasts for ever: leave afterwards out, or give trajectory.horizon, in s"
        own.fail(codes.RANGE, f"{own.path} without a horizon", help)
    elif plan.bundle is not None and afterwards in ("rest", "repeat"):
        help = "leave the horizon out: a family without one lasts for ever"
        message = f"{own.path} is {afterwards}, and a family of plans has no end of its own"
        own.fail(codes.RANGE, message, help)
    return replace(plan, afterwards=afterwards) if afterwards and plan.horizon else None


def at_rest(field: Field, box: Sequence[Ends], inputs: int) -> tuple[Trajectory, Uncertainty]:
    """Rest in the middle of a box, and no uncertainty: where a plan is of no account. `field` is what it is about."""
    x = tuple(keys.constant_term(field, (low + high) / 2) for low, high in box)
    none = no_uncertainty(field, inputs)
    return Trajectory(kind="equilibrium", x=x, u=none.h or (), horizon=None), none


def completed(plan: Trajectory, x0: Vector | None) -> Trajectory | None:
    """The plan with the start that a planner takes if none is given: the initial state."""
    if plan.task is None or plan.task.start:
        return plan
    return replace(plan, task=replace(plan.task, start=x0)) if x0 else None

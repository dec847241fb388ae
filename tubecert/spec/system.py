"""The sections `system`, `safe_set`, `uncertainty` and `disturbance`: what the mathematics is about."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from math import log10
from typing import Any, Final, NamedTuple

from tubecert.expression import (
    MAX_NAME_LENGTH,
    ZERO,
    Expression,
    Lookup,
    constant,
    number_text,
    root_above,
    substitute,
    symbol,
    to_text,
)
from tubecert.expression.balls import towards_root
from tubecert.expression.matrix import dependent_columns
from tubecert.spec import codes, keys
from tubecert.spec.keys import NUMBER, SIZE, each, entry, expressions, form, key, named, numbers_text, section
from tubecert.spec.lookup import SLOPES, TABLE
from tubecert.spec.names import MAX_STATES, Names
from tubecert.spec.reader import Field, whole
from tubecert.spec.values import Ends, Output, Term, TermMatrix, Vector, out_of_range

MAX_COLUMNS: Final = 32
DIGITS: Final = 20  # of an equilibrium
_NAMES: Final = {"type": "array", "items": keys.NAME, "minItems": 1, "maxItems": MAX_STATES}
_ROWS: Final = {"type": "array", "items": keys.TEXTS, "minItems": 1}
_B: Final = {**_ROWS, "items": {**keys.TEXTS, "description": "A row: one entry per input."}}


def _unit(field: Field, _names: Names) -> str | None:
    unit = field.text("a unit")
    if unit is None or (unit.isprintable() and 0 < len(unit) <= MAX_NAME_LENGTH):
        return unit
    return field.fail(codes.RANGE, f"a unit has 1 to {MAX_NAME_LENGTH} printable characters")


_UNIT: Final = {"type": ["string", "number"], "minLength": 1, "maxLength": MAX_NAME_LENGTH}
UNITS: Final = named("quantities", keys.Kind(_unit, _UNIT))


def _parameters(known: Iterable[tuple[str, Fraction]], spec: Any) -> dict[str, Any]:
    return {name: number_text(value) for name, value in known} | {
        name: numbers_text(ends) for name, ends in spec.ranges
    }


def _tables(tables: Iterable[Lookup], _spec: Any) -> dict[str, Any]:
    """The functions themselves: however their slopes were found, they are what counts."""
    points = {own.name: zip(own.knots, own.values, own.slopes, strict=True) for own in tables}
    return {
        name: {"interpolation": SLOPES, "points": list(map(numbers_text, own))}
        for name, own in points.items()
    }


def _outputs(outputs: Iterable[Output], spec: Any) -> dict[str, Any]:
    """The sums that outputs are."""
    states = [symbol(state) for state in spec.states]
    sums = {own.name: zip(own.row, states, strict=True) for own in outputs}
    return {name: to_text(sum((constant(q) * x for q, x in own), start=ZERO)) for name, own in sums.items()}


class System:
    """The system x' = f(x) + B(x) (u + h(t, x))."""

    states = entry(form(_NAMES), needed=True, example=["p", "v"])
    """Names of the states, 1 to 32."""
    inputs = entry(form(_NAMES), needed=True, example=["u"])
    """Names of the inputs; not more than states."""
    parameters = entry(
        form(keys.by_name({"anyOf": [NUMBER, keys.PAIR]}), _parameters),
        always=True,
        example={"g": 9.81, "l": "1/2", "m": [0.47, 0.5]},
    )
    """Constants by name, exact; each may use those before it. [lower, upper] is a constant of which only that is known:
    it may be used in f, and with hardware in B, which the controller knows at the middle."""
    tables = entry(
        form(keys.by_name({"section": TABLE}), _tables),
        example={"drag": {"points": [[0, 0], [10, 0.4], [20, 1.9]]}},
    )
    """Functions by name, each a smooth curve (C1) through the points of a table: drag: {file: drag.csv} makes drag(v) a
    function in f, B, h and plans."""
    definitions = entry(
        form(keys.by_name(keys.EXPRESSION)), into="", example={"s": "sin(p)", "d": "1 + m*s**2"}
    )
    """Names for expressions of states, t and parameters; each may use those before it, and stands for its expression
    wherever it is used."""
    outputs = entry(form(keys.by_name(keys.EXPRESSION), _outputs), example={"tip": "p + 0.5*q"})
    """Linear combinations of the states, by name: sums of states times rational numbers. Each has a half-width
    |c'(x - x*)| in the certificate, beside those of the states, and may be named in tube.half_widths,
    synthesise.outputs and design --minimise."""
    units = entry(UNITS, always=True, example={"p": "rad", "u": "N"})
    """Units of states, inputs and outputs; for reports only."""
    f = entry(
        form(keys.TEXTS, lambda f, spec: keys.texts(spec.drift or f)),
        needed=True,
        example=["v", "-g/l*sin(p) - v"],
    )
    """The drift f(x) or f(t, x), one expression of states, parameters and t per state; continuously differentiable on
    the safe set."""
    B = entry(form(_B, lambda B, spec: keys.rows_of_texts(spec.gained or B)), needed=True, example=[[0], [1]])
    """The input matrix B(x), one row per state, one column per input; of full column rank on the safe set."""


SYSTEM: Final = section(System)
SAFE_SET: Final = each("states", keys.ends(inward="end"))


class Dynamics(NamedTuple):
    """The drift f (n) and the input matrix B (n, m): the plant's, and what the controller knows of them."""

    drift: tuple[Term, ...]
    gained: TermMatrix
    f: tuple[Term, ...] | None
    B: TermMatrix | None


def read_dynamics(f: Field | None, B: Field | None, names: Names) -> Dynamics | None:
    """Both, with parameters known by a range; what is known is None where it is not defined."""
    n, m = len(names.states), len(names.inputs)
    drift = f.terms(n, names.scope("drift"), "expressions, one per state") if f else None
    gained = B.term_matrix(n, m, names.scope("plant")) if B else None
    if gained is not None and B is not None and not _independent(B, gained):
        gained = None
    if f is None or B is None or drift is None or gained is None:
        return None
    known, rows = _known(f, drift, names), [_known(B, row, names) for row in gained]
    return Dynamics(drift, gained, known, whole(rows, n))


def _known(field: Field, terms: tuple[Term, ...], names: Names) -> tuple[Term, ...] | None:
    """What the controller knows: `terms` of f or B where every parameter known by a range is in its middle."""
    middle = {name: constant((low + high) / 2) for name, (low, high) in names.ranges}
    if not middle:
        return terms
    try:
        return tuple(_put(term, middle) for term in terms)
    except ZeroDivisionError:
        which = field.path.rpartition(".")[2]
        message = f"{which} is undefined where every parameter is in the middle of its range"
        help = "a divisor vanishes there; give ranges that keep away from it"
        return field.fail(codes.EXPRESSION, message, help)


def _put(term: Term, values: Mapping[str, Expression]) -> Term:
    """A term at these values; raises `ZeroDivisionError`."""
    own, *owed = substitute([term.expression, *(duty.argument for duty in term.obligations)], values)
    duties = (replace(duty, argument=argument) for duty, argument in zip(term.obligations, owed, strict=True))
    return replace(term, expression=own, obligations=tuple(duties))


def _independent(field: Field, matrix: TermMatrix) -> bool:
    if not dependent_columns([[term.expression for term in row] for row in matrix]):
        return True
    many = len(matrix[0]) > 1
    message = "the columns of B are linearly dependent at every point" if many else "B is zero at every point"
    field.fail(codes.RANK, message, "every input must act on the state independently of the others")
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class Bounds:
    """Declared bounds; all three without h."""

    h: Fraction | None = key(SIZE, None)
    """Bound of |h|, in units of the input; >= 0."""
    h_x: Fraction | None = key(SIZE, None)
    """Lipschitz constant of h in x; >= 0."""
    h_t: Fraction | None = key(SIZE, None)
    """Bound of |dh/dt|; >= 0."""


BOUNDS: Final = section(
    Bounds,
    additionalProperties={
        "type": "object",
        "description": "The same three for the component of h that acts with an input; then for every input. Together "
        "they bound h by the root of the sum of their squares.",
        "properties": dict.fromkeys(("h", "h_x", "h_t"), NUMBER),
        "additionalProperties": False,
    },
    examples=[
        {"h": 0.12, "h_x": 0.01, "h_t": 0.2},
        {"u1": {"h": 0.1, "h_x": 0, "h_t": 0.2}, "u2": {"h": 0.05, "h_x": 0, "h_t": 0.1}},
    ],
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertainty:
    """The matched uncertainty h(t, x): as expressions, by declared bounds, or both (then the bounds are proven).
    Needed, but for a question about a metric alone and beside hardware, where it is 0 if it is left out.

    Never neither.
    """

    h: tuple[Term, ...] | None = key(
        expressions("inputs", "uncertainty"), None, example=["0.1*sin(2*t) + 0.01*abs(v)"]
    )
    """h(t, x), one expression of t, states and parameters per input; may use abs and norm."""
    bounds: Bounds | None = key(keys.inside(BOUNDS), None, late=True)

    def __post_init__(self) -> None:
        assert self.h is not None or self.bounds is not None


UNCERTAINTY: Final = section(
    Uncertainty,
    anyOf=[
        {"required": ["h"]},
        {
            "required": ["bounds"],
            "properties": {
                "bounds": {
                    "anyOf": [{"required": list(BOUNDS.keys)}, {"additionalProperties": {"type": "object"}}]
                }
            },
        },
    ],
)


def read_uncertainty(field: Field | None, machine: Field | None, names: Names) -> Uncertainty | None:
    """Expressions, declared bounds, or both; beside a machine h may be left out, and a bound of its size will do."""
    if field is None:
        return no_uncertainty(machine, len(names.inputs)) if machine else None
    entries = UNCERTAINTY.entries(field)
    if entries is None:
        return None
    if not entries:
        message = "uncertainty needs h, bounds, or both"
        help = 'write h: ["0"] if there is no uncertainty, or bounds: {h: ..., h_x: ..., h_t: ...}'
        return field.fail(codes.MISSING_KEY, message, help)
    if machine and len(entries) > 1:
        message = "uncertainty has h and bounds beside hardware"
        help = "give one of the two: what h is, or what is known of it"
        return field.fail(codes.RANGE, message, help)
    values = UNCERTAINTY.sound(entries, names)
    bounds = None
    if "bounds" in entries:
        needed = () if "h" in entries else ("h",) if machine else tuple(BOUNDS.keys)
        bounds = _read_bounds(entries["bounds"], names, needed)
    if values is None or ("bounds" in entries and bounds is None):
        return None
    return Uncertainty(**values, bounds=bounds)


def no_uncertainty(field: Field, inputs: int) -> Uncertainty:
    """h = 0, where nothing is said of it."""
    return Uncertainty(h=tuple(keys.constant_term(field, Fraction(0)) for _ in range(inputs)), bounds=None)


def _read_bounds(field: Field, names: Names, needed: tuple[str, ...]) -> Bounds | None:
    """Declared bounds, those that are needed among them."""
    nodes = [node for _, node in field.node.pairs] if field.node.kind == "mapping" else []
    if any(node.kind == "mapping" for node in nodes):
        return _combined(field, names, needed)
    entries = BOUNDS.entries(field, needed)
    values = BOUNDS.sound(entries, names)
    return None if values is None else Bounds(**values)


def _combined(field: Field, names: Names, needed: tuple[str, ...]) -> Bounds | None:
    """Bounds of the components of h, input by input: h is bounded by the root of the sum of their squares.

    So are |dh/dt|, and |h(t, x) - h(t, y)| <= sqrt(sum L_i^2)|x - y|. Bounds of one kind are given for all or none.
    """
    entries = field.mapping(required=names.inputs)
    if entries is None or len(entries) < len(names.inputs):
        return None
    parts = whole(_read_bounds(entries[name], names, needed) for name in names.inputs)
    if parts is None:
        return None
    total: dict[str, Fraction | None] = {}
    for name in BOUNDS.keys:
        known = [value for part in parts for value in [getattr(part, name)] if value is not None]
        if known and len(known) < len(parts):
            message = f"{field.path} bounds {name} of some inputs only"
            return field.fail(codes.MISSING_KEY, message, f"bound {name} of every input, or of none")
        total[name] = root_above(sum((q * q for q in known), start=Fraction(0))) if known else None
    return Bounds(**total)


def _bound(field: Field, names: Names, columns: int | None) -> Fraction | Vector | None:
    """|w|, or |w_i| by column of E."""
    if field.node.kind != "list":
        return field.number(names.values, least=0, side="above")
    items = field.items(columns, "numbers, one per column of E") or []
    return whole(item.number(names.values, least=0, side="above") for item in items) or None


def _shape(field: Field, names: Names) -> TermMatrix | None:
    """E with as many columns as its first row has."""
    rows = field.items(len(names.states), "rows, one per state", "write [[...], ...], a row for every state")
    width = len(rows[0].items(None, "expressions") or ()) if rows else 0
    if not rows or not width:
        return None
    if width > MAX_COLUMNS:
        return field.fail(codes.LIMIT, f"{field.path} has {width} columns; at most {MAX_COLUMNS} are read")
    return field.term_matrix(len(names.states), width, names.scope("metric"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """What acts on the states beside the inputs: x' = f + B (u + h) + E w, with |w| bounded and otherwise arbitrary:
    gusts, unmodelled forces.

    E (n, k); |w| <= `bound`, or |w_i| <= `bound`[i] (k) beside hardware; `rate` in 1/s, if |w'|, or every |w_i'|, is at
    most that.
    """

    E: TermMatrix = key(keys.Kind(_shape, _ROWS, keys.rows_of_texts), (), example=[[0], [1]])
    """A row of expressions for every state, a column for every component of w; the identity by default."""
    bound: Fraction | Vector = key(
        form(
            {"anyOf": [NUMBER, keys.LIST]},
            lambda own, _: numbers_text(own) if isinstance(own, tuple) else number_text(own),
        ),
        late=True,
        example=0.05,
    )
    """|w| is at most this; with hardware also a list, of what each component of w is at most."""
    rate: Fraction | None = key(SIZE, None)
    """|dw/dt| (with hardware: that of each component) is at most this, in 1/s, if that is known: then the part of E w
    that the inputs can reach is adapted to."""

    @property
    def length(self) -> Fraction:
        """The bound of |w| of a loop in continuous time."""
        assert isinstance(self.bound, Fraction)
        return self.bound


DISTURBANCE: Final = section(Disturbance, examples=[{"E": [[0], [1]], "bound": 0.05}])


def read_disturbance(field: Field, names: Names) -> Disturbance | None:
    """E, the bound and the rate of w; None if the section is unsound."""
    entries = DISTURBANCE.entries(field)
    if entries is None:
        return None
    values = DISTURBANCE.values(entries, names)
    sound, n = DISTURBANCE.holds(values, entries), range(len(names.states))
    identity = tuple(tuple(keys.constant_term(field, Fraction(i == j)) for j in n) for i in n)
    E = values.pop("E", None if "E" in entries else identity)
    bound = _bound(entries["bound"], names, len(E[0]) if E else None) if "bound" in entries else None
    return Disturbance(**values, E=E, bound=bound) if sound and bound is not None else None


class Plant(NamedTuple):
    """What an equilibrium is one of: x' = f + B u in the names of states and inputs, and the safe set."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: tuple[Term, ...]
    B: TermMatrix
    box: tuple[Ends, ...]


def equilibrium(plant: Plant, x: Vector, u: Vector) -> tuple[Vector, Vector] | None:
    """x* (n) in the safe set and u* (m) near a point with f + B u = 0, to `DIGITS` digits; None if none is met.

    First the inputs alone move; where none holds the point, states move with them, by equal shares of the safe set. It
    is no more than a proposal: by how much it misses the dynamics is bounded as for any other plan.
    """
    n, names = len(plant.states), (*plant.states, *plant.inputs)
    drift = [
        sum((b.expression * symbol(name) for b, name in zip(row, plant.inputs, strict=True)), start=ZERO)
        + f.expression
        for f, row in zip(plant.f, plant.B, strict=True)
    ]
    size = [(high - low) / 2 for low, high in plant.box] + [max(abs(own), Fraction(1)) for own in u]
    z = [*x, *u]
    for first, steps in ((n, 3), (0, 20)):  # f + B u is affine in u
        z, met = towards_root(drift, names, z, size, first=first, steps=steps)
        if met:
            found = [round(own, DIGITS - round(log10(unit))) for own, unit in zip(z, size, strict=True)]
            inside = all(low <= own <= high for own, (low, high) in zip(found, plant.box, strict=False))
            sound = inside and not any(map(out_of_range, found))
            return (tuple(found[:n]), tuple(found[n:])) if sound else None
    return None

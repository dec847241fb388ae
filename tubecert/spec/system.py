"""The sections `system` and `uncertainty`, and the metric: what the mathematics is about."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Final

from tubecert.expression import constant, free_symbols, root_above, substitute, to_text
from tubecert.expression.waves import frequencies
from tubecert.spec import codes
from tubecert.spec.algebra import asymmetric_entry, dependent_columns
from tubecert.spec.document import MappingNode
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field
from tubecert.spec.synthesis import read_synthesis
from tubecert.spec.types import Bounds, Metric, Synthesis, Term, TermMatrix, Uncertainty

_SYMMETRY_BUDGET = 20_000
_LONG: Final = 10**12  # s, or that many times pi


def read_dynamics(
    f: Field | None, B: Field | None, names: Names
) -> tuple[tuple[Term, ...], TermMatrix] | None:
    """The drift f, of n entries, and the input matrix B, n x m; both may contain parameters known by a range."""
    n, m = len(names.states), len(names.inputs)
    drift = f.terms(n, names.of_drift(), "expressions, one per state") if f else None
    inputs = B.term_matrix(n, m, names.of_plant()) if B else None
    if B is not None and inputs is not None and not _independent(B, inputs):
        inputs = None
    return (drift, inputs) if drift is not None and inputs is not None else None


def known_of(field: Field, terms: tuple[Term, ...], names: Names) -> tuple[Term, ...] | None:
    """What the controller knows: `terms` of f or B where every parameter known by a range is in its middle."""
    try:
        return _nominal(terms, names)
    except ZeroDivisionError:
        which = field.path.rpartition(".")[2]
        field.fail(
            codes.EXPRESSION,
            f"{which} is undefined where every parameter is in the middle of its range",
            "a divisor vanishes there; give ranges that keep away from it",
        )
        return None


def is_uncertain(matrix: TermMatrix, names: Names) -> bool:
    """Whether a parameter that is known by a range stands in a matrix."""
    return bool(free_symbols(term.expression for row in matrix for term in row) & set(dict(names.ranges)))


NO_SEARCH: Final = (
    "write metric: {rate: ..., dual_metric: ...}, or --metric FILE; one that synth finds for f with t replaced by "
    "a number may serve at all times, which certify proves"
)


def check_moving(f: Field, drift: Sequence[Term], beside: Iterable[tuple[bool, str, str]]) -> None:
    """What is covered where f depends on t; `beside` is what is not, and what to write then."""
    own = [term.expression for term in drift]
    own += [owed.argument for term in drift for owed in term.obligations]
    if TIME not in free_symbols(own):
        return
    for found, message, help in beside:
        if found:
            f.fail(codes.RANGE, f"f depends on t, {message}", help)


def returns(terms: Sequence[Term]) -> bool:
    """Whether a common period of terms, and of what they owe, is to be seen."""
    owed = (duty.argument for term in terms for duty, _ in term.owed())
    found = frequencies([*(term.expression for term in terms), *owed], TIME)
    return found is not None and (found.period is None or found.period[0] < _LONG)


def _nominal(drift: tuple[Term, ...], names: Names) -> tuple[Term, ...]:
    """Raises `ZeroDivisionError`."""
    middle = {name: constant((low + high) / 2) for name, (low, high) in names.ranges}
    if not middle:
        return drift

    def put(term: Term) -> Term:
        arguments = substitute([term.expression, *(owed.argument for owed in term.obligations)], middle)
        owed = zip(term.obligations, arguments[1:], strict=True)
        return replace(
            term,
            expression=arguments[0],
            obligations=tuple(replace(duty, argument=argument) for duty, argument in owed),
        )

    return tuple(put(term) for term in drift)


def _independent(field: Field, matrix: TermMatrix) -> bool:
    if not dependent_columns([[term.expression for term in row] for row in matrix]):
        return True
    many = len(matrix[0]) > 1
    message = "the columns of B are linearly dependent at every point" if many else "B is zero at every point"
    field.fail(codes.RANK, message, "every input must act on the state independently of the others")
    return False


def read_uncertainty(field: Field, names: Names, *, sudden: bool) -> Uncertainty | None:
    """Expressions, declared bounds, or both; `sudden`: of an h without expressions a bound of its size will do."""
    entries = field.mapping(optional=("h", "bounds"))
    if entries is None:
        return None
    if not entries:
        field.fail(
            codes.MISSING_KEY,
            "uncertainty needs h, bounds, or both",
            'write h: ["0"] if there is no uncertainty, or bounds: {h: ..., h_x: ..., h_t: ...}',
        )
        return None
    if sudden and len(entries) > 1:
        field.fail(
            codes.RANGE,
            "uncertainty has h and bounds beside hardware",
            "give one of the two: what h is, or what is known of it",
        )
        return None
    h = bounds = None
    if "h" in entries:
        h = entries["h"].terms(len(names.inputs), names.of_uncertainty(), "expressions, one per input")
    if "bounds" in entries:
        needed = () if "h" in entries else ("h",) if sudden else _BOUNDS
        bounds = _read_bounds(entries["bounds"], names, needed)
    if ("h" in entries and h is None) or ("bounds" in entries and bounds is None):
        return None
    return Uncertainty(h=h, bounds=bounds)


def _read_bounds(field: Field, names: Names, needed: tuple[str, ...]) -> Bounds | None:
    """Declared bounds, those that are needed among them."""
    if isinstance(field.node, MappingNode) and any(
        isinstance(node, MappingNode) for _, node in field.node.pairs
    ):
        return _combined(field, names, needed)
    entries = field.mapping(required=needed, optional=tuple(key for key in _BOUNDS if key not in needed))
    if entries is None:
        return None
    values = {key: entry.number(names.values, least=0, side="above") for key, entry in entries.items()}
    if None in values.values():
        return None
    return Bounds(h=values.get("h"), h_x=values.get("h_x"), h_t=values.get("h_t"))


def _combined(field: Field, names: Names, needed: tuple[str, ...]) -> Bounds | None:
    """Bounds of the components of h, input by input: h is bounded by the root of the sum of their squares.

    So are |dh/dt|, and |h(t, x) - h(t, y)| <= sqrt(sum L_i^2)|x - y|. Bounds of one kind are given for all or none.
    """
    entries = field.mapping(required=names.inputs)
    if entries is None or len(entries) < len(names.inputs):
        return None
    found = [_read_bounds(entries[name], names, needed) for name in names.inputs]
    parts = [part for part in found if part is not None]
    if len(parts) < len(found):
        return None
    total: dict[str, Fraction | None] = {}
    for key in _BOUNDS:
        known = [value for part in parts for value in [getattr(part, key)] if value is not None]
        if known and len(known) < len(parts):
            message = f"{field.path} bounds {key} of some inputs only"
            field.fail(codes.MISSING_KEY, message, f"bound {key} of every input, or of none")
            return None
        total[key] = root_above(sum((q * q for q in known), start=Fraction(0))) if known else None
    return Bounds(**total)


_BOUNDS: Final = ("h", "h_x", "h_t")
METRIC_KEYS: Final = ("dual_metric", "rate", "bounds")


def wanted_metric(field: Field, names: Names) -> Synthesis | None:
    """What is to be synthesised, if the section asks for that; then nothing else may stand in it."""
    pairs = field.pairs() if isinstance(field.node, MappingNode) else None
    if not pairs or all(key.text != "synthesise" for key, _ in pairs):
        return None
    entries = field.mapping(required=("synthesise",), optional=METRIC_KEYS)
    if entries is None or "synthesise" not in entries:
        return None
    for key in METRIC_KEYS:
        if key in entries:
            entries[key].fail(
                codes.RANGE, f"{entries[key].path} beside metric.synthesise", "give a metric, or ask for one"
            )
    return read_synthesis(entries["synthesise"], names)


def read_metric(field: Field, names: Names) -> Metric | None:
    """The dual metric with its rate, and declared bounds of the metric."""
    entries = field.mapping(required=METRIC_KEYS[:2], optional=METRIC_KEYS[2:])
    return None if entries is None else metric_of(entries, names)


def metric_of(entries: Mapping[str, Field], names: Names) -> Metric | None:
    """The metric that the values of the keys make up; None if one is missing or wrong."""
    n = len(names.states)
    rate = entries["rate"].number(names.values, above=0) if "rate" in entries else None
    dual = entries["dual_metric"].term_matrix(n, n, names.of_state()) if "dual_metric" in entries else None
    if dual is not None and not _symmetric(entries["dual_metric"], dual):
        dual = None
    bounds = _metric_bounds(entries["bounds"], names) if "bounds" in entries else (None, None)
    if rate is None or dual is None or bounds is None:
        return None
    return Metric(dual_metric=dual, rate=rate, lower=bounds[0], upper=bounds[1])


def _symmetric(field: Field, matrix: TermMatrix) -> bool:
    found = asymmetric_entry([[term.expression for term in row] for row in matrix], _SYMMETRY_BUDGET)
    if found is None:
        return True
    i, j, proven = found
    above, below = (to_text(matrix[k][l].expression)[:60] for k, l in ((i, j), (j, i)))
    where = f"({i + 1},{j + 1}) = {above} and ({j + 1},{i + 1}) = {below}"
    relation = "differ" if proven else "could not be proven equal"
    field.reader.report(
        codes.SYMMETRY,
        matrix[j][i].location,
        f"dual_metric is not symmetric: {where} {relation}",
        "write the same expression in both places",
    )
    return False


def _metric_bounds(field: Field, names: Names) -> tuple[Fraction, Fraction] | None:
    entries = field.mapping(required=("lower", "upper"))
    if entries is None or len(entries) < 2:
        return None
    lower = entries["lower"].number(names.values, above=0)
    upper = entries["upper"].number(names.values, above=0)
    if lower is None or upper is None:
        return None
    if lower > upper:
        field.fail(
            codes.RANGE, f"{field.path}: lower must not exceed upper", "they bound the eigenvalues of W^-1"
        )
        return None
    return lower, upper

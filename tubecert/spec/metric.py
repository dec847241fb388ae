"""The section `metric`: a contraction metric, or what one is asked for."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

from tubecert.expression import suggestion, to_text
from tubecert.expression.matrix import asymmetric_entry
from tubecert.spec import codes, keys
from tubecert.spec.keys import AUTO, NAME, Kind, Section, entry, key, number, or_auto, section, several, word
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.values import Ends, TermMatrix

OBJECTIVES: Final = ("condition", "margin", "rate", "adaptation", "tube")
COORDINATES: Final[tuple[Literal["auto", "identity"], ...]] = (AUTO, "identity")
ROUTES: Final = (AUTO, "sos", "cegis")
SOLVERS: Final = ("clarabel", "scs")
MAX_DEGREE: Final = 8
_CVXPY: Final = r"cvxpy:[A-Za-z][A-Za-z0-9_]{0,31}"
_SYMMETRY_BUDGET: Final = 20_000


def solver_name(text: str) -> str | None:
    """The solver as it is kept: clarabel, scs, or cvxpy:NAME with the name in capitals; None if it is none of these.

    Whether cvxpy has it is known where it is used.
    """
    if re.fullmatch(_CVXPY, text):
        library, name = text.split(":")
        return f"{library}:{name.upper()}"
    return text if text in SOLVERS else None


def _solver(field: Field, _: Names) -> str | None:
    text = field.text("the name of a solver")
    found = None if text is None else solver_name(text)
    if text is not None and found is None:
        choices = suggestion(text, SOLVERS, what="choices")
        help = f"{choices}, or cvxpy:NAME, a solver by its name in cvxpy"
        field.fail(codes.RANGE, f"{field.path} is {text[:60]!r}, not one of the choices", help)
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Synthesis:
    """Asks for a metric instead of giving one: `synth` searches for it, `certify` does so first.

    None is what is searched for, or chosen.
    """

    rate: Fraction | None = key(or_auto(number(above=0)), None, said=AUTO)
    """Rate to be contracted with, in 1/s; auto: searched for."""
    objective: str = key(word(*OBJECTIVES), "adaptation")
    """What the metric is best in: least condition number or greatest margin (at a given rate), greatest rate, least
    adaptation rate, smallest tube. By default condition if there is a rate, else adaptation; tube if there are
    outputs."""
    outputs: tuple[str, ...] = key(
        several("lengths", "state or output", "states and outputs", items={"type": "string"}, minItems=1),
        (),
        example=["px", "pz"],
    )
    """The states and outputs (system.outputs) in which the tube is to be small: metrics are compared by the widest of
    their half-widths, each in the unit of tube.half_widths if that names it. Belongs to the objective tube. By default
    the radius counts."""
    degree: int | None = key(
        or_auto(number(least=0, most=MAX_DEGREE, whole="write auto, or 0 for a constant metric")),
        None,
        said=AUTO,
        always=True,
    )
    """Degree of W as a polynomial, 0 to 8; auto: as small as serves."""
    variables: tuple[str, ...] | None = key(
        or_auto(several("states", "state", "states", items=NAME, uniqueItems=True)),
        None,
        said=AUTO,
        always=True,
    )
    """The states that W may depend on; auto: those that C3 allows and that matter."""
    condition_number: Fraction | None = key(number(least=1), None)
    """The condition number, in the states' own units, is not to exceed this; >= 1."""
    coordinates: Literal["auto", "identity"] = key(word(*COORDINATES), AUTO, said=AUTO)
    """In what coordinates the least condition number is looked for; auto: half-widths of the safe set, which does not
    depend on units; identity: the states as they are."""
    route: str = key(word(*ROUTES), AUTO, said=AUTO)
    """How: by sums of squares, or by counterexamples."""
    solver: str = key(
        Kind(_solver, {"anyOf": [{"enum": list(SOLVERS)}, {"type": "string", "pattern": f"^{_CVXPY}$"}]}),
        SOLVERS[0],
        said=SOLVERS[0],
    )
    """The solver of the semidefinite programs; cvxpy:NAME is one that cvxpy knows by that name."""


SYNTHESIS: Final = section(Synthesis)


def _read_synthesis(field: Field, names: Names) -> Synthesis | None:
    """What to synthesise; None if something in it is unsound."""
    before = len(field.reader.findings)
    entries = SYNTHESIS.entries(field)
    if entries is None:
        return None
    rate = entries.get("rate")
    searched = rate is None or keys.says(rate, AUTO)
    default = "tube" if "outputs" in entries else "adaptation" if searched else "condition"
    found = Synthesis(**{"objective": default, **SYNTHESIS.values(entries, names)})
    _consistent(field, found)
    return found if len(field.reader.findings) == before else None


def _consistent(field: Field, found: Synthesis) -> None:
    """A rate belongs to some objectives, and must be searched for by the others."""
    if found.outputs and found.objective != "tube":
        message = (
            f"{field.path}: outputs are what the tube is to be small in; the objective is {found.objective}"
        )
        help = "leave the objective out, or write objective: tube"
        field.fail(codes.RANGE, message, help)
    if found.objective in ("condition", "margin") and found.rate is None:
        message = f"{field.path}: the objective {found.objective} needs a rate"
        help = "add rate: ..., in 1/s, or choose the objective rate, adaptation or tube"
        field.fail(codes.MISSING_KEY, message, help)
    if found.objective == "rate" and found.rate is not None:
        message = f"{field.path}: the objective rate searches for the rate; it cannot be given"
        help = "remove rate, or choose the objective condition or margin"
        field.fail(codes.RANGE, message, help)


_BOUNDS: Final = Section(
    words="Declared bounds of the eigenvalues of M = W^-1; proven on the safe set, then used in place of those over "
    "the tube.",
    keys={
        "lower": entry(number(above=0), words="lower I <= M; > 0.", needed=True),
        "upper": entry(number(above=0), words="M <= upper I.", needed=True),
    },
)


def _bounds(field: Field, names: Names) -> Ends | None:
    found = _BOUNDS.sound(_BOUNDS.entries(field), names)
    if found is None:
        return None
    if found["lower"] > found["upper"]:
        message = f"{field.path}: lower must not exceed upper"
        return field.fail(codes.RANGE, message, "they bound the eigenvalues of W^-1")
    return found["lower"], found["upper"]


def _dual(field: Field, names: Names) -> TermMatrix | None:
    n = len(names.states)
    dual = field.term_matrix(n, n, names.scope("metric"))
    if dual is None:
        return None
    found = asymmetric_entry([[entry.expression for entry in row] for row in dual], _SYMMETRY_BUDGET)
    if found is None:
        return dual
    i, j, proven = found
    above, below = (to_text(dual[k][l].expression)[:60] for k, l in ((i, j), (j, i)))
    where = f"({i + 1},{j + 1}) = {above} and ({j + 1},{i + 1}) = {below}"
    message = f"dual_metric is not symmetric: {where} {'differ' if proven else 'could not be proven equal'}"
    help = "write the same expression in both places"
    return field.reader.report(codes.SYMMETRY, dual[j][i].location, message, help)


_ROWS: Final = {"type": "array", "items": {**keys.TEXTS, "description": "A row."}, "minItems": 1}


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """The contraction metric, by its inverse W(x). Needed to certify, unless --metric FILE gives it; not given beside
    hardware.

    W (n, n), and `bounds` I of W^-1 if some are declared.
    """

    dual_metric: TermMatrix = key(Kind(_dual, _ROWS, keys.rows_of_texts), example=[[1, -0.5], [-0.5, 1]])
    """W(x): symmetric, positive definite, twice continuously differentiable on the safe set."""
    rate: Fraction = key(number(above=0), example=0.4)
    """Contraction rate lambda, in 1/s; > 0."""
    bounds: Ends | None = key(
        Kind(
            _bounds,
            {"section": _BOUNDS},
            lambda ends, _: dict(zip(_BOUNDS.keys, keys.numbers_text(ends), strict=True)),
        ),
        None,
    )

    @property
    def lower(self) -> Fraction | None:
        """`lower` I <= W^-1, if that is declared."""
        return self.bounds and self.bounds[0]

    @property
    def upper(self) -> Fraction | None:
        """W^-1 <= `upper` I, if that is declared."""
        return self.bounds and self.bounds[1]


METRIC: Final = section(Metric)
WANTED: Final = Section(
    make=Metric,
    words=METRIC.words,
    keys={
        **{name: replace(own, needed=False, late=True) for name, own in METRIC.keys.items()},
        "synthesise": entry(Kind(_read_synthesis, {"section": SYNTHESIS})),
    },
    form={"anyOf": [{"required": ["dual_metric", "rate"]}, {"required": ["synthesise"]}]},
)


def read_metric(field: Field, names: Names) -> Metric | Synthesis | None:
    """The dual metric with its rate, and declared bounds of the metric, or what is asked for in its place."""
    before = len(field.reader.findings)
    there = [key.text for key, _ in field.pairs() or ()] if field.node.kind == "mapping" else []
    if there == ["rate"]:
        help = "add dual_metric: ..., or have one of this rate found: metric: {synthesise: {rate: ...}}"
        return field.fail(codes.MISSING_KEY, f"{field.path} lacks dual_metric", f"{help} (tubecert synth)")
    if "synthesise" not in there:
        return None if len(field.reader.findings) > before else METRIC.read(field, names)
    entries = WANTED.entries(field, ("synthesise",)) or {}
    for name in METRIC.keys:
        if own := entries.get(name):
            own.fail(codes.RANGE, f"{own.path} beside metric.synthesise", "give a metric, or ask for one")
    return (WANTED.sound(entries, names) or {}).get("synthesise")

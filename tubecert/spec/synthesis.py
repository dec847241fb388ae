"""The section `metric.synthesise`: what kind of metric is asked for. It proves nothing."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final, Literal

from tubecert.expression import suggestion
from tubecert.spec import codes
from tubecert.spec.document import Scalar
from tubecert.spec.names import Names
from tubecert.spec.reader import Field
from tubecert.spec.types import Synthesis

KEYS: Final = (
    "rate",
    "objective",
    "outputs",
    "degree",
    "variables",
    "condition_number",
    "coordinates",
    "route",
    "solver",
)
OBJECTIVES: Final = ("condition", "margin", "rate", "adaptation", "tube")
COORDINATES: Final[tuple[Literal["auto", "identity"], ...]] = ("auto", "identity")
ROUTES: Final = ("auto", "sos", "cegis")
SOLVERS: Final = ("clarabel", "scs")
_THROUGH_CVXPY: Final = re.compile(r"cvxpy:[A-Za-z][A-Za-z0-9_]{0,31}")
MAX_DEGREE: Final = 8
_SEARCHED = "auto"


def read_synthesis(field: Field, names: Names) -> Synthesis | None:
    """What to synthesise; None if something in it is unsound."""
    before = len(field.reader.findings)
    entries = field.mapping(optional=KEYS)
    if entries is None:
        return None
    rate = _unless_auto(entries.get("rate"))
    objective = entries["objective"].word(OBJECTIVES) if "objective" in entries else None
    limit, outputs = entries.get("condition_number"), entries.get("outputs")
    found = Synthesis(
        rate=rate.number(names.values, above=0) if rate else None,
        objective=objective or ("tube" if outputs else "condition" if rate else "adaptation"),
        outputs=_chosen(outputs, names.lengths, "state or output") or (),
        degree=_degree(_unless_auto(entries.get("degree")), names),
        variables=_chosen(_unless_auto(entries.get("variables")), names.states, "state"),
        condition_number=limit.number(names.values, least=1) if limit else None,
        coordinates=_coordinates(entries.get("coordinates")),
        route=entries["route"].word(ROUTES) or "auto" if "route" in entries else "auto",
        solver=_solver(entries["solver"]) or "clarabel" if "solver" in entries else "clarabel",
    )
    _consistent(field, found)
    return found if len(field.reader.findings) == before else None


def _unless_auto(field: Field | None) -> Field | None:
    automatic = field is not None and isinstance(field.node, Scalar) and field.node.text == _SEARCHED
    return None if automatic else field


def _coordinates(field: Field | None) -> Literal["auto", "identity"]:
    word = field.word(COORDINATES) if field else None
    return "identity" if word == "identity" else "auto"


def solver_name(text: str) -> str | None:
    """The solver as it is kept: clarabel, scs, or cvxpy:NAME with the name in capitals; None if it is none of these.

    Whether cvxpy has it is known where it is used.
    """
    if _THROUGH_CVXPY.fullmatch(text):
        library, name = text.split(":")
        return f"{library}:{name.upper()}"
    return text if text in SOLVERS else None


def _solver(field: Field) -> str | None:
    text = field.text("the name of a solver")
    found = None if text is None else solver_name(text)
    if text is not None and found is None:
        field.fail(
            codes.RANGE,
            f"{field.path} is {text[:60]!r}, not one of the choices",
            suggestion(text, SOLVERS, what="choices") + ", or cvxpy:NAME, a solver by its name in cvxpy",
        )
    return found


def _degree(field: Field | None, names: Names) -> int | None:
    value = field.number(names.values, least=0, most=MAX_DEGREE) if field else None
    if field and value is not None and value.denominator != 1:
        field.fail(
            codes.RANGE, f"{field.path} must be a whole number", "write auto, or 0 for a constant metric"
        )
        return None
    return None if value is None else int(value)


def _chosen(field: Field | None, known: Sequence[str], what: str) -> tuple[str, ...] | None:
    items = field.items(None, f"{what}s" if " " not in what else "states and outputs") if field else None
    if field is None or items is None:
        return None
    chosen: list[str] = []
    for item in items:
        word = item.word(known)
        if word in chosen:
            item.fail(codes.RANGE, f"{item.path}: {word} occurs twice", f"name each {what} once")
        elif word:
            chosen.append(word)
    return tuple(chosen)


def _consistent(field: Field, found: Synthesis) -> None:
    """A rate belongs to some objectives, and must be searched for by the others."""
    if found.outputs and found.objective != "tube":
        field.fail(
            codes.RANGE,
            f"{field.path}: outputs are what the tube is to be small in; the objective is {found.objective}",
            "leave the objective out, or write objective: tube",
        )
    needs_rate = found.objective in ("condition", "margin")
    if needs_rate and found.rate is None:
        field.fail(
            codes.MISSING_KEY,
            f"{field.path}: the objective {found.objective} needs a rate",
            "add rate: ..., in 1/s, or choose the objective rate, adaptation or tube",
        )
    if found.objective == "rate" and found.rate is not None:
        field.fail(
            codes.RANGE,
            f"{field.path}: the objective rate searches for the rate; it cannot be given",
            "remove rate, or choose the objective condition or margin",
        )

"""The uncertainty: none at all, or declared bounds that its expression breaks or does not need."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

from tubecert.digits import near
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.objective import SumOfNorms
from tubecert.expression import ZERO, derivatives, free_symbols
from tubecert.expression.matrix import Matrix, column, jacobian
from tubecert.findings import Finding, Severity
from tubecert.lint import codes
from tubecert.lint.codes import finding
from tubecert.model import TIME, build, place
from tubecert.spec import Spec

_LOOSE = 1.25  # a declared bound may exceed the need by this factor before it is worth a word
_BUDGET = 4_000


def uncertainty_findings(spec: Spec, time: Range | None, effort: Effort) -> list[Finding]:
    """Findings about h and its declared bounds."""
    is_met = spec.hardware is None  # by adaptation; a machine may have nothing to compensate
    if spec.uncertainty.h is None:
        return list(_declared_zero(spec)) if is_met else []
    if all(term.expression is ZERO for term in spec.uncertainty.h):
        nothing = _nothing(spec, "uncertainty.h", "h is zero: there is no uncertainty to compensate")
        return [nothing] if is_met else []
    return list(_bounds(spec, time, replace(effort, gap=0.05, budget=min(effort.budget, _BUDGET))))


def _declared_zero(spec: Spec) -> Iterator[Finding]:
    bounds = spec.uncertainty.bounds
    if bounds is not None and bounds.h == 0:
        yield _nothing(
            spec, "uncertainty.bounds.h", "|h| is bounded by 0: there is no uncertainty to compensate"
        )
    if bounds is not None and bounds.h and bounds.h_t == bounds.h_x == 0:
        message = "h_x and h_t are 0: the uncertainty is an unknown constant"
        yield finding(spec, codes.NO_UNCERTAINTY, "uncertainty.bounds", message, severity=Severity.NOTE)


def _nothing(spec: Spec, path: str, message: str) -> Finding:
    help = "give the uncertainty that is expected, or control without adaptation"
    return finding(spec, codes.NO_UNCERTAINTY, path, message, help, severity=Severity.NOTE)


def _bounds(spec: Spec, time: Range | None, effort: Effort) -> Iterator[Finding]:
    """Declared bounds against the expression on the whole safe set (the tube is a part of it)."""
    bounds = spec.uncertainty.bounds
    if bounds is None:
        return
    model = build(spec)
    h = list(model.h or ())
    box: dict[str, Range] = dict(zip(spec.states, spec.safe_set, strict=True))
    if time is not None:
        box[TIME] = time
    elif TIME in free_symbols(h):
        return
    wanted: dict[str, tuple[Fraction | None, Matrix]] = {
        "h": (bounds.h, column(h)),
        "h_x": (bounds.h_x, jacobian(h, model.states)),
        "h_t": (bounds.h_t, column(derivatives(h, TIME))),
    }
    for name, (declared, matrix) in wanted.items():
        if declared is not None:
            yield from _against(spec, name, declared, _needed(matrix, box, effort))


def _needed(matrix: Matrix, box: dict[str, Range], effort: Effort) -> Supremum | None:
    """The supremum of the norm over the safe set; None if it is zero."""
    objective = SumOfNorms([matrix])
    if objective.is_zero:
        return None
    return supremum(objective, BoxDomain({name: box[name] for name in objective.variables}), effort)


def _against(spec: Spec, name: str, declared: Fraction, needed: Supremum | None) -> Iterator[Finding]:
    """A bound that holds on the tube may be broken elsewhere in the safe set: that is a warning, too."""
    path = f"uncertainty.bounds.{name}"
    above = needed.above if needed else 0.0
    if float(declared) > _LOOSE * above:
        message = (
            f"{name} is declared as {near(float(declared))}, but on the safe set {near(above, 3)} suffices"
        )
        help = "declare less, or remove it: it is derived from the expression; a loose bound costs gain"
        yield finding(spec, codes.LOOSE_BOUND, path, message, help)
    elif needed and math.isfinite(needed.below) and Fraction(needed.below) > declared:
        message = (
            f"{name} is declared as {near(float(declared))}, but its expression reaches "
            f"{near(needed.below, 4)} in the safe set, at {place(needed.at)}"
        )
        help = "declare more, unless the tube stays away from there"
        yield finding(spec, codes.BROKEN_BOUND, path, message, help)

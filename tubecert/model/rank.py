"""Whether B has full column rank on the safe set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.interval import fraction_bounds
from tubecert.enclosure.objective import Dependence
from tubecert.enclosure.pencil import scalar
from tubecert.enclosure.taylor import MOST_VERTICES
from tubecert.expression import ZERO, Expression, constant, free_symbols, substitute, topological
from tubecert.expression.matrix import Matrix, TooLargeError, determinant, null_space
from tubecert.model.affine import ControlAffineModel, decimals, nonzero, round_zero
from tubecert.verdict import Verdict

_RANK_BUDGET = 20_000
_SYMBOLIC_WORK = 12_000  # nodes of minors and of their second derivatives: seconds
_PRODUCTS = 200  # of one minor: those of 6 dense rows
_SHORT_DETERMINANT = 3  # columns up to which det(B'B) is written out
_RANK_WORK = 2_000_000  # operations at vertices of boxes for a left inverse of B: about a second


def rank_decision(model: ControlAffineModel, safe_set: Sequence[Range], effort: Effort) -> Decision:
    """Whether B has full column rank on the safe set; refuted with a point where it has not.

    Proven by a left inverse that serves box by box, by one m x m minor that never vanishes, or by det(B'B) > 0. Refuted
    by a sign change of the only minor, or by an exact evaluation at a rational point. Determinants have a budget of
    their own: of a large B, minors beyond it are not looked at, and det(B'B) is not written out.
    """
    box = dict(zip(model.states, safe_set, strict=True))
    minors, complete = _minors(model)
    for d in minors:
        if d.is_constant:
            return Decision(
                verdict=Verdict.CERTIFIED, at={}, value=fraction_bounds(-abs(d.fraction))[1], boxes=0
            )
    entries = [e for row in model.B for e in row]
    own = BoxDomain({v: box[v] for v in sorted(free_symbols(entries))})
    work = len(entries) * len(model.inputs) * 2 ** min(len(free_symbols(entries)), MOST_VERTICES)
    quick = replace(effort, budget=min(effort.budget, _RANK_WORK // work + 1))
    decision = decide(Dependence(model.B), own, 1.0, quick)
    if decision.verdict is Verdict.CERTIFIED:
        return decision
    short = replace(effort, budget=min(effort.budget, _RANK_BUDGET))
    for d in minors:
        decision = nonzero(d, {v: box[v] for v in sorted(free_symbols([d]))}, short)
        only = complete and len(minors) == 1
        if decision.verdict is Verdict.CERTIFIED or (decision.verdict is Verdict.REFUTED and only):
            return decision
    if len(model.inputs) <= _SHORT_DETERMINANT:
        return _gram_decision(model, box, short)
    at = _dependent(model.B, box)
    return replace(decision, verdict=Verdict.UNDECIDED if at is None else Verdict.REFUTED, at=at or {})


def _gram_decision(model: ControlAffineModel, box: dict[str, Range], effort: Effort) -> Decision:
    """Whether det(B'B) > 0 on a box."""
    gram = determinant(model.gram)
    decision = decide(scalar(-gram), BoxDomain(box), 0.0, effort)
    if decision.verdict is not Verdict.UNDECIDED:
        return decision
    at = round_zero(gram, decision.at, box)
    return decision if at is None else replace(decision, verdict=Verdict.REFUTED, at=at)


def _dependent(B: Matrix, ranges: Mapping[str, Range]) -> dict[str, float] | None:
    """A point of few digits at which the columns of B are dependent, exactly: the middle of the box, or 0."""
    for at in ({v: float((a + b) / 2) for v, (a, b) in ranges.items()}, dict.fromkeys(ranges, 0.0)):
        for rounded in decimals(at, ranges):
            values = _exactly(B, rounded)
            if values is not None and null_space(values):
                return rounded
    return None


def _exactly(rows: Matrix, at: Mapping[str, float]) -> list[list[Fraction]] | None:
    """A matrix at the decimals that are shown for a point; None if an entry has no rational value there."""
    exact = {name: constant(Fraction(repr(value))) for name, value in at.items()}
    try:
        values = [substitute(row, exact) for row in rows]
    except ZeroDivisionError:  # a part of it is undefined there
        return None
    if not all(e.is_constant for row in values for e in row):
        return None
    return [[e.fraction for e in row] for row in values]


def _minors(model: ControlAffineModel) -> tuple[list[Expression], bool]:
    """The m x m minors of B that are not identically zero as written, and whether these are all."""
    chosen, complete = model.pivots
    found: list[Expression] = []
    work = 0
    for rows in chosen:
        try:
            d = determinant([model.B[i] for i in rows], _PRODUCTS)
        except TooLargeError:
            return found, False
        if d is not ZERO:
            found.append(d)
            variables = len(free_symbols([d]))  # there are so many second derivatives of every node
            work += len(topological([d])) * (1 + variables * (variables + 1) // 2)
        if work > _SYMBOLIC_WORK:
            return found, False
    return found, complete

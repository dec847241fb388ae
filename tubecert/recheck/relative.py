"""How the drift differs from that of the plan: phi_rel, phi_relM, D_A, and D_pf, what the estimate sees of it."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.statements import NormsBelow, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    Matrix,
    all_zero,
    matrix_replaced,
    number,
    plus,
    scaled,
    times,
    turned,
)
from tubecert.recheck.turning import bordered, definite, is_flat

_MANY = 20_000  # boxes before another way is tried

Known = Callable[[str], Fraction | None]
"""The upper bound of another constant that a certificate states."""


def _difference(place: Place, column: Matrix) -> Matrix:
    """A column of x and u* less what it is at x*, in s and in x - x*; for a plan of one part."""
    return plus(place.around_plan(column), place.on_plan(column), -1)


def drift_difference(place: Place, limit: Fraction) -> Outcome:
    """The difference itself where the plan is one curve, or rho times the slope of f + B u* by z."""
    s, curve, fields = place.system, place.curve, place.fields
    drift = fields.drift
    outcomes = []
    if len(curve.parts) == 1 and not curve.ranges:
        test = NormsBelow([_difference(place, drift)], limit, place.numbers)
        outcomes.append(prove(test, place.ball(), min(place.budget, _MANY)))
        if outcomes[-1].verdict != "undecided":
            return outcomes[-1]
    column = s.drift
    if not curve.moves and not curve.ranges:
        column = matrix_replaced(column, dict(zip(s.inputs, curve.u, strict=True)))
    slope = fields.vector(fields.jacobian(column))
    by_mean = (
        stated(True, "")
        if all_zero(slope)
        else prove(norms_below([slope], limit / place.rho), place.tube(), place.budget)
    )
    return by_mean if by_mean.holds else _not_contradicted(by_mean)


def _not_contradicted(found: Outcome) -> Outcome:
    """A bound that is too large refutes nothing."""
    return Outcome(verdict="undecided", why=found.why, boxes=found.boxes)


def drift_difference_metric(place: Place, limit: Fraction, known: Known) -> Outcome:
    """phi_relM: of M and B that are constant; the difference itself, or rho times the slope of f in the metric."""
    if not is_flat(place):
        return stated(False, "the metric or B is not constant")
    s, curve = place.system, place.curve
    if all_zero(s.f_x):
        return stated(True, "")
    if limit and len(curve.parts) == 1 and not curve.ranges:
        p = _difference(place, s.f)
        corner = [[number(limit**2)]]
        S, unit = (bordered(s.W, a, corner) for a in (p, [[NOUGHT] for _ in s.states]))
        test = PositiveDefinite(S, unit, place.numbers)
        found = prove(test, place.ball(), min(place.budget, _MANY))
        if found.verdict != "undecided":
            return found
    upper = known("upper")
    if upper is None or upper <= 0:
        return Outcome(verdict="undecided", why="the metric has no bound")
    return _not_contradicted_unless_holds(_slope_in_metric(place, limit**2 / (upper * place.rho**2)))


def _not_contradicted_unless_holds(found: Outcome) -> Outcome:
    return found if found.holds else _not_contradicted(found)


def drift_slope_metric(place: Place, limit: Fraction) -> Outcome:
    """D_A."""
    if not is_flat(place):
        return stated(False, "the metric or B is not constant")
    return _slope_in_metric(place, limit**2)


def _slope_in_metric(place: Place, square: Fraction) -> Outcome:
    """f_x W f_x' <= square W."""
    s = place.system
    if all_zero(s.f_x):
        return stated(True, "")
    moved = times(s.f_x, times(s.W, turned(s.f_x)))
    return definite(place, plus(scaled(square, s.W), moved, -1), s.W)


def left_inverse(place: Place) -> Matrix:
    """(S B)^+, (m, n)."""
    B = place.fields.B
    gram = times(turned(B), B)
    d = determinant(gram)
    return times([[e / d for e in row] for row in adjugate(gram)], turned(B))


def drift_explained(place: Place, limit: Fraction, known: Known) -> Outcome:
    """|B^+ f_x| where B is constant; else |B^+| |f_x|, which are taken at two points."""
    fields = place.fields
    if all(all_zero(a) for a in fields.slopes(place.system.B)):
        column = times(left_inverse(place), fields.f_x)
        if all_zero(column):
            return stated(True, "")
        return prove(norms_below([column], limit), place.tube(), place.budget)
    inverse, slope = known("B_pinv"), known("f_x")
    if inverse is None or slope is None:
        return Outcome(verdict="undecided", why="B^+ or f_x has no bound")
    if inverse * slope <= limit or all_zero(fields.f_x):
        return stated(True, "")
    if not inverse:
        return stated(False, "B^+ is not 0")
    found = prove(norms_below([fields.f_x], limit / inverse), place.tube(), place.budget)
    return found if found.holds else _not_contradicted(found)

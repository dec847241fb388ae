"""How the drift differs from that of the plan: phi_rel, phi_relM, D_A, and D_pf, what the estimate sees of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from tubecert.recheck.boxes import Test
from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.reading import TIME
from tubecert.recheck.statements import NormsBelow, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    Matrix,
    all_zero,
    matrix_replaced,
    matrix_slopes,
    number,
    plus,
    scaled,
    times,
    turned,
)
from tubecert.recheck.turning import bordered, definite, is_flat

_FIRST, _MANY = 2_000, 20_000  # boxes before another way is tried

Known = Callable[[str], Fraction | None]
"""The upper bound of another constant that a certificate states."""


def _difference(place: Place, column: Matrix) -> Matrix:
    """A column of x and u* less what it is at x*, in s and in x - x*; for a plan of one part."""
    return plus(place.around_plan(column), place.on_plan(column), -1)


def drift_difference(place: Place, limit: Fraction) -> Outcome:
    """Rho times the slope of f + B u* by z, or the difference itself where the plan is one curve.

    Phi_rel of theory 8.2.
    """
    s, curve = place.system, place.curve
    column = s.drift
    if not curve.moves and not curve.ranges:
        column = matrix_replaced(column, dict(zip(s.inputs, curve.u, strict=True)))
    slope = place.fields.vector(place.fields.jacobian(column))
    if all_zero(slope):
        return stated(True, "")
    by_mean = norms_below([slope], limit / place.rho)
    return _in_turn(
        lambda budget: prove(by_mean, place.tube(), budget),
        lambda: NormsBelow([_difference(place, place.fields.drift)], limit, place.numbers),
        place,
    )


def _in_turn(by_mean: Callable[[int], Outcome], difference: Callable[[], Test], place: Place) -> Outcome:
    """The mean value, which is the cheaper, with few boxes; the difference itself; and the mean value with all."""
    found = by_mean(min(place.budget, _FIRST))
    if found.holds:
        return found
    if len(place.curve.parts) == 1 and not place.curve.ranges:
        direct = prove(difference(), place.ball(), min(place.budget, _MANY))
        if direct.verdict != "undecided":
            return direct
    if found.verdict == "undecided" and place.budget > _FIRST:
        found = by_mean(place.budget)
    return found if found.holds else _not_contradicted(found)


def _not_contradicted(found: Outcome) -> Outcome:
    """A bound that is too large refutes nothing."""
    return Outcome(verdict="undecided", why=found.why, boxes=found.boxes)


def drift_difference_metric(place: Place, limit: Fraction, known: Known) -> Outcome:
    """phi_relM: of M and B that are constant; rho times the slope of f in the metric, or the difference itself."""
    if not is_flat(place):
        return stated(False, "the metric or B is not constant")
    s = place.system
    if all_zero(s.f_x):
        return stated(True, "")
    if not limit:
        return Outcome(
            verdict="undecided", why="f differs from what it is on the plan, as far as can be seen"
        )
    upper = known("upper")

    def by_mean(budget: int) -> Outcome:
        if upper is None or upper <= 0:
            return Outcome(verdict="undecided", why="the metric has no bound")
        return _slope_in_metric(replace(place, budget=budget), limit**2 / (upper * place.rho**2))

    def difference() -> PositiveDefinite:
        p, corner = _difference(place, s.f), [[number(limit**2)]]
        S, unit = (bordered(s.W, a, corner) for a in (p, [[NOUGHT] for _ in s.states]))
        return PositiveDefinite(S, unit, place.numbers)

    return _in_turn(by_mean, difference, place)


def drift_slope_metric(place: Place, limit: Fraction) -> Outcome:
    """D_A of theory 8.2."""
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
    return _explained(place, place.fields.f_x, limit, known("B_pinv"), known("f_x"))


def drift_rate(place: Place, limit: Fraction, known: Known) -> Outcome:
    """|B^+ f_t| where B is constant; else |B^+| |f_t|."""
    slope = place.fields.vector(matrix_slopes(place.system.f, TIME))
    return _explained(place, slope, limit, known("B_pinv"), None)


def _explained(
    place: Place, own: Matrix, limit: Fraction, inverse: Fraction | None, size: Fraction | None
) -> Outcome:
    """|B^+ own| where B is constant, else |B^+| |own|; `inverse` bounds |B^+|, `size` bounds |own| if it is known."""
    if all(all_zero(a) for a in place.fields.slopes(place.system.B)):
        column = times(left_inverse(place), own)
        if all_zero(column):
            return stated(True, "")
        return prove(norms_below([column], limit), place.tube(), place.budget)
    if all_zero(own) or (inverse is not None and size is not None and inverse * size <= limit):
        return stated(True, "")
    if inverse is None:
        return Outcome(verdict="undecided", why="B^+ has no bound")
    if not inverse:
        return stated(False, "B^+ is not 0")
    found = prove(norms_below([own], limit / inverse), place.tube(), place.budget)
    return found if found.holds else _not_contradicted(found)

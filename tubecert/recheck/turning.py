"""How fast the feedback turns as its pair moves, and how fast the plan moves: D_F, D_Fx, D_cx, Ystar, Lus.

Norms in the metric become definiteness at the printed bound t: t W >= F, -F;   |T_v| <= t |v| W, T_v = F_v - W_v M F -
F M W_v;   (B_v' - B'M W_v) M (..)' <= t^2 |v|^2. In coordinates in which a constant W is the identity
|sum v_i A_i y|^2 <= |v|^2 sum |A_i y|^2, so that sum_i T_i M T_i <= t^2 W does for all v at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import exact, sharp_norm
from tubecert.recheck.cover import Boxed, Outcome, prove
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.family import Everyone
from tubecert.recheck.metric import adjugate, determinant, stated, together
from tubecert.recheck.pencils import SlopesBelow
from tubecert.recheck.place import Place
from tubecert.recheck.reading import TIME
from tubecert.recheck.statements import NormsBelow, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Rows,
    Term,
    all_zero,
    function,
    matrix_slopes,
    number,
    plus,
    scaled,
    slopes,
    times,
    turned,
    variable,
)

_FIRST = 2_000  # boxes before another way is tried
_MANY = 20_000
_LESS = 1 - Fraction(1, 10**15)


def is_flat(place: Place) -> bool:
    """Whether the metric and B are constant, as terms."""
    return place.system.flat and all(all_zero(a) for a in place.fields.slopes(place.system.B))


def bordered(W: Rows, p: Rows, corner: Rows) -> Matrix:
    """[W p; p' corner]."""
    above = [[*w, *e] for w, e in zip(W, p, strict=True)]
    return [*above, *([*e, *c] for e, c in zip(turned(p), corner, strict=True))]


def definite(place: Place, S: Rows, unit: Rows) -> Outcome:
    """S > 0 over the tube, measured by `unit`."""
    return prove(PositiveDefinite(S, unit), place.tube(), place.budget)


# -- the feedback


def feedback_slope(place: Place, limit: Fraction) -> Outcome:
    """Both signs of F."""
    s = place.system
    return together([definite(place, plus(scaled(limit, s.W), s.F, sign), s.W) for sign in (1, -1)])


def feedback_drift(place: Place, limit: Fraction) -> Outcome:
    """Both signs of dF/dt."""
    s = place.system
    slope = matrix_slopes(s.F, TIME)
    if all_zero(slope):
        return stated(True, "")
    return together([definite(place, plus(scaled(limit, s.W), slope, sign), s.W) for sign in (1, -1)])


def _cleared(place: Place) -> tuple[Term, Matrix]:
    """(d, d M) with d = det W, or the constant inverse."""
    W = place.system.W
    d, inverse = determinant(W), adjugate(W)
    return (UNIT, [[e / d for e in row] for row in inverse]) if place.system.flat else (d, inverse)


def _turns(place: Place) -> tuple[Matrix, list[Matrix]]:
    """(d W, d T_i) for every direction z_i, d = 1 where W is constant."""
    s, fields = place.system, place.fields
    moved = fields.slopes(s.F)
    if s.flat:
        return s.W, moved
    d, dM = _cleared(place)
    found = []
    for F_i, W_i in zip(moved, fields.slopes(s.W), strict=True):
        half = times(W_i, times(dM, s.F))
        found.append(plus([[d * e for e in row] for row in F_i], plus(half, turned(half)), -1))
    return [[d * e for e in row] for row in s.W], found


def feedback_curvature(place: Place, limit: Fraction) -> Outcome:
    """By all directions as one matrix; by the sum over them; where that is too much, direction by direction."""
    unit, turns = _turns(place)
    moving = [T for T in turns if not all_zero(T)]
    if not moving:
        return stated(True, "")
    if place.system.flat:
        at_once = _stacked(place, moving, limit)
        if at_once.holds:  # else nothing is known: the bound may be too large
            return at_once
    if len(moving) > 1:
        found = prove(SlopesBelow(moving, unit, limit), place.tube(), min(place.budget, _FIRST))
        if found.verdict != "undecided":
            return found
    outcomes = []
    for total, size, others in _directions(moving):
        bound = [[number(limit) * size * e for e in row] for row in unit]
        for sign in (1, -1):
            test = PositiveDefinite(plus(bound, total, sign), unit)
            outcomes.append(prove(test, place.tube(others), min(place.budget, _MANY)))
            if not outcomes[-1].holds:
                break
    return together(outcomes)


def _stacked(place: Place, turns: Sequence[Matrix], limit: Fraction) -> Outcome:
    """sum_i T_i M T_i <= limit^2 W, of a constant metric."""
    W, (_, M) = place.system.W, _cleared(place)
    total = scaled(0, W)
    for T in turns:
        total = plus(total, times(T, times(M, T)))
    test = PositiveDefinite(plus(scaled(limit**2, W), total, -1), W)
    return prove(test, place.tube(), min(place.budget, _MANY))


def _directions(
    matrices: Sequence[Matrix],
) -> Iterator[tuple[Matrix, Term, dict[str, tuple[Fraction, Fraction]]]]:
    """sum_i v_i N_i on the faces v_k = 1 of a cube, with |v| and the ranges of the other v: every v up to its size."""
    symbols = [f"v{i}#" for i in range(len(matrices))]
    for k in range(len(matrices)):
        weights = [UNIT if i == k else variable(name) for i, name in enumerate(symbols)]
        total = scaled(0, matrices[0])
        for weight, a in zip(weights, matrices, strict=True):
            total = plus(total, [[weight * e for e in row] for row in a])
        others = {name: (Fraction(-1), Fraction(1)) for i, name in enumerate(symbols) if i != k}
        yield total, function("norm", *weights) if len(weights) > 1 else UNIT, others


def plan_tilt(place: Place, limit: Fraction) -> Outcome:
    """On the plan; a plan that rests does not turn B'M."""
    s, fields, curve = place.system, place.fields, place.curve
    if not (curve.moves or curve.ranges):
        return stated(True, "")
    d, dM = _cleared(place)
    parts = []
    for B_i, W_i in zip(fields.slopes(s.B), fields.slopes(s.W), strict=True):
        slope = [[d * e for e in row] for row in turned(B_i)]
        parts.append(plus(slope, times(turned(s.B), times(dM, W_i)), -1))
    parts = [C for C in parts if not all_zero(C)]
    if not parts:
        return stated(True, "")
    if not limit:
        return Outcome(verdict="undecided", why="B'M turns along the plan, as far as can be seen")
    m = len(s.inputs)
    outcomes = []
    for C, size, others in _directions(parts):
        square = number(limit**2) * d * d * (size.raised(2) if size is UNIT else _square(size))
        corner = [[square if i == j else NOUGHT for j in range(m)] for i in range(m)]
        S = place.on_plan(bordered(s.W, turned(C), corner))
        nothing = [[NOUGHT] * m for _ in s.states]
        unit = place.on_plan(bordered(s.W, nothing, corner))
        test = PositiveDefinite(S, unit, place.numbers)
        outcomes.append(along(place, test, others))
        if not outcomes[-1].holds:
            break
    return together(outcomes)


def _square(size: Term) -> Term:
    """|v|^2 of the norm of v."""
    return sum((e * e for e in size.args), start=NOUGHT)


def along(
    place: Place, test: PositiveDefinite | NormsBelow, extra: dict[str, tuple[Fraction, Fraction]]
) -> Outcome:
    """A test in s and in other variables on every part of the plan."""
    outcomes: list[Outcome] = []
    for part in place.curve.parts:
        domain = Boxed({CLOCK: (arb(0), part.length), **place.curve.ranges, **extra})
        outcomes.append(prove(test.with_values(part.values), domain, place.budget))
        if not outcomes[-1].holds:
            break
    return together(outcomes)


# -- the plan


def plan_speed(place: Place, limit: Fraction) -> Outcome:
    """|x*'|; of any plan by its drift and the defect that is allowed."""
    curve = place.curve
    if isinstance(curve, Everyone):
        stretch = (
            sharp_norm([[exact(q) for q in row] for row in place.coordinates.S]) if place.coordinates else 1
        )
        room = (exact(limit) - stretch * exact(curve.limit)).lower()
        if not room >= 0:
            return stated(False, "it is below the defect that is allowed")
        drift = place.on_plan(place.fields.drift)
        return place.along(lambda: NormsBelow([drift], Fraction(float(room)) * _LESS, place.numbers))
    if not curve.moves:
        return stated(True, "")
    slope = place.fields.vector([[e] for e in curve.slope])
    return place.along(lambda: NormsBelow([slope], limit, place.numbers))


def input_rate(place: Place, limit: Fraction) -> Outcome:
    """|u*'| on every part; where the parts do not join, u* has no such rate."""
    curve = place.curve
    if curve.ranges:
        still = isinstance(curve, Everyone) and all(low == high for low, high in curve.boxes[1])
        return stated(still, "u* may be anything in its box at any time")
    if _jumps(place):
        return stated(False, "u* jumps")
    rate = slopes(curve.u, CLOCK)
    if all(e is NOUGHT for e in rate):
        return stated(True, "")
    return place.along(lambda: NormsBelow([[[e] for e in rate]], limit, place.numbers))


def _jumps(place: Place) -> bool:
    """Whether u* is held between knots (every part has slope 0), and not the same everywhere."""
    curve = place.curve
    if len(curve.parts) == 1:
        return False
    m = range(len(curve.u))
    held = all(part.values[f"u{j}#1"].is_zero() for part in curve.parts for j in m)
    first = curve.parts[0].values
    return held and not all(
        (part.values[f"u{j}#0"] - first[f"u{j}#0"]).is_zero() for part in curve.parts for j in m
    )

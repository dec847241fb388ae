"""The constants that certificate H needs beside those of A, B and C, each as a claim over the tube or on the plan.

Written from their definitions (theory 8.2) in the coordinates z of the tube; noise n is given in x. With W = L L' and
Theta = L^-1, norms in the metric become definiteness at the printed bound t, multiplied by det W or det B'B where these
would stand in divisors:
    D_F: t W >= F, -F;   D_Fx: |T_v| <= t |v| W, T_v = F_v - W_v M F - F M W_v;   |Theta p| <= t: [W p; p' t^2] >= 0;
    D_cx: (B_v' - B'M W_v) M (..)' <= t^2 |v|^2;   |Theta f_x Theta^-1| <= t: f_x W f_x' <= t^2 W;   n_B: |(SB)^+ S n|.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from itertools import product

from flint import arb

from tubecert.recheck.balls import Ball, exact, length, sharp_norm
from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Boxed, Outcome, prove
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.family import Everyone
from tubecert.recheck.geodesics import SymbolsBelow
from tubecert.recheck.metric import adjugate, determinant, stated, together, upper_bound
from tubecert.recheck.pencils import SlopesBelow
from tubecert.recheck.place import Place
from tubecert.recheck.specified.numbers import Numbers
from tubecert.recheck.statements import NormsBelow, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    UNIT,
    Matrix,
    Rows,
    Term,
    all_zero,
    function,
    matrix_replaced,
    number,
    plus,
    scaled,
    slopes,
    times,
    turned,
    variable,
)
from tubecert.recheck.unknown import joins
from tubecert.recheck.wind import adapted

ALWAYS = (
    "feedback_slope",
    "feedback_curvature",
    "plan_tilt",
    "plan_speed",
    "drift_difference",
    "drift_explained",
    "noise_size",
    "noise_metric",
    "noise_explained",
    "symbols",
    "symbols_slope",
)
OF_CONSTANT_METRICS = ("drift_difference_metric", "drift_slope_metric")
OF_HELD_INPUTS = ("input_rate",)

NAMES = (*ALWAYS, *OF_CONSTANT_METRICS, *OF_HELD_INPUTS)

_FIRST = 2_000  # boxes before another way is tried
_MANY = 20_000
_LESS = 1 - Fraction(1, 10**15)

Known = Callable[[str], Fraction | None]
"""The upper bound of another constant that a certificate states."""


def bounded(place: Place, name: str, limit: Fraction, noise: Numbers | None, known: Known) -> Outcome:
    """Whether the constant `name` is at most `limit`.

    One unit of noise is |n| <= 1 in x where `noise` is None, else |n_i| <= noise_i. `known` are upper bounds that the
    certificate states, and that are examined for themselves.
    """
    if limit < 0:
        return stated(False, "it is negative")
    if name in _OF_NOISE:
        return _OF_NOISE[name](place, limit, noise)
    if name in _OF_OTHERS:
        return _OF_OTHERS[name](place, limit, known)
    return _CLAIMS[name](place, limit)


def is_flat(place: Place) -> bool:
    """Whether the metric and B are constant, as terms."""
    return place.system.flat and all(all_zero(a) for a in place.fields.slopes(place.system.B))


def bordered(W: Rows, p: Rows, corner: Rows) -> Matrix:
    """[W p; p' corner]."""
    above = [[*w, *e] for w, e in zip(W, p, strict=True)]
    return [*above, *([*e, *c] for e, c in zip(turned(p), corner, strict=True))]


def _definite(place: Place, S: Rows, unit: Rows) -> Outcome:
    return prove(PositiveDefinite(S, unit), place.tube(), place.budget)


# -- the feedback


def _feedback_slope(place: Place, limit: Fraction) -> Outcome:
    """Both signs of F."""
    s = place.system
    return together([_definite(place, plus(scaled(limit, s.W), s.F, sign), s.W) for sign in (1, -1)])


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


def _feedback_curvature(place: Place, limit: Fraction) -> Outcome:
    """By the sum over all directions; where that is too much, direction by direction."""
    unit, turns = _turns(place)
    moving = [T for T in turns if not all_zero(T)]
    if not moving:
        return stated(True, "")
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


def _plan_tilt(place: Place, limit: Fraction) -> Outcome:
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


def _plan_speed(place: Place, limit: Fraction) -> Outcome:
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


def _input_rate(place: Place, limit: Fraction) -> Outcome:
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


# -- the drift


def _difference(place: Place, column: Matrix) -> Matrix:
    """A column of x and u* less what it is at x*, in s and in x - x*; for a plan of one part."""
    return plus(place.around_plan(column), place.on_plan(column), -1)


def _drift_difference(place: Place, limit: Fraction) -> Outcome:
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


def _drift_difference_metric(place: Place, limit: Fraction, known: Known) -> Outcome:
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


def _drift_slope_metric(place: Place, limit: Fraction) -> Outcome:
    if not is_flat(place):
        return stated(False, "the metric or B is not constant")
    return _slope_in_metric(place, limit**2)


def _slope_in_metric(place: Place, square: Fraction) -> Outcome:
    """f_x W f_x' <= square W."""
    s = place.system
    if all_zero(s.f_x):
        return stated(True, "")
    moved = times(s.f_x, times(s.W, turned(s.f_x)))
    return _definite(place, plus(scaled(square, s.W), moved, -1), s.W)


def _left_inverse(place: Place) -> Matrix:
    """(S B)^+, (m, n)."""
    B = place.fields.B
    gram = times(turned(B), B)
    d = determinant(gram)
    return times([[e / d for e in row] for row in adjugate(gram)], turned(B))


def _drift_explained(place: Place, limit: Fraction, known: Known) -> Outcome:
    """|B^+ f_x| where B is constant; else |B^+| |f_x|, which are taken at two points."""
    fields = place.fields
    if all(all_zero(a) for a in fields.slopes(place.system.B)):
        column = times(_left_inverse(place), fields.f_x)
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


# -- noise


def _corners(sizes: Numbers) -> Iterator[Matrix]:
    """The corners of a box around 0 in x, one of every two opposite ones, as columns."""
    signs = [(1,) if not size or i == 0 else (1, -1) for i, size in enumerate(sizes)]
    for chosen in product(*signs):
        yield [[number(sign * size)] for sign, size in zip(chosen, sizes, strict=True)]


def _noise_size(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|S n|."""
    S = None if place.coordinates is None else [[exact(q) for q in row] for row in place.coordinates.S]
    if noise is None:
        most = arb(1) if S is None else sharp_norm(S)
        return stated(bool(most <= exact(limit)), "it is less than |S|")
    within = all(_length(place.fields.vector(corner)) <= exact(limit) for corner in _corners(noise))
    return stated(within, "a corner of the box of noise is longer")


def _length(column: Matrix) -> Ball:
    """The length of a column of numbers."""
    return length([exact(_number(e)) for (e,) in column])


def _number(e: Term) -> Fraction:
    assert isinstance(e.value, Fraction)
    return e.value


def _noise_metric(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|Theta n|: M <= limit^2, or at every corner."""
    if noise is None:
        return upper_bound(place.system, limit**2, place.tube(), place.budget)
    if not any(noise):
        return stated(True, "")
    if not limit:
        return stated(False, "there is noise")
    W, corner = place.system.W, [[number(limit**2)]]
    nothing = [[NOUGHT] for _ in place.system.states]
    unit = bordered(W, nothing, corner)
    return together([_definite(place, bordered(W, n, corner), unit) for n in _corners(noise)])


def _noise_explained(place: Place, limit: Fraction, noise: Numbers | None) -> Outcome:
    """|(S B)^+ S n|: B'S' S S' S B <= limit^2 (B'S'S B)^2, or at every corner."""
    fields = place.fields
    B = fields.B
    if noise is None:
        gram = times(turned(B), B)
        stretched = times(turned(B), fields.vector(_unit(place)))
        square = times(gram, gram)
        S = plus(scaled(limit**2, square), times(stretched, turned(stretched)), -1)
        return _definite(place, S, square)
    inverse = _left_inverse(place)
    columns = [times(inverse, fields.vector(n)) for n in _corners(noise)]
    outcomes = [
        stated(True, "") if all_zero(a) else prove(norms_below([a], limit), place.tube(), place.budget)
        for a in columns
    ]
    return together(outcomes)


def _unit(place: Place) -> Matrix:
    n = range(len(place.system.states))
    return [[UNIT if i == j else NOUGHT for j in n] for i in n]


# -- geodesics


def _symbols(place: Place, limit: Fraction, order: int) -> Outcome:
    """|Gamma| or |dGamma|, by the norms of unfoldings: a bound that is too large refutes nothing."""
    if place.system.flat:
        return stated(True, "")
    return prove(SymbolsBelow(place.fields, order, limit), place.tube(), place.budget)


_CLAIMS: dict[str, Callable[[Place, Fraction], Outcome]] = {
    "feedback_slope": _feedback_slope,
    "feedback_curvature": _feedback_curvature,
    "plan_tilt": _plan_tilt,
    "plan_speed": _plan_speed,
    "drift_difference": _drift_difference,
    "drift_slope_metric": _drift_slope_metric,
    "input_rate": _input_rate,
    "symbols": lambda place, limit: _symbols(place, limit, 0),
    "symbols_slope": lambda place, limit: _symbols(place, limit, 1),
}
_OF_OTHERS: dict[str, Callable[[Place, Fraction, Known], Outcome]] = {
    "drift_difference_metric": _drift_difference_metric,
    "drift_explained": _drift_explained,
}
_OF_NOISE: dict[str, Callable[[Place, Fraction, Numbers | None], Outcome]] = {
    "noise_size": _noise_size,
    "noise_metric": _noise_metric,
    "noise_explained": _noise_explained,
}


# -- the set that the estimate is clipped to


def clips(place: Place, box: Sequence[tuple[Fraction, Fraction]], bound: Fraction | None) -> Outcome:
    """Whether a box of the inputs contains 0 and every value of h.

    h as expressions, with what is adapted to of a disturbance; where |h| itself is declared, the ball of `bound` = Dh.
    """
    s = place.system
    if not all(low <= 0 <= high for low, high in box):
        return stated(False, "0 is not in the set that the estimate is clipped to")
    if s.h is None or "h" in s.declared:
        if bound is None:
            return Outcome(verdict="undecided", why="|h| has no bound")
        if any(min(-low, high) < bound for low, high in box):
            return stated(False, "a declared |h| may point out of the box that the estimate is clipped to")
    if s.h is None:
        return stated(True, "")
    more, known, outcomes = adapted(place), joins(place), []
    for i, (low, high) in enumerate(box):
        own = s.h[i][0] if known is None else s.h[i][0] + known[i][0]
        shifted = [[[own - number((low + high) / 2)]]]
        if more is not None:
            shifted.append([more[i]])
        outcomes.append(prove(norms_below(shifted, (high - low) / 2), place.tube(), place.budget))
        if not outcomes[-1].holds:
            break
    return together(outcomes)

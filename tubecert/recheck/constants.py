"""Every constant of the certificate as a claim: the supremum over O(rho) (or on the plan) is at most what is printed.

Written from the definitions (2.1)-(2.8) of the theory. Largest eigenvalues become definiteness at the printed bound:
    |B^+| <= t: B'B >= I/t^2;   beta <= t: t^2 W >= B B';   |M W_i M| <= t: t W^2 >= W_i and >= -W_i;
    |Theta p| <= t: [W p; p' t^2] >= 0;   du <= t: t (B B'/mu + mu W) >= F for all mu > 0 up to smax(Theta B).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction

from tubecert.recheck.balls import ceiling, exact, root, sharp_norm
from tubecert.recheck.boxes import Test
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Boxed, Outcome, in_turn, prove, stated, together
from tubecert.recheck.curve import Everyone
from tubecert.recheck.identity import vanish
from tubecert.recheck.lipschitz import LipschitzBelow, norms_below, slopes_below
from tubecert.recheck.metric import adjugate, determinant, lower_bound, upper_bound
from tubecert.recheck.norms import norms
from tubecert.recheck.pencils import GainBelow, SlopesBelow
from tubecert.recheck.place import Place
from tubecert.recheck.specified.numbers import TIME
from tubecert.recheck.statements import NormsBelow, NotNegative, PositiveDefinite
from tubecert.recheck.terms import (
    NOUGHT,
    Matrix,
    Term,
    all_zero,
    blocks,
    in_order,
    matrix_replaced,
    number,
    plus,
    scaled,
    times,
    turned,
    unit_matrix,
)
from tubecert.recheck.wind import added_to, joins, least_sum

_ROUND_UP = 1 + Fraction(1, 10**15)  # the end of a ball as the float next to it: off by <= 2^-53 of itself
_SOME = 2_000  # before the tube is examined part by part of the plan


def bounded(place: Place, name: str, limit: Fraction, largest: Fraction | None) -> Outcome:
    """Whether the constant `name` is at most `limit` (`lower`: at least).

    `largest` is a bound of smax(Theta B) over the tube, None if none is claimed.
    """
    if name == "lower":
        return lower_bound(place.system, limit, place.tube(), place.budget, place.fields.unit)
    if name == "upper":
        return upper_bound(place.system, limit, place.tube(), place.budget, place.fields.unit)
    if limit < 0:  # all are norms, gains and lengths
        return stated(False, "it is negative")
    if name == "feedback_gain":
        if largest is None:
            return Outcome(verdict="undecided", why="|B| or the metric has no bound")
        return feedback_gain(place, limit, largest)
    return _CLAIMS[name](place, limit)


def _left_inverse_slopes(fields: Fields) -> list[Matrix]:
    """d(B^+) = G^-1 dB' (I - B B^+) - B^+ dB B^+, G = B'B: enclosures of the derivative of quotients would be wide.

    For (2.2).
    """
    B, plain = fields.B, fields.B_pinv
    gram = times(turned(B), B)
    d = determinant(gram)
    inverse = [[e / d for e in row] for row in adjugate(gram)]
    beside = plus(unit_matrix(len(B)), times(B, plain), -1)

    def along(slope: Matrix) -> Matrix:
        if all_zero(slope):
            return scaled(0, plain)
        tilted = times(times(inverse, turned(slope)), beside)
        return plus(tilted, times(times(plain, slope), plain), -1)

    return [along(slope) for slope in fields.slopes(B)]


def _left_inverse(place: Place, limit: Fraction) -> Outcome:
    """|B^+| <= t, (2.1): B'B >= I/t^2."""
    if not limit:
        return stated(False, "it is zero")
    gram = times(turned(place.fields.B), place.fields.B)
    least = scaled(1 / limit**2, unit_matrix(len(gram)))
    return prove(PositiveDefinite(plus(gram, least, -1), gram), place.tube(), place.budget)


def _metric_slope(place: Place, limit: Fraction) -> Outcome:
    fields = place.fields
    moving = [slope for slope in fields.W_x if not all_zero(slope)]
    if not moving:
        return stated(limit >= 0, "it is negative")
    return prove(SlopesBelow(moving, times(fields.W, fields.W), limit), place.tube(), place.budget)


def feedback_gain(place: Place, limit: Fraction, largest: Fraction) -> Outcome:
    """F <= t (B B'/mu + mu W) for all mu in (0, largest]; where F is 0, t = 0 serves."""
    if vanish([e for row in place.system.F for e in row]):
        return stated(True, "")
    return prove(GainBelow(place.system, limit, largest), place.tube(), place.budget)


def _input_on_plan(place: Place, limit: Fraction) -> Outcome:
    """Dus on the plan, assumption 2."""
    return place.along(lambda: NormsBelow([[[e] for e in place.curve.u]], limit, place.numbers))


def _drift(place: Place, limit: Fraction) -> Outcome:
    """phi, (2.4)."""
    s, curve = place.system, place.curve
    drift = place.fields.drift
    if curve.moves and not curve.ranges:
        many = len(curve.parts) > 1
        found = prove(norms_below([drift], limit), place.tube(), min(place.budget, _SOME)) if many else None
        return (
            found if found is not None and found.verdict != "undecided" else place.beside_plan(drift, limit)
        )
    if not curve.moves:
        drift = matrix_replaced(drift, dict(zip(s.inputs, curve.u, strict=True)))
    return norms(place, [drift], limit)


def _metric_input_gain(place: Place, limit: Fraction) -> Outcome:
    """beta <= t, (2.5): t^2 W >= B B'."""
    s = place.system
    W, BBt = place.on_plan(s.W), place.on_plan(s.BBt)
    S = plus(scaled(limit**2, W), BBt, -1)
    return place.along(lambda: PositiveDefinite(S, W, place.numbers))


def defect(place: Place) -> Matrix:
    """x*' - f(x*) - B(x*) u* along the plan, (n, 1), by its components in x."""
    slope = [[e] for e in place.curve.slope]
    return plus(slope, place.on_plan(place.system.drift), -1)


def _defect_zero(place: Place, p: Matrix) -> bool:
    return len(place.curve.parts) == 1 and not place.numbers and vanish([row[0] for row in p])


def _plan_defect(place: Place, limit: Fraction) -> Outcome:
    if isinstance(place.curve, Everyone):
        return _allowed_defect(place, place.curve, limit)
    p = defect(place)
    if _defect_zero(place, p):
        return stated(True, "")
    return place.along(lambda: NormsBelow([place.fields.vector(p)], limit, place.numbers))


def _allowed_defect(place: Place, curve: Everyone, limit: Fraction) -> Outcome:
    """|S p| <= |S| |p|, attained by some p that is allowed; |p| where there is no S, (4.10)."""
    if place.coordinates is None:
        return stated(limit >= curve.limit, "it is below the defect that is allowed")
    own = exact(curve.limit) * sharp_norm([[exact(q) for q in row] for row in place.coordinates.S])
    return stated(bool(own <= exact(limit)), "it is below the defect that is allowed")


def _allowed_defect_metric(place: Place, curve: Everyone, limit: Fraction) -> Outcome:
    """|Theta p| <= limit on P for every |p| that is allowed: M <= (limit/|p|)^2 I, (4.10)."""
    if not curve.limit or not limit:
        return stated(limit >= curve.limit, "it is below the defect that is allowed")
    s = place.system
    P = Boxed(dict(zip(s.states, curve.boxes[0], strict=True)))
    return upper_bound(s, (limit / curve.limit) ** 2, P, place.budget)


def _plan_defect_metric(place: Place, limit: Fraction) -> Outcome:
    """|Theta p| <= t, (2.7): [W p; p' t^2] >= 0."""
    if isinstance(place.curve, Everyone):
        return _allowed_defect_metric(place, place.curve, limit)
    p = defect(place)
    if _defect_zero(place, p):
        return stated(True, "")
    if not limit:  # only a point at which the defect is proven not to vanish contradicts
        return place.along(lambda: NormsBelow([p], limit, place.numbers))
    W = place.on_plan(place.system.W)
    top = number(limit**2)
    S = [*([*row, e] for row, (e,) in zip(W, p, strict=True)), [*(e for (e,) in p), top]]
    unit = [*([*row, NOUGHT] for row in W), [*(NOUGHT for _ in p), top]]
    return place.along(lambda: PositiveDefinite(S, unit, place.numbers))


def _uncertainty(place: Place, limit: Fraction, name: str) -> Outcome:
    s, known = place.system, joins(place)
    adapts = s.wind is not None and s.wind.rate is not None
    if known is not None:
        return _joined(place, limit, name, known, added_to(place, name) if adapts else [])
    return _adapted(place, limit, name) if adapts else _own_uncertainty(place, limit, name)


def _joined(place: Place, limit: Fraction, name: str, known: Matrix, added: list[Matrix]) -> Outcome:
    """Of h + B^+ (f(x, theta) - f(x)), and of B^+ E w with it: with the declared bound of h, and with h as it is.

    (7.1).
    """
    s, outcomes = place.system, []
    if name in s.declared:
        outcomes.append(_with_known(place, limit - _declared(place, name), name, known, added))
    if s.h is not None:
        outcomes.append(_with_known(place, limit, name, plus(s.h, known), added))
    return together(outcomes) if outcomes else stated(False, "it is neither declared nor derived")


def _with_known(place: Place, room: Fraction, name: str, entries: Matrix, added: list[Matrix]) -> Outcome:
    """Of the entries, and of what a disturbance adds to them, (7.1)."""
    if room < 0:
        return stated(False, "it is below what is declared")
    if name == "h":
        return norms(place, [entries, *added], room)
    if name == "h_t":
        return prove(slopes_below(entries, TIME, room, added), place.tube(), place.budget)
    most = least_sum(added, place, room) if added else Fraction(0)
    if most is None:
        return Outcome(verdict="undecided", why="what a disturbance adds is not below it")
    test: Test = LipschitzBelow([row[0] for row in entries], place.fields, room - most)
    found = prove(test, place.tube(), place.budget)
    return found if found.holds or not added else Outcome(verdict="undecided", why=found.why)


def _declared(place: Place, name: str) -> Fraction:
    """A declared bound, in z where it is a Lipschitz constant; rounded up, theory 1a."""
    own = place.system.declared[name]
    if name != "h_x" or place.coordinates is None:
        return own
    stretch = sharp_norm([[exact(q) for q in row] for row in place.coordinates.inverse])
    return Fraction(float((exact(own) * stretch).upper())) * _ROUND_UP


def _adapted(place: Place, limit: Fraction, name: str) -> Outcome:
    """Of h + B^+ E w: together with what the second part adds; where that fails, the first has what that leaves.

    (7.1).
    """
    s, added = place.system, added_to(place, name)
    if not added:
        return _own_uncertainty(place, limit, name)
    if s.h is not None and name not in s.declared and name != "h_x":
        if name == "h":
            return norms(place, [s.h, *added], limit)
        return prove(slopes_below(s.h, TIME, limit, added), place.tube(), place.budget)
    most = least_sum(added, place, limit)
    if most is None:
        return Outcome(verdict="undecided", why="what a disturbance adds is not below it")
    found = _own_uncertainty(place, limit - most, name)
    return found if found.holds else Outcome(verdict="undecided", why=found.why, boxes=found.boxes)


def _own_uncertainty(place: Place, limit: Fraction, name: str) -> Outcome:
    """The same without what a disturbance adds."""
    s = place.system
    if name in s.declared and not _covers(limit, place, name):
        return stated(False, f"it is below the declared {float(s.declared[name]):g}")
    if s.h is None:
        return stated(name in s.declared, "it is neither declared nor derived")
    if name == "h_x":
        return _lipschitz(place, [row[0] for row in s.h], limit)
    if name == "h_t":
        return prove(slopes_below(s.h, TIME, limit), place.tube(), place.budget)
    return norms(place, [s.h], limit)


def _lipschitz(place: Place, h: Sequence[Term], limit: Fraction) -> Outcome:
    """|dh/dz| <= limit, of smooth entries part by part."""
    if not any(e.op == "norm" for e in in_order(h)):
        parts = blocks(place.fields.jacobian([[e] for e in h]))
        if len(parts) > 1:
            return together([prove(NormsBelow([part], limit), place.tube(), place.budget) for part in parts])
    return prove(LipschitzBelow(h, place.fields, limit), place.tube(), place.budget)


def _covers(limit: Fraction, place: Place, name: str) -> bool:
    """Whether a declared bound is at most this; a Lipschitz constant in x is one in z, times |S^-1|."""
    own = place.system.declared[name]
    if name != "h_x" or place.coordinates is None:
        return own <= limit
    stretch = sharp_norm([[exact(q) for q in row] for row in place.coordinates.inverse])
    return bool(exact(own) * stretch <= exact(limit))


_CLAIMS: dict[str, Callable[[Place, Fraction], Outcome]] = {
    "f": lambda p, t: norms(p, [p.fields.f], t),
    "f_x": lambda p, t: norms(p, [p.fields.f_x], t),
    "B": lambda p, t: norms(p, [p.fields.B], t),
    "B_x": lambda p, t: norms(p, p.fields.slopes(p.fields.B), t),
    "b_x": lambda p, t: norms(p, p.fields.b_x, t),
    "B_pinv": _left_inverse,
    "B_pinv_x": lambda p, t: norms(p, _left_inverse_slopes(p.fields), t),
    "M_x": _metric_slope,
    "u_star": _input_on_plan,
    "h": lambda p, t: _uncertainty(p, t, "h"),
    "h_x": lambda p, t: _uncertainty(p, t, "h_x"),
    "h_t": lambda p, t: _uncertainty(p, t, "h_t"),
    "metric_input_gain": _metric_input_gain,
    "drift_on_plan": _drift,
    "plan_defect": _plan_defect,
    "plan_defect_metric": _plan_defect_metric,
}

OVER_TUBE = ("lower", "upper", *_CLAIMS, "feedback_gain")
"""The constants that are suprema over the tube or the plan; those of the start are claims of `start`."""


def largest_push(B: Fraction | None, upper: Fraction | None) -> Fraction | None:
    """smax(Theta B) <= |B| sqrt(A); None where one of them is not bounded."""
    if B is None or upper is None:
        return None
    return Fraction(ceiling(exact(B) * root(exact(upper)))) if upper > 0 else Fraction(0)


def contained(place: Place) -> Outcome:
    """Assumption 1: x* stays at least rho, or its half-width, away from every face of the safe set."""
    s = place.system
    sides = (place.rho,) * len(s.states) if place.sides is None else place.sides
    rooms = []
    for name, side, x in zip(s.states, sides, place.curve.x, strict=True):
        low, high = s.safe_set[name]
        rooms += [number(high - side) - x, x - number(low + side)]
    return in_turn(place.along(lambda room=room: NotNegative(room, place.numbers)) for room in rooms)  # type: ignore[misc]


def half_width(place: Place, row: Sequence[Fraction], width: Fraction, lower: Fraction) -> Outcome:
    """|c'(x - x*)| <= min(|c| rho, sqrt(a) rho sup sqrt(c'W c)) <= width; without rho where it is no length in x.

    In coordinates of its own the tube is cut to the half-widths: the supremum is over what they leave.
    (1.7), (1.8), theory 4.3.
    """
    if width <= 0:
        return stated(False, "it is not positive")
    if place.coordinates is None and width**2 >= sum(q * q for q in row) * place.rho**2:
        return stated(True, "")
    top = number(width**2 / (lower * place.rho**2))
    return prove(NotNegative(top - place.system.squared(row)), place.tube(), place.budget)

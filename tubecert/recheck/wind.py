"""Claims about what acts beside f and the inputs: a disturbance E(x) w, and parameters of f of which a range is known.

f is that of the middles; what is not known of it is f(x, theta) - f(x). Of both, what B^+ makes of them is what inputs
can make: with a rate of w, and always of the drift, it is a part of h. v - B B^+ v is beside the inputs: with a rate,
E stands for that. Written from theory 7; everything in the coordinates of the tube, where E is S E and B^+ is (S B)^+;
theta is a variable of every test.
"""

from __future__ import annotations

from fractions import Fraction

from tubecert.recheck.cover import Domain, Outcome, prove, stated
from tubecert.recheck.identity import vanish
from tubecert.recheck.lipschitz import norms_below
from tubecert.recheck.place import Place
from tubecert.recheck.specified.loop import Disturbance
from tubecert.recheck.statements import PositiveDefinite
from tubecert.recheck.terms import NOUGHT, Matrix, all_zero, names, plus, scaled, times, turned

CONSTANTS = ("wind_push", "wind_size", "wind_explained")
OF_UNKNOWN = ("residual_push", "residual_size")

_HALVINGS, _FINE = 20, 60  # of a limit; of one that is no supremum
_FIRST = 4_000  # boxes for each share of a limit


def _wind(place: Place) -> Disturbance:
    """The disturbance; `ValueError` where there is none."""
    if place.system.wind is None:
        raise ValueError("the specification has no disturbance")
    return place.system.wind


def _explained(place: Place) -> Matrix:
    """B^+ E, (m, k), (7.1)."""
    return times(place.fields.B_pinv, place.fields.vector(_wind(place).E))


def _beside(place: Place) -> Matrix:
    """(I - B B^+) E: what no input reaches."""
    return plus(place.fields.vector(_wind(place).E), times(place.fields.B, _explained(place)), -1)


def _pushing(place: Place) -> Matrix:
    """What is not adapted to: E, or (I - B B^+) E where there is a rate."""
    wind = _wind(place)
    return _beside(place) if wind.rate is not None else place.fields.vector(wind.E)


def _unknown_drift(place: Place) -> Matrix | None:
    """f(x, theta) - f(x), (n, 1); None if all of f is known."""
    s = place.system
    return None if s.unknown is None else place.fields.vector(plus(s.unknown, s.f, -1))


def joins(place: Place) -> Matrix | None:
    """What of it is a part of h, (m, 1), (7.1); None if f is known."""
    drift = _unknown_drift(place)
    return None if drift is None else times(place.fields.B_pinv, drift)


def unknown_bounded(place: Place, name: str, limit: Fraction) -> Outcome:
    """Whether one of `OF_UNKNOWN` is at most `limit`: of what no input reaches; what is proven to vanish is 0."""
    drift, known = _unknown_drift(place), joins(place)
    if drift is None or known is None:
        raise ValueError("every parameter is known")
    if limit < 0:
        return stated(False, "it is negative")
    left = plus(drift, times(place.fields.B, known), -1)
    rest = [[NOUGHT if vanish([e]) else e] for (e,) in left]
    if name == OF_UNKNOWN[0]:
        return _metric_norm(place, rest, limit)
    return _norm(rest, limit, place.tube(), place.budget)


def bounded(place: Place, name: str, limit: Fraction, matched: Fraction | None) -> Outcome:
    """Whether one of `CONSTANTS` is at most `limit`; `matched` is a bound of beta eps_w."""
    if limit < 0:
        return stated(False, "it is negative")
    if name == CONSTANTS[0]:
        return _push(place, limit, matched)
    if name == CONSTANTS[1]:
        return _norm(_pushing(place), limit, place.tube(), place.budget)
    if _wind(place).rate is not None:  # nothing is left of it where it is adapted to
        return stated(limit >= 0, "it is negative")
    return _norm(_explained(place), limit, place.tube(), place.budget)


def _push(place: Place, limit: Fraction, matched: Fraction | None) -> Outcome:
    """|g'M E| <= limit for a unit geodesic g: smax(Theta E), or `matched` (beta eps_w) with that of (I - B B^+) E.

    (7.2).
    """
    found = _metric_norm(place, _pushing(place), limit)
    if found.holds or matched is None or _wind(place).rate is not None:
        return found
    apart = _metric_norm(place, _beside(place), limit - matched)
    return apart if apart.holds else found


def _metric_norm(place: Place, E: Matrix, limit: Fraction) -> Outcome:
    """|Theta E| <= limit: limit^2 W >= E E', (7.2)."""
    if all_zero(E):
        return stated(limit >= 0, "it is negative")
    if limit <= 0:
        return Outcome(verdict="undecided", why="there is no room for it")
    W = place.fields.W
    S = plus(scaled(limit**2, W), times(E, turned(E)), -1)
    return prove(PositiveDefinite(S, W), place.tube(), place.budget)


def _norm(a: Matrix, limit: Fraction, domain: Domain, budget: int) -> Outcome:
    """|a| <= limit."""
    if limit < 0:
        return stated(False, "it is negative")
    if all_zero(a):
        return stated(True, "")
    return prove(norms_below([a], limit), domain, budget)


def adapted(place: Place) -> Matrix | None:
    """bound B^+ E, the part of h that a disturbance with a rate is; None if there is none."""
    wind = place.system.wind
    if wind is None or wind.rate is None:
        return None
    return scaled(wind.length, _explained(place))


def added_to(place: Place, name: str) -> list[Matrix]:
    """Matrices the sum of whose norms is what B^+ E w adds to |h|, to its slope in x, or to its rate."""
    wind, more = place.system.wind, adapted(place)
    assert wind is not None
    assert wind.rate is not None
    assert more is not None
    if name == "h_x":
        found = place.fields.slopes(more)
    elif name == "h":
        found = [more]
    else:
        found = [scaled(wind.rate, _explained(place))]
    return [a for a in found if not all_zero(a)]


def least_sum(matrices: list[Matrix], place: Place, most: Fraction) -> Fraction | None:
    """About the least bound of a sum of norms that can be proven over the tube, `most` at most; None if none can."""
    low, high = Fraction(0), most

    def serves(limit: Fraction) -> bool:
        return prove(norms_below(matrices, limit), place.tube(), min(_FIRST, place.budget)).holds

    if not serves(high):
        return None
    for _ in range(_HALVINGS if names(e for a in matrices for row in a for e in row) else _FINE):
        middle = (low + high) / 2
        low, high = (low, middle) if serves(middle) else (middle, high)
    return high

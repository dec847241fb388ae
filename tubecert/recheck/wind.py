"""Claims about a disturbance E(x) w: how it pushes, how fast it moves, what of it the inputs explain.

With a rate, E stands for (I - B B^+) E, and B^+ E w is a part of h. Written from theory 7; everything in the
coordinates of the tube, where E is S E and B^+ is (S B)^+.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.recheck.branches import norms_below
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Domain, Outcome, prove
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.specified.hardware import Disturbance
from tubecert.recheck.statements import PositiveDefinite
from tubecert.recheck.terms import Matrix, all_zero, names, plus, scaled, times, turned

CONSTANTS = ("wind_push", "wind_size", "wind_explained")

_HALVINGS, _FINE = 20, 60  # of a limit; of one that is no supremum
_FIRST = 4_000  # boxes for each share of a limit


@dataclass(frozen=True)
class Blown:
    """E in the coordinates of a tube, and its parts."""

    wind: Disturbance
    fields: Fields

    @cached_property
    def explained(self) -> Matrix:
        """B^+ E, (m, k), (7.1)."""
        B = self.fields.B
        gram = times(turned(B), B)
        d = determinant(gram)
        inverse = [[e / d for e in row] for row in adjugate(gram)]
        return times(times(inverse, turned(B)), self.fields.vector(self.wind.E))

    @cached_property
    def E(self) -> Matrix:
        """What is not adapted to: E, or (I - B B^+) E where there is a rate."""
        return self.rest if self.wind.rate is not None else self.fields.vector(self.wind.E)

    @cached_property
    def rest(self) -> Matrix:
        """(I - B B^+) E: what no input reaches."""
        return plus(self.fields.vector(self.wind.E), times(self.fields.B, self.explained), -1)


def blown(place: Place) -> Blown:
    """The disturbance at a place; `ValueError` where there is none."""
    if place.system.wind is None:
        raise ValueError("the specification has no disturbance")
    return Blown(place.system.wind, place.fields)


def bounded(place: Place, name: str, limit: Fraction, matched: Fraction | None) -> Outcome:
    """Whether one of `CONSTANTS` is at most `limit`; `matched` is a bound of beta eps_w."""
    if limit < 0:
        return stated(False, "it is negative")
    if name == CONSTANTS[0]:
        return push(place, limit, matched)
    return size(place, limit) if name == CONSTANTS[1] else explained(place, limit)


def push(place: Place, limit: Fraction, matched: Fraction | None) -> Outcome:
    """|g'M E| <= limit for a unit geodesic g: smax(Theta E), or `matched` (beta eps_w) with that of (I - B B^+) E.

    (7.2).
    """
    own = blown(place)
    found = metric_norm(place, own.E, limit)
    if found.holds or matched is None or own.wind.rate is not None:
        return found
    apart = metric_norm(place, own.rest, limit - matched)
    return apart if apart.holds else found


def metric_norm(place: Place, E: Matrix, limit: Fraction) -> Outcome:
    """|Theta E| <= limit: limit^2 W >= E E', (7.2)."""
    if all_zero(E):
        return stated(limit >= 0, "it is negative")
    if limit <= 0:
        return Outcome(verdict="undecided", why="there is no room for it")
    W = place.fields.W
    S = plus(scaled(limit**2, W), times(E, turned(E)), -1)
    return prove(PositiveDefinite(S, W), place.tube(), place.budget)


def size(place: Place, limit: Fraction) -> Outcome:
    """|E| <= limit."""
    return norm(blown(place).E, limit, place.tube(), place.budget)


def explained(place: Place, limit: Fraction) -> Outcome:
    """|B^+ E| <= limit; nothing is left of it where it is adapted to."""
    own = blown(place)
    if own.wind.rate is not None:
        return stated(limit >= 0, "it is negative")
    return norm(own.explained, limit, place.tube(), place.budget)


def norm(a: Matrix, limit: Fraction, domain: Domain, budget: int) -> Outcome:
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
    return scaled(wind.length, blown(place).explained)


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
        found = [scaled(wind.rate, blown(place).explained)]
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

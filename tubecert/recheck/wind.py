"""Claims about a disturbance E(x) w: how it pushes, how fast it moves, what of it the inputs explain.

With a rate, E stands for (I - B B^+) E, and B^+ E w is a part of h. Written from theory 7; everything in the
coordinates of the tube, where E is S E and B^+ is (S B)^+.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Domain, Outcome, prove
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.specified.hardware import Disturbance
from tubecert.recheck.statements import PositiveDefinite
from tubecert.recheck.terms import Matrix, all_zero, plus, scaled, times, turned

_HALVINGS = 12
_FIRST = 4_000  # boxes for each share of a limit


@dataclass(frozen=True)
class Blown:
    """E in the coordinates of a tube, and its parts."""

    wind: Disturbance
    fields: Fields

    @cached_property
    def explained(self) -> Matrix:
        """B^+ E, (m, k)."""
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


def push(place: Place, limit: Fraction, matched: Fraction | None) -> Outcome:
    """|g'M E| <= limit for a unit geodesic g: smax(Theta E), or `matched` (beta eps_w) with that of (I - B B^+) E."""
    own = blown(place)
    found = _metric_norm(place, own.E, limit)
    if found.holds or matched is None or own.wind.rate is not None:
        return found
    apart = _metric_norm(place, own.rest, limit - matched)
    return apart if apart.holds else found


def _metric_norm(place: Place, E: Matrix, limit: Fraction) -> Outcome:
    """limit^2 W >= E E'."""
    if all_zero(E):
        return stated(limit >= 0, "it is negative")
    if limit <= 0:
        return Outcome(verdict="undecided", why="there is no room for it")
    W = place.fields.W
    S = plus(scaled(limit**2, W), times(E, turned(E)), -1)
    return prove(PositiveDefinite(S, W), place.tube(), place.budget)


def size(place: Place, limit: Fraction) -> Outcome:
    """|E| <= limit."""
    return _norm(blown(place).E, limit, place.tube(), place.budget)


def explained(place: Place, limit: Fraction) -> Outcome:
    """|B^+ E| <= limit; nothing is left of it where it is adapted to."""
    own = blown(place)
    if own.wind.rate is not None:
        return stated(limit >= 0, "it is negative")
    return _norm(own.explained, limit, place.tube(), place.budget)


def _norm(a: Matrix, limit: Fraction, domain: Domain, budget: int) -> Outcome:
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
    if wind.bound is None:
        raise ValueError("a disturbance with a rate needs a bound")
    return scaled(wind.bound, blown(place).explained)


def adapted_rate(place: Place) -> Matrix:
    """rate B^+ E: what the rate of w adds to that of h."""
    wind = place.system.wind
    assert wind is not None
    assert wind.rate is not None
    return scaled(wind.rate, blown(place).explained)

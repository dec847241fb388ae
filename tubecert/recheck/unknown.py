"""Claims about parameters of f of which a range is known: what f(x, theta) - f(x) adds to h, and what of it is left.

f is that of the middles. B^+ (f(x, theta) - f(x)) is a part of h, r = (I - B B^+)(f(x, theta) - f(x)) is beside the
inputs. Written from theory 7; everything in the coordinates of the tube; theta is a variable of every test.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Outcome
from tubecert.recheck.identity import vanish
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.terms import NOUGHT, Matrix, plus, times, turned
from tubecert.recheck.wind import metric_norm, norm

CONSTANTS = ("residual_push", "residual_size")


@dataclass(frozen=True)
class Unknown:
    """What the controller does not know of f, (n, 1), and its parts."""

    fields: Fields
    drift: Matrix

    @cached_property
    def whole(self) -> Matrix:
        """f(x, theta) - f(x)."""
        return self.fields.vector(plus(self.drift, self.fields.system.f, -1))

    @cached_property
    def reached(self) -> Matrix:
        """B^+ of it, (m, 1): what an input can make, (7.1)."""
        B = self.fields.B
        gram = times(turned(B), B)
        d = determinant(gram)
        inverse = [[e / d for e in row] for row in adjugate(gram)]
        return times(times(inverse, turned(B)), self.whole)

    @cached_property
    def rest(self) -> Matrix:
        """R, (n, 1); what is proven to vanish is 0."""
        left = plus(self.whole, times(self.fields.B, self.reached), -1)
        return [[NOUGHT if vanish([e]) else e] for (e,) in left]


def unknown(place: Place) -> Unknown | None:
    """What is not known of f at a place; None if all of it is."""
    drift = place.system.unknown
    return None if drift is None else Unknown(place.fields, drift)


def joins(place: Place) -> Matrix | None:
    """What of it is a part of h, (m, 1); None if f is known."""
    found = unknown(place)
    return None if found is None else found.reached


def bounded(place: Place, name: str, limit: Fraction) -> Outcome:
    """Whether one of `CONSTANTS` is at most `limit`."""
    found = unknown(place)
    if found is None:
        raise ValueError("every parameter is known")
    if limit < 0:
        return stated(False, "it is negative")
    if name == CONSTANTS[0]:
        return metric_norm(place, found.rest, limit)
    return norm(found.rest, limit, place.tube(), place.budget)

"""Claims about an input matrix of which parameters are known by ranges, and what it does to h and to theorem H.

B is that of the middles, P(x, theta) the plant's. Written from theory 8.10. What joins h is what an input of the plant
makes up for: P^+ (f(x, theta) - f(x) + (P - B) u*), with P^+ = (P'P)^-1 P'; as P = B (I + Delta), it is what is stated
there. Everything in the coordinates of the tube; theta is a variable of every test.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.recheck.balls import Ball, root
from tubecert.recheck.branches import norms_below
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.curve import CLOCK
from tubecert.recheck.identity import vanish
from tubecert.recheck.metric import adjugate, determinant, stated
from tubecert.recheck.place import Place
from tubecert.recheck.reading import TIME
from tubecert.recheck.terms import Matrix, all_zero, plus, replaced, times, turned, unit_matrix, variable

CONSTANTS = ("gain_error",)


@dataclass(frozen=True)
class Gain:
    """The plant's P and the controller's B, (n, m), in the coordinates of a tube."""

    fields: Fields
    P: Matrix

    @cached_property
    def ratio(self) -> Matrix:
        """B^+ P = I + Delta, (m, m)."""
        return times(_left_inverse(self.fields.B), self.P)

    @cached_property
    def inverse(self) -> Matrix:
        """P^+, (m, n)."""
        return _left_inverse(self.P)

    @cached_property
    def acts_alike(self) -> bool:
        """P = B (I + Delta)."""
        rest = plus(self.P, times(self.fields.B, self.ratio), -1)
        return vanish([e for row in rest for e in row])


def _left_inverse(B: Matrix) -> Matrix:
    gram = times(turned(B), B)
    d = determinant(gram)
    return times([[e / d for e in row] for row in adjugate(gram)], turned(B))


def gain(place: Place) -> Gain | None:
    """What is not known of B at a place; None if all of it is."""
    P = place.system.gained
    return None if P is None else Gain(place.fields, place.fields.vector(P))


def joined(place: Place, own: Gain, drift: Matrix) -> Matrix:
    """P^+ (v + (P - B) u*), (m, 1), of what is not known of the drift, v (n, 1); u* is written in t."""
    u = [[e] for e in replaced(place.curve.u, {CLOCK: variable(TIME)})]
    return times(own.inverse, plus(drift, times(plus(own.P, own.fields.B, -1), u)))


def bounded(place: Place, limit: Fraction) -> Outcome:
    """Whether P = B (I + Delta) with |Delta| <= limit over the tube."""
    own = gain(place)
    if own is None:
        raise ValueError("B is known")
    if not own.acts_alike:
        return Outcome(
            verdict="undecided", why="the inputs could not be shown to act where the controller's do"
        )
    if limit < 0:
        return stated(False, "it is negative")
    off = plus(own.ratio, unit_matrix(len(own.ratio)), -1)
    if all_zero(off):
        return stated(True, "")
    return prove(norms_below([off], limit), place.tube(), place.budget)


@dataclass(frozen=True, slots=True)
class Factors:
    """What |Delta| <= g does to theorem H: an input v acts as at most `most` |v|; kappa is multiplied by `more`."""

    g: Ball
    most: Ball
    more: Ball

    @property
    def sensible(self) -> bool:
        """Whether |Delta| < 1."""
        return bool(self.g < 1)

    def kept(self, kept: Ball) -> Ball:
        """The root of r^2 = kept r + (1 - kept) g: what is left of a wrong estimate after a sample, (H.35)."""
        return (kept + root(kept * kept + 4 * (1 - kept) * self.g)) / 2


def factors(g: Ball | None) -> Factors | None:
    """Of an uncertain gain; None where it is known, (H.30), (H.33)."""
    return None if g is None else Factors(g, 1 + g, 1 / (1 - g))

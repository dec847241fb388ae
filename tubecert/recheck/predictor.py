"""The predictor of the loops of A and B: what its matrix A_m and the gains give."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from flint import arb, ctx

from tubecert.recheck.balls import Ball, exact, sharp_least, sharp_norm
from tubecert.recheck.system import System

_BITS = 160  # of what is kept between conditions


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The gains of A and B: omega, Gamma, the g of A_m = -g I (None: the matrix of the specification), R_H."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction | None
    projection_radius: Fraction

    @property
    def sensible(self) -> bool:
        """Whether all are positive."""
        return min(self.bandwidth, self.adaptation_rate, self.projection_radius, self.predictor_gain or 1) > 0


@dataclass(frozen=True, slots=True)
class Predictor:
    """|A_m|, |A_m + omega I| and lmin(Q), Q = -(A_m + A_m'); whether A_m is known to be -g I."""

    norm: Ball
    shifted: Ball
    q: Ball
    scalar: bool


def predictor(s: System, gains: Gains) -> Predictor:
    """The predictor of the loop; not numbers if the gains name another one than the specification, (2.11)-(2.13)."""
    omega, given, g = exact(gains.bandwidth), s.A_m, gains.predictor_gain
    if g is not None:
        same = given is None or all(
            e == (-g if i == j else 0) for i, row in enumerate(given) for j, e in enumerate(row)
        )
        nothing = arb("nan")
        return (
            Predictor(exact(g), abs(omega - exact(g)), exact(2 * g), scalar=True)
            if same
            else Predictor(nothing, nothing, nothing, scalar=False)
        )
    if given is None:
        raise ValueError("an automatic predictor needs its gain")
    return _matrix_predictor(tuple(map(tuple, given)), gains.bandwidth)


@lru_cache(maxsize=256)
def _matrix_predictor(given: tuple[tuple[Fraction, ...], ...], omega: Fraction) -> Predictor:
    """The predictor of a general A_m, (2.11)-(2.13)."""
    n = len(given)
    with ctx.workprec(_BITS):
        A = [[exact(e) for e in row] for row in given]
        moved = [
            [exact(e + (omega if i == j else 0)) for j, e in enumerate(row)] for i, row in enumerate(given)
        ]
        Q = [[exact(-(given[i][j] + given[j][i])) for j in range(n)] for i in range(n)]
        return Predictor(sharp_norm(A), sharp_norm(moved), sharp_least(Q), scalar=False)

"""The predictor A_m = -g I of the loops of A and B: what the gains give."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.system import System


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The gains of A and B: omega, Gamma, the g of A_m = -g I, R_H."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction

    @property
    def sensible(self) -> bool:
        """Whether all are positive."""
        return min(self.bandwidth, self.adaptation_rate, self.projection_radius, self.predictor_gain) > 0


@dataclass(frozen=True, slots=True)
class Predictor:
    """|A_m|, |A_m + omega I| and lmin(Q), Q = -(A_m + A_m')."""

    norm: Ball
    shifted: Ball
    q: Ball


def predictor(s: System, gains: Gains) -> Predictor:
    """The predictor of the loop; not numbers if the gains name another one than the specification, (2.11)-(2.13)."""
    if s.predictor_gain not in (None, gains.predictor_gain):
        return Predictor(arb("nan"), arb("nan"), arb("nan"))
    g = exact(gains.predictor_gain)
    return Predictor(g, abs(exact(gains.bandwidth) - g), 2 * g)

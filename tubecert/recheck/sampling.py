"""Theorem C at printed numbers: piecewise-constant adaptation, on balls.

Implements: theory (4.6)-(4.9).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, larger, root, smaller
from tubecert.recheck.conditions import Setting, margin, risen, speed_needed
from tubecert.recheck.filtering import Distance


@dataclass(frozen=True, slots=True)
class SampledGains:
    """The gains of C: Ts, omega, g, R_H."""

    sample_time: Fraction
    bandwidth: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction

    @property
    def sensible(self) -> bool:
        """Whether all are positive."""
        return min(self.sample_time, self.bandwidth, self.predictor_gain, self.projection_radius) > 0


@dataclass(frozen=True, slots=True)
class _Sampled:
    H1: Ball
    S_T: Ball
    d1: Ball


def mean_age(gains: SampledGains) -> Ball:
    """m of (4.6)."""
    Ts, g = exact(gains.sample_time), exact(gains.predictor_gain)
    return smaller(1 / g - Ts / (g * Ts).expm1(), Ts / 2)


def _sampled(setting: Setting, gains: SampledGains, Y: Ball) -> _Sampled:
    """H1, S_T, d1 of (4.6)-(4.9) at one Y."""
    n, lam = setting.n, setting.rate
    Ts, omega = exact(gains.sample_time), exact(gains.bandwidth)
    s1 = n.h_t + n.h_x * Y
    b = smaller(n.B_pinv * n.B_x, n.B_pinv_x * n.B) * n.h
    m = mean_age(gains)
    H1 = smaller(n.h, n.h_initial + s1 * Ts)
    S_T = s1 * Ts / (-(-omega * Ts).expm1()) + m * (s1 + b * Y)
    S_T = S_T + setting.taken + n.B_pinv_x * setting.beside * m * Y
    share = -(-lam * Ts).expm1()
    d1 = n.initial_distance * (1 - share) + (n.metric_input_gain * H1 + setting.pushed) * share / lam
    return _Sampled(H1, S_T, d1)


def sampled_margin(setting: Setting, gains: SampledGains, speed: Ball | None) -> tuple[Ball, Ball]:
    """The margin of theorem C at Y = `speed` (None: the least one), and the ultimate radius; not numbers if Y fails."""
    n, nothing = setting.n, (arb("nan"), arb("nan"))
    if not gains.sensible or not setting.radius_serves(gains.projection_radius, clipped=True):
        return nothing

    def needed(Y: Ball) -> Ball:
        state = _sampled(setting, gains, Y)
        return speed_needed(setting, gains.projection_radius, larger(state.H1, state.S_T))

    Y = risen(needed) if speed is None else speed
    if not needed(Y) < Y:
        return nothing
    state = _sampled(setting, gains, Y)
    bound = Distance(
        d0=state.d1,
        beta=n.metric_input_gain,
        H0=state.H1,
        S=state.S_T,
        e=arb(0),
        delta=setting.pushed,
        rate=setting.rate,
        omega=exact(gains.bandwidth),
        horizon=setting.horizon,
    )
    top = larger(larger(n.initial_distance, state.d1), bound.supremum())
    return margin(setting, top), bound.ultimate() / root(n.lower)

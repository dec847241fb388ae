"""Theorems BW and CW at printed numbers, on balls: B and C in windows of the plan, each with a level of its own.

Implements: theory 4f, (4.14)-(4.18). A window is one or two legs. In a leg |xi| is at most S + (mu - S) e^(-omega v) +
e after the time v. The distance and mu go on from leg to leg.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, larger, root, smaller
from tubecert.recheck.conditions import Setting, blown_prediction, prediction_error
from tubecert.recheck.filtering import Distance
from tubecert.recheck.predictor import Gains, predictor
from tubecert.recheck.sampling import SampledGains, mean_age


@dataclass(frozen=True, slots=True, kw_only=True)
class Stay:
    """What a recipe says of one window, with the constants of it; `length` in s."""

    setting: Setting
    level: Fraction
    speed: Fraction
    length: Fraction

    @property
    def rate(self) -> Ball:
        """Dht + Dhx Y: how fast h changes along the loop, (4.15)."""
        return self.setting.n.h_t + self.setting.n.h_x * exact(self.speed)


@dataclass(frozen=True, slots=True)
class Leg:
    """A part of a window: how long it is, where |xi| goes to, what is added to it, and by what mu rises at first."""

    length: Ball
    S: Ball
    e: Ball
    rise: Ball


@dataclass(frozen=True, slots=True)
class Reached:
    """What follows in one window: the largest distance, and of |xi|; S and e as theorem B has them."""

    top: Ball
    left_of_h: Ball
    S: Ball
    e: Ball


class Walk:
    """D and mu from window to window, from `distance` and `memory` on."""

    def __init__(self, distance: Ball, memory: Ball, omega: Ball) -> None:
        self.distance, self.memory, self.omega = distance, memory, omega
        self.top, self.left_of_h = distance, memory

    def enter(self) -> None:
        """A window begins."""
        self.top, self.left_of_h = self.distance, arb(0)

    def go(self, setting: Setting, leg: Leg) -> None:
        """One leg, (4.14)."""
        mu = self.memory + leg.rise
        D = Distance(
            d0=self.distance,
            beta=setting.n.metric_input_gain,
            H0=mu,
            S=leg.S,
            e=leg.e,
            delta=setting.pushed,
            rate=setting.rate,
            omega=self.omega,
            horizon=leg.length,
        )
        self.top = larger(self.top, D.supremum())
        self.left_of_h = larger(self.left_of_h, larger(mu, leg.S) + leg.e)
        self.distance = D.at(leg.length)
        self.memory = leg.S + (mu - leg.S) * (-self.omega * leg.length).exp()


def _stays(stay: Stay, walk: Walk, R_H: Fraction) -> bool:
    """(4.18)."""
    setting, level = stay.setting, exact(stay.level)
    n = setting.n
    most = smaller(n.h + exact(R_H), walk.left_of_h)
    needed = setting.drifting + n.B * (n.feedback_gain * level + most)
    return bool(level <= setting.reach and walk.top < level and needed < exact(stay.speed))


# -- theorem BW


def of_distance(stays: Sequence[Stay], gains: Gains, settling: Fraction) -> tuple[Reached, ...] | None:
    """Theorem BW; None where a condition is not proven."""
    if not stays or not gains.sensible or settling <= 0:
        return None
    if any(stay.length <= settling for stay in stays):
        return None
    n = stays[0].setting.n
    walk, held, found = Walk(n.initial_distance, n.h_initial, exact(gains.bandwidth)), None, []
    for stay in stays:
        setting, R_H = stay.setting, gains.projection_radius
        if not setting.radius_serves(R_H):
            return None
        own = _Estimator(stay, gains)
        walk.enter()
        legs = own.legs(held, settling)
        for leg in legs:
            walk.go(setting, leg)
        if not _stays(stay, walk, R_H):
            return None
        S, e = stay.rate / walk.omega, arb(0)
        for leg in legs:
            e = larger(e, leg.S + leg.e - S)
        found.append(Reached(walk.top, walk.left_of_h, S, e))
        held = own.after(held, exact(stay.length))
    return tuple(found)


class _Estimator:
    """What the estimator of B does in one window, (4.15), (4.16)."""

    def __init__(self, stay: Stay, gains: Gains) -> None:
        """V and k of (4.15)."""
        self.stay, self.gains = stay, gains
        n, setting = stay.setting.n, stay.setting
        p, R = predictor(setting.system, gains), exact(gains.projection_radius)
        if setting.still:
            self.settled = prediction_error(n, R, stay.rate, p.q) ** 2 / exact(gains.adaptation_rate)
            self.forgets = p.q
        else:
            self.settled = blown_prediction(setting, gains, R, stay.rate) ** 2
            self.forgets = p.q / 2
        self.turning = n.B_pinv_x * exact(stay.speed) + n.B_pinv * p.shifted

    def after(self, held: Ball | None, t: Ball) -> Ball:
        """V at a time of the window at most, `held` where it begins; None in the first window, v(s) of (4.15)."""
        if held is None:
            return self.settled
        return self.settled + larger(held - self.settled, arb(0)) * (-self.forgets * t).exp()

    def legs(self, held: Ball | None, settling: Fraction) -> list[Leg]:
        """One in the first window; then one in which what is held is larger, and the rest, (4.16)."""
        length = exact(self.stay.length)
        if held is None:
            return [self._leg(length, self.settled)]
        wait = exact(settling)
        return [
            self._leg(wait, larger(held, self.settled)),
            self._leg(length - wait, self.after(held, wait)),
        ]

    def _leg(self, length: Ball, V: Ball) -> Leg:
        """A stretch of (4.16)."""
        n, omega, X = self.stay.setting.n, exact(self.gains.bandwidth), root(V)
        S = self.stay.rate / omega + self.turning * X + self.stay.setting.taken
        return Leg(length, S, omega * n.B_pinv * X, arb(0))


# -- theorem CW


def of_samples(stays: Sequence[Stay], gains: SampledGains) -> tuple[Reached, ...] | None:
    """Theorem CW; None where a condition is not proven."""
    Ts = exact(gains.sample_time)
    if not stays or not gains.sensible:
        return None
    if any(stay.length <= 2 * gains.sample_time for stay in stays):
        return None
    walk, before, found = _first_sample(stays[0], gains), None, []
    for stay in stays:
        setting, R_H = stay.setting, gains.projection_radius
        if not setting.radius_serves(R_H, clipped=True):
            return None
        own = _sensed(stay)
        if before is None:
            walk.go(setting, _leg(own, exact(stay.length) - Ts, gains, arb(0)))
        else:
            walk.enter()
            both = _Sensed(*map(larger, own.all, before.all))
            walk.go(setting, _leg(both, 2 * Ts, gains, both.rate - before.rate))
            walk.go(setting, _leg(own, exact(stay.length) - 2 * Ts, gains, arb(0)))
        if not _stays(stay, walk, R_H):
            return None
        found.append(Reached(walk.top, walk.left_of_h, arb(0), arb(0)))
        before = own
    return tuple(found)


def _first_sample(stay: Stay, gains: SampledGains) -> Walk:
    """Nothing is known of h, (4.9); then the filter starts at rest."""
    setting, Ts = stay.setting, exact(gains.sample_time)
    n, share = setting.n, -(-setting.rate * Ts).expm1()
    H1 = smaller(n.h, n.h_initial + stay.rate * Ts)
    d1 = n.initial_distance * (1 - share) + (n.metric_input_gain * H1 + setting.pushed) * share / setting.rate
    walk = Walk(d1, H1, exact(gains.bandwidth))
    walk.top = larger(n.initial_distance, d1)
    return walk


@dataclass(frozen=True, slots=True)
class _Sensed:
    """What an estimate depends on where it was made; names are those of the constants."""

    rate: Ball
    speed: Ball
    h: Ball
    B: Ball
    B_x: Ball
    B_pinv: Ball
    B_pinv_x: Ball
    taken: Ball
    beside: Ball

    @property
    def all(self) -> tuple[Ball, ...]:
        """In their order."""
        return tuple(getattr(self, item.name) for item in fields(self))


def _sensed(stay: Stay) -> _Sensed:
    n, setting = stay.setting.n, stay.setting
    size = n.B, n.B_x, n.B_pinv, n.B_pinv_x
    return _Sensed(stay.rate, exact(stay.speed), n.h, *size, setting.taken, setting.beside)


def _leg(at: _Sensed, length: Ball, gains: SampledGains, steeper: Ball) -> Leg:
    """s w + m (s + b Y) and (7.6); mu rises by what a steeper saw-tooth may be ahead, (4.17)."""
    Ts, omega, m = exact(gains.sample_time), exact(gains.bandwidth), mean_age(gains)
    kept = -(-omega * Ts).expm1()
    b = smaller(at.B_pinv * at.B_x, at.B_pinv_x * at.B) * at.h
    S = at.rate * Ts / kept + m * (at.rate + b * at.speed)
    S = S + at.taken + at.B_pinv_x * at.beside * m * at.speed
    return Leg(length, S, arb(0), larger(steeper, arb(0)) * (Ts - kept / omega))

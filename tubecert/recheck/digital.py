"""Theorem H at printed numbers, on balls: control that is sampled, late and noisy, with wind beside the inputs.

Implements: theory 8 (H.6)-(H.12) and (H.17). Written from the theorem, evaluated once at the numbers of a recipe:
nothing is searched for here. What is no number serves nothing, because every comparison with it is false.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from fractions import Fraction

from flint import arb

from tubecert.recheck.arcs import Along, Cost, cost, push
from tubecert.recheck.balls import Ball, exact, larger, root, smaller
from tubecert.recheck.conditions import Setting
from tubecert.recheck.filtering import Distance
from tubecert.recheck.gains import factors
from tubecert.recheck.recipe import Bent, Digital, Losses, MachineNumbers, Promise


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """What follows at a recipe.

    `error`: sup |h - q^| (X); `feedback`: sup |kappa| (kb); `feedforward`: ups; `noise`: n_M, or n_P of a predicted
    state; `top`: max(d0, f0, d1, sup D); `ultimate`: A1. `shares` are those of lambda times the level. `bound` is D,
    `steep` how fast the saw-teeth of the input and of the feedback rise in it.
    """

    error: Ball
    feedback: Ball
    feedforward: Ball
    noise: Ball
    top: Ball
    ultimate: Ball
    shares: dict[str, Ball]
    bound: Distance
    steep: tuple[Ball, Ball]


def loop(setting: Setting, machine: MachineNumbers, promise: Promise, at: Digital) -> Loop | None:
    """What theorem H gives at a recipe; None where one of its conditions beside (H.10), (H.12) is not proven."""
    if not at.sensible or promise.predicts != (at.prediction is not None):
        return None
    own = Evaluation(setting, machine, promise, at)
    return own.course() if own.serves() else None


class Evaluation:
    """(H.6)-(H.12), term by term."""

    def __init__(self, setting: Setting, machine: MachineNumbers, promise: Promise, at: Digital) -> None:
        """The numbers of theory 8.3, from those of a recipe."""
        self.setting, self.n, self.m, self.at, self.promise = setting, setting.n, machine, at, promise
        self.lam = setting.rate
        self.Ts, self.tau, self.Tf = exact(at.sample_time), exact(at.delay), exact(at.feedback_time)
        self.t1 = self.Ts + self.tau
        self.level, self.floor, self.Y = exact(at.level), exact(at.floor), exact(at.speed)
        self.S, self.N, self.R = exact(at.bias), exact(at.ripple), exact(at.clip_radius)
        self.th = arb(1) if at.bandwidth is None else -(-exact(at.bandwidth) * self.Ts).expm1()
        w = setting.wind
        wbar = exact(at.wind)
        nothing = arb(0)
        self.pushed, self.blown, self.matched = (
            (nothing, nothing, nothing) if w is None else (w.push * wbar, w.size * wbar, w.explained * wbar)
        )
        self.nbar, self.explained = (
            machine.noise_size * exact(at.noise),
            machine.noise_explained * exact(at.noise),
        )
        gain = factors(setting.gain)
        # an input v acts as at most `most` |v|, kappa is multiplied by `more`, and its slope is du `most` `more`
        self.g, self.most, self.more = (
            (arb(0), arb(1), arb(1)) if gain is None else (gain.g, gain.most, gain.more)
        )
        self.gain = gain
        none = Losses(feedback=Fraction(0), input=Fraction(0), estimate=Fraction(0), prediction=Fraction(0))
        lost = at.losses or none
        self.lost_feedback, self.lost_input = exact(lost.feedback), exact(lost.input)
        self.lost_estimate, self.lost_prediction = exact(lost.estimate), exact(lost.prediction)
        self.beta = self.most * self.n.metric_input_gain
        self.du = self.most * self.more * self.n.feedback_gain
        self.rate = self.n.h_t + self.n.h_x * self.Y  # s1
        # what a state that the feedback sees is off by: in x, and in the metric
        if at.prediction is None:
            self.seen, self.n_M = self.nbar, machine.noise_metric * exact(at.noise)
        else:
            self.seen = exact(at.prediction)
            self.n_M = root(self.n.upper) * self.seen
        self.bent = self._computed()
        self.ups = self._feedforward()
        self.kb = self.more * self.n.feedback_gain * (self.level + self.n_M)
        self.H1 = smaller(self.n.h, self.n.h_initial + self.rate * self.t1)
        later = self.S + larger(self.n.h_initial - self.S, nothing) + self.N + self.rate * self.t1
        self.X = smaller(self.n.h + self.R, larger(self.H1, later))

    def with_floor(self, floor: Fraction) -> Evaluation:
        """The same at another floor, on which nothing rests that is computed above."""
        other = copy(self)
        other.at, other.floor = replace(self.at, floor=floor), exact(floor)
        return other

    @property
    def push(self) -> Ball:
        """|u + h - u*|, as it acts, by (H.4)."""
        return self.most * (self.kb + self.ups + self.X)

    def _feedforward(self) -> Ball:
        """Ups: |u0 - u*|, where u0 is u* at the sample, which is at most Ts + tau old, and how u is rounded.

        What a computed geodesic makes of |kappa| belongs to it as well.
        (H.6a), (H.36), (H.42).
        """
        if not self.promise.held:
            return self.lost_input + self._beyond
        jump = 2 * self.n.u_star
        oldest = larger(self.Ts, self.Tf) + self.tau
        held = jump if self.m.input_rate is None else smaller(jump, self.m.input_rate * oldest)
        return held + self.lost_input + self._beyond

    def _computed(self) -> Cost | None:
        """What geodesics cost; None where they are exact, or where what they cost has no bound (see `serves`).

        (H.41), (H.42).
        """
        if self.promise.arcs is None:
            return None
        n, m, far = self.n, self.m, self.level + self.n_M
        own = m.bent
        by_metric = None if own is None else (own.drift_metric, m.plan_speed + m.plan_defect, own.drift_slope)
        at = Along(
            far=far,
            symbols=m.symbols,
            slopes=m.symbols_slope,
            least=n.lower,
            most=n.upper,
            push=push(n.drift_on_plan, by_metric, n.upper, far),
            rate=self.lam,
            beta=n.metric_input_gain,
            du=n.feedback_gain,
        )
        return cost(self.promise.arcs, at)

    @property
    def _beyond(self) -> Ball:
        return arb(0) if self.bent is None else self.bent.beyond

    @property
    def covers(self) -> bool:
        """Whether theorems H-R and H-G speak of this loop, if it needs them: they are stated for a known B."""
        plain = self.at.losses is None and self.promise.arcs is None
        computed = self.promise.arcs is None or self.bent is not None
        return computed and (plain or self.gain is None)

    def needed(self) -> tuple[Ball, Ball, Ball, Ball]:
        """What Y has to exceed (H.11), and what S, N and np have to reach."""
        Y = self.n.drift_on_plan + self.n.B * self.push + self.blown
        prediction = arb(0) if self.at.prediction is None else self._prediction()
        return Y, self._bias(), self.ripple(), prediction

    def serves(self) -> bool:
        """Whether the side conditions hold."""
        Y, S, N, seen = self.needed()
        if not self.covers or (self.gain is not None and not self.gain.sensible):
            return False
        enough = Y < self.Y and S <= self.S and N <= self.N and seen <= exact(self.at.prediction or 0)
        return bool(enough and self.bending() > 0)

    # -- the estimate

    def _bias(self) -> Ball:
        """(H.6)."""
        n, m, Ts, Y = self.n, self.m, self.Ts, self.Y
        turning = smaller(n.B_pinv * n.B_x, n.B_pinv_x * n.B)  # b0
        apart = Y * Ts / 2 + self.nbar
        whole = n.u_star + self.most * (self.ups + self.kb + self.R + n.h)  # |u + h|, as it acts
        e = self.rate * Ts / 2 + turning * whole * apart
        e = e + m.drift_explained * (Y * Ts / 4 + self.nbar)
        e = e + self._gust() + n.B_pinv_x * self.setting.rest * apart
        if m.drift_rate is not None:
            e = e + m.drift_rate * Ts / 4
        e = e + self.lost_estimate
        return (1 - self.th) / self.th * self.rate * Ts + e + self._mistaken()

    def _mistaken(self) -> Ball:
        """What Delta makes of kappa, of u0 - u* and of what the last sample's input missed: no part of h, but seen.

        (H.34).
        """
        missed = self.S + self.N + self.rate * (self.Ts / 2 + self.tau)
        return self.g * (self.kb + self.ups + missed)

    def ripple(self) -> Ball:
        """(H.7); where the noise drifts, each of its steps is small instead."""
        turning = self.n.B_pinv_x * (self.Y + 2 * self.nbar / self.Ts) * self.nbar
        found = 2 * self.th / self.Ts * self.explained + turning
        if self.promise.drift is None:
            return found
        return smaller(found, self.m.noise_explained * exact(self.promise.drift))

    def _prediction(self) -> Ball:
        """(H.17)."""
        n = self.n
        slope = n.f_x + n.b_x * (n.u_star + self.ups + self.kb)
        growth = (slope * self.tau).expm1()
        mean = growth / slope if slope > 0 else self.tau * (growth + 1)  # at most tau e^(D_p tau)
        unknown = self.most * self.X + self.g * (self.kb + self.ups) + self.lost_input + self._beyond
        drift = (n.B * unknown + self.blown + self.setting.rest) * mean
        return self.nbar * (growth + 1) + drift + self.lost_prediction

    # -- the feedback

    def bending(self) -> Ball:
        """Chi, (5.1)."""
        rho = exact(self.setting.rho)
        return 1 - self.m.symbols * rho - self.m.symbols_slope * rho * rho / 8

    def course(self) -> Loop:
        """(H.8)-(H.12), whatever the side conditions say."""
        n, m, lam, nothing = self.n, self.m, self.lam, arb(0)
        rho = exact(self.setting.rho)
        chi, top_A = self.bending(), root(n.upper)
        flat = m.drift_difference_metric is not None and m.drift_slope_metric is not None
        curved = m.symbols_slope * rho * rho + 2 * m.symbols * rho
        j1, j0 = 1 + curved / (2 * chi), 1 + curved / (8 * chi)
        # the velocities of the two ends of a geodesic, and how they differ
        fastest = larger(self.Y, m.plan_speed)
        V = m.drift_difference + n.B * self.push + self.blown + self.setting.rest + m.plan_defect
        Q = (m.symbols_slope * rho * rho * fastest + 2 * m.symbols * rho * V) / chi
        V_M, V_J = top_A * (V + Q / 2), fastest + Q / 8
        forced = n.metric_input_gain * self.push + self.pushed + n.plan_defect_metric
        V_d = (m.feedback_slope / 2 + lam) * self.level + forced
        if flat:
            assert m.drift_difference_metric is not None
            assert m.drift_slope_metric is not None
            drift = smaller(m.drift_difference_metric, m.drift_slope_metric * self.level)
            V_M, V_d = smaller(V_M, drift + forced), smaller(V_d, drift + forced)
        slope = m.feedback_slope + n.metric_input_gain * self.du
        bend = m.feedback_curvature * (self.level + self.n_M) / 2
        stretched = self.n_M + (j1 - 1) * top_A * self.seen
        ell0 = slope * stretched + bend * j0 * self.seen  # (H.8)
        tilt = self.du * m.plan_tilt * m.plan_speed * self.level
        ell = slope * V_M + bend * V_J + tilt  # (H.9), per second
        if m.bent is not None:
            other = self._by_metric(m.bent, slope)
            if other is not None:
                ell0, ell = smaller(ell0, other[0]), smaller(ell, other[1])
        if m.feedback_drift is not None:  # F~ changes by itself
            ell = ell + m.feedback_drift * (self.level + self.n_M) / 2
        loss = arb(0) if self.bent is None else self.bent.loss
        ell0 = ell0 + loss
        # from here on by the age of the feedback: it starts at its delay, or at the instant that was predicted
        youngest, oldest = (
            (nothing, self.Tf) if self.at.prediction is not None else (self.tau, self.Tf + self.tau)
        )
        first = larger(oldest, self.tau)
        least = lam * self.floor
        # the sampled feedback may be above (0.5) by what it loses, which counts where d is the floor at least
        base = n.plan_defect_metric + self.beta * self.ups + self.pushed + self.lost_feedback / self.floor
        begun = (V_d * first + self.n_M) / self.floor
        moved = (V_d * oldest + self.n_M) / self.floor
        delta_1 = larger(least, base + (ell0 + ell * first) * (1 + begun))
        delta = larger(least, base + ell0 + ell * youngest + (ell0 + ell * oldest) * moved)
        return self._distance(delta_1, delta, ell, base, (ell0 * (1 + moved), loss * (1 + moved)))

    def _by_metric(self, m: Bent, slope: Ball) -> tuple[Ball, Ball] | None:
        """(H.18), (H.19): lengths are measured by the metric, along geodesics; None where chi' may not be positive."""
        n = self.n
        K = m.curvature * n.lower * exact(self.setting.rho) ** 2
        chi = 1 - K / 8
        if not chi > 0:
            return None
        # |Theta E| at any state: the stated push may rest on beta, which is |Theta B| on the plan
        stretch = larger(arb(1), m.input_gain / n.metric_input_gain)
        gust = smaller(root(n.upper) * self.blown, self.pushed * stretch)
        added = m.input_gain * self.push + gust + n.plan_defect_metric
        fastest = m.drift_metric + added
        Q = K * fastest / chi
        bend = m.form_slope * (self.level + self.n_M) / 2
        ell0 = (slope * (1 + K / (2 * chi)) + bend * (1 + K / (8 * chi))) * self.n_M
        apart = m.drift_slope * self.level + added + Q / 2
        tilt = self.du * m.input_slope * fastest * self.level
        return ell0, slope * apart + bend * (fastest + Q / 8) + tilt

    def _distance(self, delta_1: Ball, delta: Ball, ell: Ball, base: Ball, seen: tuple[Ball, Ball]) -> Loop:
        """(H.12), by the comparison equation with two saw-teeth: of the input, and of the feedback.

        `seen`: what ell0 causes, and the part of it that computed geodesics do.

        The slower clock begins a tooth where the first phase ends. Where the other one does not, what it causes is only
        known to stay below its periodic course: that much is added at once.
        """
        n, lam, beta, at = self.n, self.lam, self.beta, self.at
        late = at.feedback_time > at.sample_time
        early = self.X if late else self.H1  # a feedback that is slower meets the estimate in its first phase
        share = -(-lam * self.first_phase).expm1()
        d0 = larger(n.initial_distance, self.floor)
        d1 = d0 * (1 - share) + (beta * early + delta_1) * share / lam
        steep = beta * self.rate, ell
        lagging, waiting = steep[0] * self.tooth(self.Ts), steep[1] * self.tooth(self.Tf)
        ratio = at.feedback_time / at.sample_time
        if max(ratio, 1 / ratio).denominator != 1:
            d1 = d1 + (lagging if late else waiting) / lam
        d0, d1 = self.begun(d0, d1, steep)
        bound = Distance(
            d0=d1,
            beta=beta,
            H0=larger(n.h_initial, self.S),
            S=self.S,
            e=self.N + self.rate * self.tau,
            delta=delta + waiting + lagging,
            rate=lam,
            omega=exact(at.bandwidth or 1)
            if self.gain is None
            else -self.gain.kept(1 - self.th).log() / self.Ts,
            horizon=self.setting.horizon,
        )
        peak = self.peak(bound)
        gust = self._gust()
        parts = {
            "plan": n.plan_defect_metric,
            "feedforward": beta * (self.ups - self._beyond),
            "wind": self.pushed,
            "wind_estimate": beta * gust,
            "bias": beta * (self.S - gust - self._mistaken()),
            "noise_estimate": beta * self.N,
            "lag": beta * self.rate * self.tau + lagging,
            "noise_feedback": seen[0] - seen[1],
            "sampling": delta + waiting - base - seen[0],
            "geodesic": seen[1] + beta * self._beyond,
            "gain": beta * self._mistaken(),
        }
        return Loop(
            error=self.X,
            feedback=self.kb,
            feedforward=self.ups,
            noise=self.n_M,
            top=larger(larger(d0, d1), peak),
            ultimate=bound.ultimate(),
            shares={name: part / (lam * self.level) for name, part in parts.items()},
            bound=bound,
            steep=steep,
        )

    @property
    def first_phase(self) -> Ball:
        """How long the first samples act: t_a, theory 8.4."""
        return larger(self.Ts, self.Tf) + self.tau

    def begun(self, d0: Ball, d1: Ball, steep: tuple[Ball, Ball]) -> tuple[Ball, Ball]:
        """How far apart x and x* are before the bound begins, and where it begins; `steep` as in `Loop`."""
        del steep
        return d0, d1

    def peak(self, bound: Distance) -> Ball:
        """Sup D."""
        at_once = self.at.bandwidth is None and self.gain is None
        return larger(bound.d0, bound.ultimate()) if at_once else bound.supremum()

    def _gust(self) -> Ball:
        """What wind adds to the bias of the estimate, (H.6)."""
        return self.matched + self.n.B_pinv_x * self.blown * (self.Y * self.Ts / 2 + self.nbar)

    def tooth(self, T: Ball) -> Ball:
        """Mu: the weighted mean of a saw-tooth of period T, T/(1 - e^(-lambda T)) - 1/lambda, theory 8.3."""
        return smaller(larger(T / -(-self.lam * T).expm1() - 1 / self.lam, T / 2), T)

"""Theorems A and B at printed numbers, on balls: every inequality of the theory, evaluated on the safe side.

Implements: theory (3.1)-(3.5), (26a)-(26c), (4.1)-(4.4). Nothing here searches, but for Y: any Y that
passes serves, and one is found by raising it to what it has to exceed.

What filtering does: the kernels and the supremum of the distance bound D(t), on balls.

Implements: theory (2.15)-(2.19). Where a ball cannot decide a case, a bound that holds in every case is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact, root
from tubecert.recheck.document import Node, reads
from tubecert.recheck.system import System


def log_ratio(x: Ball) -> Ball:
    """log(1 + x)/x, 1 at 0; it falls with x, the r of (2.16)."""
    if x.is_zero():
        return arb(1)
    if not x.contains(0):
        return x.log1p() / x
    ends = [y.log1p() / y if y != 0 else arb(1) for y in (x.lower(), x.upper())]
    return ends[0].union(ends[1])


def kappa(c: Ball, w: Ball) -> Ball:
    """sup_t |e^(-wt) - e^(-ct)|/|c - w| (2.17)."""
    return (-(w / c) * log_ratio((w - c) / c)).exp() / c


def tight_kernel(c: Ball, w: Ball, s0: Ball, s1: Ball) -> Ball:
    """J(c, w, s0, s1) (2.19)."""
    slow = s1 / (c * w)
    room = c.min(w) * s0 - s1
    if room <= 0:
        return slow
    # what the initial value adds is 0 if room <= 0, else at most s0 kappa, and at most room/(c w): with p = w s0 - s1
    # it is q (q/p)^(c/(w-c)) <= q = room over c w if c < w, and q (p/q)^(c/(c-w)) <= p = room if c > w
    most = (s0 * kappa(c, w)).min(room.max(arb(0)) / (c * w))
    always = slow.union(slow + most)
    q = c * s0 - s1
    if room > 0:
        exact = (s1 + q * (-(c * s0 / q) * log_ratio((w - c) * s0 / q)).exp()) / (c * w)
        return exact if exact.is_finite() else always
    return always


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """D(t) of (2.15); `horizon` None is for ever."""

    d0: Ball
    beta: Ball
    H0: Ball
    S: Ball
    e: Ball
    delta: Ball
    rate: Ball
    omega: Ball
    horizon: Ball | None

    def ultimate(self) -> Ball:
        """A1, (2.15)."""
        return (self.beta * (self.S + self.e) + self.delta) / self.rate

    def supremum(self) -> Ball:
        """sup D (2.16), an upper bound."""
        A1, C1 = self.ultimate(), self.beta * (self.H0 - self.S)
        start = self.d0 - A1
        D1 = self.omega - self.rate
        last = A1 if self.horizon is None else self.at(self.horizon)
        ends = self.d0.max(last)
        if C1 <= 0 or self.rate * start >= C1:
            return ends
        z = start / C1
        inside = 1 + z * D1
        if inside <= 0:
            return ends
        most = kappa(self.rate, self.omega)
        weak = self.d0.max(A1) + C1.max(arb(0)) * most
        # without its last part D is monotone: at most d0, or what it is in the end without that part
        weak = weak.min(ends + 2 * abs(C1) * most)
        if not (inside > 0 and C1 > 0 and self.rate * start < C1):
            return ends.max(weak)
        t1 = log_ratio(D1 / self.rate) / self.rate - z * log_ratio(z * D1)
        if self.horizon is None:
            peak = A1 + (-self.rate * t1).exp() * (C1 + start * D1) / self.omega
        else:
            peak = self.at(arb(0).max(t1.min(self.horizon)))
        return ends.max(peak) if peak.is_finite() else ends.max(weak)

    def at(self, t: Ball) -> Ball:
        """D(t), (2.15)."""
        A1, C1 = self.ultimate(), self.beta * (self.H0 - self.S)
        slow, fast = (-self.rate * t).exp(), (-self.omega * t).exp()
        D1 = self.omega - self.rate
        # a mean value: t times something between both
        K = t * slow.union(fast) if D1.contains(0) else (slow - fast) / D1
        return A1 + (self.d0 - A1) * slow + C1 * K


_RISES = 100
_INFLATION = 1 + Fraction(1, 10**30)  # far above the rounding of the balls that it is used with
_SETTLED = Fraction(1, 10**29)
_ABOVE = Fraction(1, 10**24)


@dataclass(frozen=True, slots=True, kw_only=True)
class Numbers:
    """The constants that the conditions use, as balls; names are those of the certificate."""

    lower: Ball
    upper: Ball
    f_x: Ball
    B: Ball
    B_x: Ball
    b_x: Ball
    B_pinv: Ball
    B_pinv_x: Ball
    M_x: Ball
    u_star: Ball
    h: Ball
    h_x: Ball
    h_t: Ball
    h_initial: Ball
    feedback_gain: Ball
    metric_input_gain: Ball
    drift_on_plan: Ball
    initial_distance: Ball
    plan_defect_metric: Ball


USED = tuple(item.name for item in fields(Numbers))


@dataclass(frozen=True, slots=True, kw_only=True)
class Gains:
    """The gains of A and B: omega, Gamma, the g of A_m = -g I, R_H."""

    bandwidth: Fraction = reads(Node.decimal)
    adaptation_rate: Fraction = reads(Node.decimal)
    predictor_gain: Fraction = reads(Node.decimal)
    projection_radius: Fraction = reads(Node.decimal)

    def same(self, other: Gains) -> bool:
        """Whether these are the gains of another one, whatever else that says."""
        return all(getattr(self, item.name) == getattr(other, item.name) for item in fields(Gains))

    @property
    def sensible(self) -> bool:
        """Whether all are positive."""
        return min(self.bandwidth, self.adaptation_rate, self.projection_radius, self.predictor_gain) > 0


@dataclass(frozen=True, slots=True)
class WindNumbers:
    """What a disturbance does per |w|, as balls: smax(Theta E), |E|, |B^+ E|; and the bound of |w|."""

    push: Ball
    size: Ball
    explained: Ball
    bound: Ball


@dataclass(frozen=True, slots=True)
class Setting:
    """Constants, radii and options of one certificate; `turns`: whether B depends on the state.

    `rest`: what unknown parameters do beside the inputs, which is a part of the plan's defect and drift in `n`.
    """

    system: System
    n: Numbers
    rho: Fraction
    rho_a: Fraction
    wind: WindNumbers | None = None
    turns: bool = True
    rest: Ball = field(default_factory=lambda: arb(0))

    @property
    def still(self) -> bool:
        """Whether nothing moves the state beside the inputs, zeta = 0 in theory 7.5."""
        return bool(self.rest <= 0) and (self.wind is None or bool(self.wind.size * self.wind.bound <= 0))

    @property
    def pushed(self) -> Ball:
        """delta, and beta_w |w| with it: what lengthens the distance beside h, (7.3)."""
        defect = self.n.plan_defect_metric
        return defect if self.wind is None else defect + self.wind.push * self.wind.bound

    @property
    def drifting(self) -> Ball:
        """phi, and |E| |w| with it, (7.4)."""
        return self.n.drift_on_plan + self.blown

    @property
    def blown(self) -> Ball:
        """|E| |w|, theory 7."""
        return arb(0) if self.wind is None else self.wind.size * self.wind.bound

    @property
    def beside(self) -> Ball:
        """All that moves the state and is no input, zeta of theory 7.5."""
        return self.blown + self.rest

    @property
    def taken(self) -> Ball:
        """|B^+ E| |w|: what an estimate takes for a part of h, (7.9)."""
        return arb(0) if self.wind is None else self.wind.explained * self.wind.bound

    @property
    def rate(self) -> Ball:
        """The rate lambda."""
        return exact(self.system.rate)

    @property
    def reach(self) -> Ball:
        """dbar = sqrt(a) rho, section 0 of the theory."""
        return root(self.n.lower) * exact(self.rho)

    @property
    def horizon(self) -> Ball | None:
        """T, None for ever."""
        return None if self.system.horizon is None else exact(self.system.horizon)

    def predictor(self, gains: Gains) -> Ball:
        """g of A_m = -g I; not a number if the gains name another one than the specification, (2.11)-(2.13)."""
        serves = self.system.predictor_gain in (None, gains.predictor_gain)
        return exact(gains.predictor_gain) if serves else arb("nan")

    def radius_serves(self, R_H: Fraction) -> bool:
        """R_H >= sqrt(1 + nu) Dh, (2.10)."""
        layer = self.system.smooth or Fraction(0)
        return R_H > 0 and bool(exact(R_H * R_H) >= exact(1 + layer) * self.n.h * self.n.h)


def prediction_error(n: Numbers, R: Ball, s1: Ball, g: Ball) -> Ball:
    """Dxt of (2.11), for q = lmin(Q) = 2 g > 0, Q = -(A_m + A_m')."""
    both, q = n.h + R, 2 * g
    return root(2 * both * s1 / q + both * both) if q > 0 else arb("nan")


def derived(setting: Setting, gains: Gains) -> dict[str, Ball]:
    """Everything in (3.1)-(3.5) that the certificate prints, and what (26a)-(26c) need."""
    n = setting.n
    lam, rho, omega, R = (
        setting.rate,
        exact(setting.rho),
        exact(gains.bandwidth),
        exact(gains.projection_radius),
    )
    a, A, DB = n.lower, n.upper, n.B
    g = setting.predictor(gains)
    kmax = setting.reach * n.feedback_gain
    Dxdot = n.drift_on_plan + DB * (n.h + R + kmax)  # (3.1)
    s1 = n.h_t + n.h_x * Dxdot  # (3.1)
    Dxt = prediction_error(n, R, s1, g)  # (2.11)
    Deta = (n.B_pinv_x * Dxdot + n.B_pinv * (2 * omega + g)) * Dxt  # (2.13)
    Dtheta = DB * A * Deta / lam  # (3.2)
    DPsix = 2 * n.B_x + DB * n.M_x / a  # (3.5)
    Dgs = (  # (3.5)
        root(A / a) * (n.f_x + (n.h + R + n.u_star + kmax) * n.b_x + n.h_x * DB)
        + root(A) * n.feedback_gain * DB
    )
    DPsidot = A * (DB * Dgs + DB * n.M_x * Dxdot / root(A * a) + n.B_x * Dxdot)  # (3.5)
    k = tight_kernel(2 * lam, omega, n.h, s1)
    return {
        "speed": Dxdot,
        "uncertainty_rate": s1,
        "prediction_error": Dxt,
        "filter_error": Deta,
        "theta": Dtheta,
        "Psi_x": DPsix,
        "geodesic_rate": Dgs,
        "Psi_rate": DPsidot,
        "zeta_1": 2 * rho * DB * (A / a) * k,  # (3.3)
        "zeta_2": A * DPsix * k,  # (3.3)
        "zeta_3": n.h_x * (4 * lam * A * DB + DPsidot) / (lam * omega),  # (3.4)
    }


def margins_26(setting: Setting, gains: Gains) -> dict[str, Ball]:
    """The margins of (26a), (26b), (26c); not numbers where the projection or the gains do not serve."""
    nothing = dict.fromkeys(("26a", "26b", "26c"), arb("nan"))
    if not setting.still or not gains.sensible or not setting.radius_serves(gains.projection_radius):
        return nothing
    n = setting.n
    d, a = derived(setting, gains), n.lower
    rho_r, rho_a = exact(setting.rho - setting.rho_a), exact(setting.rho_a)
    zeta_p = exact(setting.rho) * n.plan_defect_metric / (setting.rate * root(a))  # (3.4)
    first = 1 - (n.initial_distance * n.initial_distance / a + d["zeta_1"] + zeta_p) / (rho_r * rho_r)
    rest = a - d["zeta_2"] - d["zeta_3"]
    third = 1 - d["theta"] / (rho_a * rest) / root(exact(gains.adaptation_rate)) if rest > 0 else arb("nan")
    return {"26a": first, "26b": rest / a, "26c": third}


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceProof:
    """Y, e and S of theorem B."""

    speed: Ball
    prediction_error: Ball
    uncertainty: Ball


def _error(setting: Setting, gains: Gains, Y: Ball) -> Ball:
    """Deta(Y)/sqrt(Gamma) of (2.12)."""
    n, g, omega = setting.n, setting.predictor(gains), exact(gains.bandwidth)
    R, s1, rate = exact(gains.projection_radius), n.h_t + n.h_x * Y, exact(gains.adaptation_rate)
    gain = n.B_pinv_x * Y + n.B_pinv * (omega + abs(omega - g))
    if setting.still:
        return gain * prediction_error(n, R, s1, g) / root(rate)
    return gain * blown_prediction(setting, gains, R, s1) + setting.taken


def blown_prediction(setting: Setting, gains: Gains, R: Ball, s1: Ball) -> Ball:
    """The bound of |xt| with a disturbance that enters it as zb (7.8).

    V = |xt|^2 + |s~|^2/Gamma has V' <= -q |xt|^2 + 2 zb |xt| + 2 (Dh + R) s1/Gamma, negative beyond the root r of
    q r^2 - 2 zb r = 2 (Dh + R) s1/Gamma; so V <= r^2 + (Dh + R)^2/Gamma. If B is constant, the part of xt in
    the range of B has an equation of its own, with B B^+ E w only.
    """
    n, q, Gamma = setting.n, 2 * setting.predictor(gains), exact(gains.adaptation_rate)
    zb = setting.beside
    if not setting.turns:
        zb = setting.blown.min(n.B * setting.taken)
    both = n.h + R
    drag = zb / q
    radius = drag + root(drag * drag + 2 * both * s1 / (q * Gamma))
    return root(both * both / Gamma + radius * radius) if q > 0 else arb("nan")


def speed_needed(setting: Setting, R_H: Fraction, error: Ball) -> Ball:
    """phi + D_E |w| + DB [du dbar + min(Dh + R_H, error)], (4.3), (7.4)."""
    n = setting.n
    return setting.drifting + n.B * (n.feedback_gain * setting.reach + (n.h + exact(R_H)).min(error))


def distance_bound(setting: Setting, gains: Gains, proof: DistanceProof) -> Distance | None:
    """D(t) of theorem B if (4.1)-(4.3) hold for the proof, else None."""
    n, omega = setting.n, exact(gains.bandwidth)
    if not gains.sensible or not setting.radius_serves(gains.projection_radius):
        return None
    Y, e, S = proof.speed, proof.prediction_error, proof.uncertainty
    if not (
        e >= 0 < Y  # then S >= 0, too: with a negative Y or e less would be asked for than is needed
        and (n.h_t + n.h_x * Y) / omega <= S  # (4.1)
        and _error(setting, gains, Y) <= e  # (4.2), (7.9)
        and speed_needed(setting, gains.projection_radius, n.h_initial.max(S) + e) < Y  # (4.3)
    ):
        return None
    return Distance(
        d0=n.initial_distance,
        beta=n.metric_input_gain,
        H0=n.h_initial,
        S=S,
        e=e,
        delta=setting.pushed,
        rate=setting.rate,
        omega=omega,
        horizon=setting.horizon,
    )


def own_distance_proof(setting: Setting, gains: Gains) -> DistanceProof:
    """The least Y that serves, with its S and e, a little larger: a proposal, theory 4.6."""
    n, omega = setting.n, exact(gains.bandwidth)

    def needed(Y: Ball) -> Ball:
        S, e = (n.h_t + n.h_x * Y) / omega, _error(setting, gains, Y)
        return speed_needed(setting, gains.projection_radius, n.h_initial.max(S) + e)

    Y = risen(needed)
    more = exact(_INFLATION)
    return DistanceProof(
        speed=Y,
        prediction_error=(_error(setting, gains, Y) * more).upper(),
        uncertainty=((n.h_t + n.h_x * Y) / omega * more).upper(),
    )


def risen(needed: Callable[[Ball], Ball]) -> Ball:
    """A number just above the least fixed point of a rising function: iterated, extrapolated, inflated; a proposal.

    Theory 4.6.
    """
    Y = arb(0)
    for _ in range(_RISES):
        first = needed(Y).mid()
        second = needed(first).mid()
        if not second.is_finite() or second - Y <= second * exact(_SETTLED):
            break
        steps = first - Y, second - first
        ahead = second + steps[1] * steps[1] / (steps[0] - steps[1]) if steps[0] > steps[1] > 0 else second
        Y = (
            ahead.mid()
            if ahead.is_finite() and needed(ahead.mid()) >= ahead.mid() * exact(1 - _SETTLED)
            else second
        )
    return (Y * exact(1 + _ABOVE)).upper()


def margin(setting: Setting, supremum: Ball) -> Ball:
    """(dbar - sup)/dbar, of (4.4) and its like."""
    return 1 - supremum / setting.reach

"""Certificate H: noise, wind, sampled and delayed control, a bound of every input. Trusted.

THEOREM H. If dhat + n_M <= dbar, Y > phi + DB (kb + ups + X) + D_E wbar and dhat > max(d0, f0, d1, sup D), then
d(x*, x) < dhat and |x - x*| < dhat/sqrt(a) over the horizon, for every h, every wind and every noise of the class, with
a loop that is sampled, delayed and held. THEOREM H-P is the same for a feedback that acts on the predicted state. A
proof is a recipe, decimals for which (H.6)-(H.12), (H.17) are verified; larger Y, S, N, np prove the same. A recipe
that fails refutes nothing. Implements: theory section 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

import numpy as np

from tubecert.conditions import machine as machines
from tubecert.conditions.arithmetic import (
    Array,
    T,
    choose,
    decay_mean,
    exp,
    expm1,
    maximum,
    minimum,
    nothing,
    number,
    quiet,
    sqrt,
)
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.machine import Bent, Machine, MachineNumbers
from tubecert.conditions.obstacles import obstacles, reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.sampled import ages
from tubecert.conditions.theorem import Margins, Theorem
from tubecert.conditions.verdict import Shortfall, unbounded
from tubecert.enclosure.interval import Interval

_DUST = 1e-9  # a share that is as good as none
LEVEL, STAYS = "hardware_level", "hardware"  # the conditions (H.10) and (H.12)


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareRecipe:
    """The proof of theorem H: the loop, and the numbers that the theorem asks for.

    The loop: `sample_time` Ts, `delay` tau, `feedback_time` Tf (Ts where the feedback has no rate of its own),
    `bandwidth` omega (None: no filter), `noise` nu in units of noise, `wind` |w|, `clip_radius` R. The proof: `level`
    dhat, `floor` f0, `speed` Y, `bias` S, `ripple` N, and `prediction` np of theorem H-P (None without prediction).
    """

    sample_time: Fraction
    delay: Fraction
    feedback_time: Fraction
    bandwidth: Fraction | None
    noise: Fraction
    wind: Fraction
    clip_radius: Fraction
    level: Fraction
    floor: Fraction
    speed: Fraction
    bias: Fraction
    ripple: Fraction
    prediction: Fraction | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Generic[T]):
    """A recipe in one arithmetic; `omega` None: th = 1; `np` None: no prediction.

    Two clocks: `late` is 1 where the feedback's is the slower one, else 0; `off` is 1 where the slower one is no
    multiple of the faster one, else 0.
    """

    Ts: T
    tau: T
    Tf: T
    omega: T | None
    nu: T
    wbar: T
    dhat: T
    f0: T
    Y: T
    S: T
    N: T
    np: T | None
    late: T
    off: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant(Generic[T]):
    """All that is known of the system over the tube, in one arithmetic.

    `beta_w`, `D_E`, `eps_w`: what a wind does per |w|; `rest`: |r| of unknown parameters; `held`: whether u* is played
    from sample to sample; `drift`: the bound of |n_k - n_(k-1)|/Ts in units of noise.
    """

    n: Numbers[T]
    m: MachineNumbers[T]
    beta_w: T
    D_E: T
    eps_w: T
    rest: T
    held: bool = False
    drift: T | None = None


# -- the estimate: (H.6), (H.7), (H.11), (H.17)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(Generic[T]):
    """What the estimate, the filter and the clip leave of h, and what Y, S, N, np have to reach for that.

    `n_fb`: what noise is to the feedback, |Theta n| at most; `e_fb` the same in |.|; kb bounds |kappa|, ups |u0 - u*|,
    s1 the rate of h along the loop, H1 and X |h - q^| at first and always. `gust` is the part of S that wind causes.
    """

    n_fb: T
    e_fb: T
    kb: T
    ups: T
    s1: T
    H1: T
    X: T
    gust: T
    bias: T
    ripple: T
    speed: T
    prediction: T | None


@quiet
def estimate(p: Plant[T], loop: Loop[T]) -> Estimate[T]:
    """The estimate at Y, S, N (and np) of a recipe."""
    n = p.n
    n_fb, e_fb = noise_in_feedback(p, loop)
    kb = n.du * (loop.dhat + n_fb)
    ups = feedforward_error(p, loop)
    s1 = n.Dht + n.Dhx * loop.Y
    t1 = loop.Ts + loop.tau
    H1 = minimum(n.Dh, n.H0 + s1 * t1)
    # S + (H0 - S)_+ = max(S, H0)
    X = minimum(n.Dh + n.R, maximum(H1, maximum(loop.S, n.H0) + loop.N + s1 * t1))
    gust = wind_in_estimate(p, loop)
    return Estimate(
        n_fb=n_fb,
        e_fb=e_fb,
        kb=kb,
        ups=ups,
        s1=s1,
        H1=H1,
        X=X,
        gust=gust,
        bias=lag_of_filter(loop) * s1 + error_of_estimate(p, loop, s1, n.Dus + ups + kb) + gust,
        ripple=noise_in_estimate(p, loop),
        speed=n.phi + n.DB * (kb + ups + X) + p.D_E * loop.wbar,
        prediction=prediction_error(p, loop, n.Dus + ups + kb, X),
    )


def noise_in_feedback(p: Plant[T], loop: Loop[T]) -> tuple[T, T]:
    """n_M and nbar; with prediction n_P = sqrt(A) np and np."""
    n_M = loop.nu * p.m.n_M
    if loop.np is None:
        return n_M, loop.nu * p.m.n_E
    # n_P >= n_M by (H.17); both are bounds, each rounded for itself
    return maximum(n_M, sqrt(p.n.A) * loop.np), loop.np


def feedforward_error(p: Plant[T], loop: Loop[T]) -> T:
    """ups >= |u0 - u*|: 0, or what u* does while it is held, (H.6a)."""
    if not p.held:
        return number(0, loop.Ts)
    most = 2 * p.n.Dus
    return most if p.m.Lus is None else minimum(most, p.m.Lus * (maximum(loop.Ts, loop.Tf) + loop.tau))


def lag_of_filter(loop: Loop[T]) -> T:
    """((1 - th)/th) Ts = Ts/(e^(omega Ts) - 1)."""
    return number(0, loop.Ts) if loop.omega is None else loop.Ts / expm1(loop.omega * loop.Ts)


def gain_of_filter(loop: Loop[T]) -> T:
    """th/Ts = (1 - e^(-omega Ts))/Ts, at most omega."""
    return 1 / loop.Ts if loop.omega is None else loop.omega * decay_mean(loop.omega * loop.Ts)


def error_of_estimate(p: Plant[T], loop: Loop[T], s1: T, known: T) -> T:
    """e_s of (H.6) without wind; `known` bounds |u0 + kappa|."""
    n = p.n
    b0 = minimum(n.DBp * n.DBx, n.DBpx * n.DB)
    nbar = loop.nu * p.m.n_E
    moved = loop.Y * loop.Ts / 2 + nbar
    return (
        s1 * loop.Ts / 2
        + b0 * (known + n.R + n.Dh) * moved
        + p.m.D_pf * (loop.Y * loop.Ts / 4 + nbar)
        + n.DBpx * p.rest * moved
    )


def wind_in_estimate(p: Plant[T], loop: Loop[T]) -> T:
    """The part of e_s in (H.6) that wind causes."""
    moved = loop.Y * loop.Ts / 2 + loop.nu * p.m.n_E
    return (p.eps_w + p.n.DBpx * p.D_E * moved) * loop.wbar


def noise_in_estimate(p: Plant[T], loop: Loop[T]) -> T:
    """N of (H.7), or what noise of a bounded rate does if that is less."""
    nbar = loop.nu * p.m.n_E
    summed = 2 * gain_of_filter(loop) * (loop.nu * p.m.n_B) + p.n.DBpx * (loop.Y + 2 * nbar / loop.Ts) * nbar
    return summed if p.drift is None else minimum(summed, p.m.n_B * p.drift)


def prediction_error(p: Plant[T], loop: Loop[T], known: T, X: T) -> T | None:
    """What np has to reach, (H.17); `known` bounds |u0 + kappa|."""
    if loop.np is None:
        return None
    n = p.n
    y = (n.Dfx + n.Dbx * known) * loop.tau
    # (e^y - 1)/D_p = tau e^y (1 - e^(-y))/y
    grown = exp(y)
    return loop.nu * p.m.n_E * grown + (n.DB * X + p.D_E * loop.wbar + p.rest) * (
        loop.tau * grown * decay_mean(y)
    )


# -- what time and noise cost the feedback: (H.8), (H.9), (H.18), (H.19)


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Generic[T]):
    """Lam <= (ell0 + ell1 age) (d + move), (H.15); `V_d` is how fast d changes; `chi` > 0 is test (5.1)."""

    ell0: T
    ell1: T
    V_d: T
    chi: T

    def at(self, age: T) -> T:
        """ell(age)."""
        return self.ell0 + self.ell1 * age


@quiet
def loss(p: Plant[T], loop: Loop[T], e: Estimate[T]) -> Loss[T]:
    """(H.8), (H.9)."""
    n, m = p.n, p.m
    G, L = 2 * m.G * n.rho, m.L_G * n.rho**2
    chi = 1 - G / 2 - L / 8
    bent = L + G
    added, blown = e.kb + e.ups + e.X, loop.wbar
    V = m.phi_rel + n.DB * added + p.D_E * blown + n.delta_p + p.rest
    fastest = maximum(loop.Y, m.Ystar)
    Q = (L * fastest + G * V) / chi
    pushed = n.beta * added + p.beta_w * blown + n.delta
    V_M, V_J = sqrt(n.A) * (V + Q / 2), fastest + Q / 8
    V_d = (m.D_F / 2 + n.lam) * loop.dhat + pushed
    if m.phi_relM is not None and m.D_A is not None:
        # M and B are constant: Theta (x' - x*') is bounded in the metric, without curvature
        straight = minimum(m.phi_relM, m.D_A * loop.dhat) + pushed
        V_M, V_d = minimum(V_M, straight), minimum(V_d, straight)
    slope, turn = m.D_F + n.beta * n.du, m.D_Fx * (loop.dhat + e.n_fb) / 2
    # j1 n_M: a box of noise is measured by n_M as it is, and by sqrt(A) nbar where geodesics bend
    first = e.n_fb + bent / (2 * chi) * (sqrt(n.A) * e.e_fb)
    j0 = 1 + bent / (8 * chi)
    ell0 = slope * first + turn * j0 * e.e_fb
    ell1 = slope * V_M + turn * V_J + n.du * m.D_cx * m.Ystar * loop.dhat
    if m.bent is not None:
        other = covariant_loss(p, m.bent, loop, e)
        ell0, ell1 = minimum(ell0, other[0]), minimum(ell1, other[1])
    return Loss(ell0=ell0, ell1=ell1, V_d=V_d, chi=chi)


@quiet
def covariant_loss(p: Plant[T], m: Bent[T], loop: Loop[T], e: Estimate[T]) -> tuple[T, T]:
    """ell0 and ell' of (H.18), (H.19): every length is measured by the metric; infinite where chi' <= 0."""
    n = p.n
    K = m.K_R * reach(n) ** 2
    chi = 1 - K / 8
    added = m.beta_O * (e.kb + e.ups + e.X) + metric_gust(p, m) * loop.wbar + n.delta
    fastest = m.phi_M + added
    Q = K * fastest / chi
    slope, turn = p.m.D_F + n.beta * n.du, m.D_nF * (loop.dhat + e.n_fb) / 2
    ell0 = (slope * (1 + K / (2 * chi)) + turn * (1 + K / (8 * chi))) * e.n_fb
    ell1 = (
        slope * (m.D_nX * loop.dhat + added + Q / 2)
        + turn * (fastest + Q / 8)
        + n.du * m.D_nb * fastest * loop.dhat
    )
    endless = -nothing(chi)
    return choose(chi, ell0, endless), choose(chi, ell1, endless)


def metric_gust(p: Plant[T], m: Bent[T]) -> T:
    """A bound of |Theta E| at any state: beta_w may rest on beta, which is |Theta B| on the plan alone, (7.2)."""
    n = p.n
    return minimum(sqrt(n.A) * p.D_E, p.beta_w * maximum(number(1, n.beta), m.beta_O / n.beta))


# -- the distance: (H.12)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ages(Generic[T]):
    """How old what the feedback acts on is: at least `youngest`, at most `oldest`, and at most `first` before t_a."""

    youngest: T
    oldest: T
    first: T


def ages_of_feedback(loop: Loop[T]) -> Ages[T]:
    """[tau, tau + Tf]; [0, Tf] with prediction."""
    if loop.np is None:
        oldest = loop.Tf + loop.tau
        return Ages(youngest=loop.tau, oldest=oldest, first=oldest)
    return Ages(youngest=number(0, loop.tau), oldest=loop.Tf, first=maximum(loop.Tf, loop.tau))


@dataclass(frozen=True, slots=True, kw_only=True)
class Course(Generic[T]):
    """D(t) of theorem H: at most `start` before t_a, then `bound`; `base` and what time and noise add to it.

    `lag` is s1 (tau + mu), `noisy` the part of delta_H that noise in the feedback causes.
    """

    start: T
    d1: T
    bound: DistanceBound[T]
    omega: T | None
    base: T
    lag: T
    noisy: T

    def supremum(self) -> T:
        """max(d0, f0, d1, sup D)."""
        return maximum(maximum(self.start, self.d1), _supremum(self.bound, self.omega))


def _supremum(D: DistanceBound[T], omega: T | None) -> T:
    """sup D; without a filter D is monotone, from d0 to A1."""
    return maximum(D.d0, D.ultimate()) if omega is None else D.supremum()


@quiet
def course(p: Plant[T], loop: Loop[T], e: Estimate[T], cost: Loss[T]) -> Course[T]:
    """delta_1, delta_H, d1 and the bound of (H.12)."""
    n, age = p.n, ages_of_feedback(loop)
    mu, mu_fb = mean_wait(n.lam, loop.Ts), mean_wait(n.lam, loop.Tf)
    t_a = maximum(loop.Ts, loop.Tf) + loop.tau
    base = n.delta + n.beta * e.ups + p.beta_w * loop.wbar
    resting = n.lam * loop.f0
    early = (cost.V_d * age.first + e.n_fb) / loop.f0
    later = (cost.V_d * age.oldest + e.n_fb) / loop.f0
    delta_1 = maximum(resting, base + cost.at(age.first) * (1 + early))
    waiting = cost.ell1 * mu_fb
    delta_H = maximum(resting, base + cost.at(age.youngest) + cost.at(age.oldest) * later) + waiting
    start = maximum(n.d0, loop.f0)
    # before t_a nothing is compensated; where the feedback is the slower one, the estimate acts already
    xi = e.H1 + loop.late * (e.X - e.H1)
    d1 = start * exp(-n.lam * t_a) + (n.beta * xi + delta_1) * t_a * decay_mean(n.lam * t_a)
    # where the saw-tooth of the faster clock does not begin at t_a, it adds its periodic solution at most: theory 8.4
    faster = loop.late * (n.beta * e.s1 * mu) + (1 - loop.late) * waiting
    d1 = d1 + loop.off * faster / n.lam
    lag = e.s1 * (loop.tau + mu)
    return Course(
        start=start,
        d1=d1,
        bound=DistanceBound(
            d0=d1,
            beta=n.beta,
            H0=maximum(n.H0, loop.S),
            S=loop.S,
            e=loop.N + lag,
            delta=delta_H,
            lam=n.lam,
            omega=n.lam if loop.omega is None else loop.omega,
            horizon=n.horizon,
        ),
        omega=loop.omega,
        base=base,
        lag=lag,
        noisy=cost.ell0 * (1 + later),
    )


def mean_wait(rate: T, period: T) -> T:
    """mu = Ts/(1 - e^(-lambda Ts)) - 1/lambda, in [Ts/2, Ts]: Ts less the mean age of (4.6)."""
    return period - ages(period, rate, rate).m


# -- the theorem


def in_step(first: Fraction, second: Fraction) -> bool:
    """Whether the longer of two sample times is a multiple of the shorter one."""
    return (max(first, second) / min(first, second)).denominator == 1


def plant(problem: TubeProblem, R: Fraction) -> Plant[Interval]:
    """The safe side of everything that is known; `ValueError` without a machine."""
    machine, wind = _machine(problem), problem.wind
    zero = Interval.of(0)
    n = problem.proven(R)
    return Plant(
        n=n,
        m=machines.proven(machine),
        beta_w=zero if wind is None else Interval.exact(wind.constants.push.above),
        D_E=zero if wind is None else Interval.exact(wind.constants.size.above),
        eps_w=zero if wind is None else Interval.exact(wind.constants.explained.above),
        rest=zero if problem.residual is None else Interval.exact(problem.residual.size.above),
        held=machine.asked.held,
        drift=None if machine.drift is None else Interval.of(machine.drift),
    )


def _machine(problem: TubeProblem) -> Machine:
    if problem.machine is None:
        raise ValueError("the specification says nothing of the hardware")
    return problem.machine


def loop_of(recipe: HardwareRecipe) -> Loop[Interval]:
    """A recipe in outward-rounded arithmetic."""
    Ts, Tf = recipe.sample_time, recipe.feedback_time
    return Loop(
        Ts=Interval.of(Ts),
        tau=Interval.of(recipe.delay),
        Tf=Interval.of(Tf),
        omega=None if recipe.bandwidth is None else Interval.of(recipe.bandwidth),
        nu=Interval.of(recipe.noise),
        wbar=Interval.of(recipe.wind),
        dhat=Interval.of(recipe.level),
        f0=Interval.of(recipe.floor),
        Y=Interval.of(recipe.speed),
        S=Interval.of(recipe.bias),
        N=Interval.of(recipe.ripple),
        np=None if recipe.prediction is None else Interval.of(recipe.prediction),
        late=Interval.of(int(Tf > Ts)),
        off=Interval.of(int(not in_step(Ts, Tf))),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated(Generic[T]):
    """A recipe put into every formula."""

    plant: Plant[T]
    loop: Loop[T]
    estimate: Estimate[T]
    loss: Loss[T]
    course: Course[T]


def evaluated(p: Plant[T], loop: Loop[T]) -> Evaluated[T]:
    """Every formula of theorem H at a recipe."""
    e = estimate(p, loop)
    cost = loss(p, loop, e)
    return Evaluated(plant=p, loop=loop, estimate=e, loss=cost, course=course(p, loop, e, cost))


@quiet
def margins_hardware(problem: TubeProblem, recipe: HardwareRecipe) -> tuple[Interval, Interval]:
    """The margins of (H.10) and (H.12), scalars; -inf below where a side condition is not proven."""
    nothing = Interval(-np.inf, np.inf)
    if problem.machine is None or not _describes_a_loop(recipe):
        return nothing, nothing
    x = evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))
    if not (problem.machine.clips_within(problem.constants.h, recipe.clip_radius) and _side_conditions(x)):
        return nothing, nothing
    level = (1 - (x.loop.dhat + x.estimate.n_fb) / reach(x.plant.n)).sanitised()
    stays = (1 - x.course.supremum() / x.loop.dhat).sanitised()
    return tuple(Interval(m.lo, np.asarray(np.inf)) for m in (level, stays))  # type: ignore[return-value]


def _describes_a_loop(r: HardwareRecipe) -> bool:
    """What section 1 asks of the numbers: 0 <= delay <= Ts, and with prediction delay <= Tf."""
    positive = (r.sample_time, r.feedback_time, r.clip_radius, r.level, r.floor, r.speed)
    sizes = (r.delay, r.noise, r.wind, r.bias, r.ripple)
    return (
        all(x > 0 for x in positive)
        and all(x >= 0 for x in sizes)
        and (r.bandwidth is None or r.bandwidth > 0)
        and r.delay <= r.sample_time
        and (r.prediction is None or (r.prediction >= 0 and r.delay <= r.feedback_time))
    )


def _side_conditions(x: Evaluated[Interval]) -> bool:
    """(5.1), (H.6), (H.7), (H.11) and (H.17)."""
    e, loop = x.estimate, x.loop
    predicted = e.prediction is None or loop.np is None or bool(e.prediction.sanitised().hi <= loop.np.lo)
    return (
        bool(x.loss.chi.sanitised().lo > 0)
        and bool(e.bias.sanitised().hi <= loop.S.lo)
        and bool(e.ripple.sanitised().hi <= loop.N.lo)
        and bool(e.speed.sanitised().hi < loop.Y.lo)
        and predicted
    )


def _margins(problem: TubeProblem, recipes: Sequence[HardwareRecipe]) -> Margins:
    found = [margins_hardware(problem, recipe) for recipe in recipes]
    return {
        name: Interval(
            np.array([float(pair[i].lo) for pair in found]), np.array([float(pair[i].hi) for pair in found])
        )
        for i, name in enumerate((LEVEL, STAYS))
    }


def is_the_machine(problem: TubeProblem, recipe: HardwareRecipe) -> bool:
    """Whether a recipe is about the machine, the noise and the wind of the problem, where they are given."""
    if problem.machine is None:
        return False
    asked, wind = problem.machine.asked, problem.wind
    feedback_time = recipe.sample_time if asked.feedback_time is None else asked.feedback_time
    delay = recipe.sample_time if asked.one_sample else asked.delay
    noise = Fraction(1) if isinstance(asked.noise, tuple) else asked.noise
    given = (
        (asked.sample_time, recipe.sample_time),
        (delay, recipe.delay),
        (feedback_time, recipe.feedback_time),
        (noise, recipe.noise),
        (Fraction(0) if wind is None else wind.bound, recipe.wind),
        (asked.bandwidth, recipe.bandwidth),
    )
    return asked.predict == (recipe.prediction is not None) and all(
        wanted is None or wanted == own for wanted, own in given
    )


def is_a_machine_like(problem: TubeProblem, own: HardwareRecipe | None, other: HardwareRecipe) -> bool:
    """Whether another recipe is about the same machine but for its sample time, and what follows from that."""
    if problem.machine is None or own is None:
        return False
    asked, Ts = problem.machine.asked, other.sample_time
    same = (
        (other.noise, own.noise),
        (other.wind, own.wind),
        (other.clip_radius, own.clip_radius),
        (other.delay, Ts if asked.one_sample else own.delay),
        (other.feedback_time, Ts if asked.feedback_time is None else asked.feedback_time),
        (other.prediction is None, own.prediction is None),
    )
    return asked.bandwidth in (None, other.bandwidth) and all(a == b for a, b in same)


def stands_in_the_way(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """What no machine can overcome, and constants of the machine without a bound."""
    if problem.machine is None:
        return ()
    return unbounded(problem.machine.unbounded()) or obstacles(problem)


def ultimate_radius(problem: TubeProblem, recipe: HardwareRecipe) -> float:
    """A1/sqrt(a): |x - x*| is at most this in the long run, proven."""
    x = evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))
    return float((x.course.bound.ultimate() / sqrt(x.plant.n.a)).hi)


def _at_once(problem: TubeProblem, n: Numbers[Array]) -> object:
    """Everything that theorem H compares, at some machine."""
    del problem
    one = np.asarray(1.0)
    p = Plant(n=n, m=machines.ones(), beta_w=one, D_E=one, eps_w=one, rest=one, held=True)
    loop = Loop(
        Ts=one,
        tau=one,
        Tf=one,
        omega=one,
        nu=one,
        wbar=one,
        dhat=one,
        f0=one,
        Y=one,
        S=one,
        N=one,
        np=one,
        late=one,
        off=one,
    )
    x = evaluated(p, loop)
    return x.course.supremum() < reach(n), x.estimate.speed


THEOREM = Theorem(
    recipe=HardwareRecipe,
    margins=_margins,
    # a recipe that fails refutes nothing, nor do all of them
    ceilings=lambda problem, recipe: {LEVEL: np.inf, STAYS: np.inf},
    formula=_at_once,
    obstacles=stands_in_the_way,
    ultimate=ultimate_radius,
    about=is_the_machine,
    alike=is_a_machine_like,
    sizes=("delay", "noise", "wind", "speed", "bias", "ripple", "prediction"),
    optional=("bandwidth", "prediction"),
)


# -- what is told of a machine that serves


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What fills the level: shares of lambda dhat, each rounded up; 0 for less than 1e-9.

    `plan` delta, `feedforward` beta ups, `wind` beta_w |w|, `wind_estimate` what it does to the estimate, `bias` the
    rest of beta S, `noise_estimate` beta N, `lag` beta s1 (tau + mu), `noise_feedback` ell0, `sampling` ell1 and the
    floor.
    """

    plan: float
    feedforward: float
    wind: float
    wind_estimate: float
    bias: float
    noise_estimate: float
    lag: float
    noise_feedback: float
    sampling: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """Bounds that follow from a recipe: `supremum` of d, `radius` of |x - x*|, `feedback` |u0 - u* + kappa|, |x'|."""

    supremum: float
    radius: float
    feedback: float
    budget: Budget


@quiet
def told(problem: TubeProblem, recipe: HardwareRecipe) -> Told:
    """What a recipe that is proven says."""
    x = evaluated(plant(problem, recipe.clip_radius), loop_of(recipe))
    return Told(
        supremum=float(x.course.supremum().hi),
        radius=float((x.loop.dhat / sqrt(x.plant.n.a)).hi),
        feedback=float((x.estimate.ups + x.estimate.kb).hi),
        budget=_budget(x),
    )


def _budget(x: Evaluated[Interval]) -> Budget:
    n, e, loop, run = x.plant.n, x.estimate, x.loop, x.course
    whole = n.lam * loop.dhat

    def share(part: Interval) -> float:
        most = float((part / whole).sanitised().hi)
        return most if most > _DUST else 0.0

    return Budget(
        plan=share(n.delta),
        feedforward=share(n.beta * e.ups),
        wind=share(x.plant.beta_w * loop.wbar),
        wind_estimate=share(n.beta * e.gust),
        bias=share(n.beta * (loop.S - e.gust)),
        noise_estimate=share(n.beta * loop.N),
        lag=share(n.beta * run.lag),
        noise_feedback=share(run.noisy),
        sampling=share(run.bound.delta - run.base - run.noisy),
    )

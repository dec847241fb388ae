"""How the distance goes: (H.12). Trusted."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Generic

from tubecert.conditions.arithmetic import (
    T,
    decay_mean,
    exp,
    maximum,
    number,
    quiet,
)
from tubecert.conditions.hardware.estimation import Estimate
from tubecert.conditions.hardware.feedback import Loss
from tubecert.conditions.hardware.gains import acting, forgetting
from tubecert.conditions.hardware.loop import Loop, Plant
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.sampled import ages


@dataclass(frozen=True, slots=True, kw_only=True)
class Ages(Generic[T]):
    """How old what the feedback acts on is: at least `youngest`, at most `oldest`, and at most `first` before t_a."""

    youngest: T
    oldest: T
    first: T


def ages_of_feedback(loop: Loop[T]) -> Ages[T]:
    """[tau, tau + Tf]; [0, Tf] with prediction, theory 8.4 and 8.5."""
    if loop.np is None:
        oldest = loop.Tf + loop.tau
        return Ages(youngest=loop.tau, oldest=oldest, first=oldest)
    return Ages(youngest=number(0, loop.tau), oldest=loop.Tf, first=maximum(loop.Tf, loop.tau))


@dataclass(frozen=True, slots=True, kw_only=True)
class Course(Generic[T]):
    """D(t) of theorem H: at most `start` before t_a, then `bound`; `base` and what time and noise add to it.

    `lag` is s1 (tau + mu), `noisy` the part of delta_H that noise in the feedback causes, and what computed geodesics
    do, which is `bent`.
    """

    start: T
    d1: T
    bound: DistanceBound[T]
    omega: T | None
    base: T
    lag: T
    noisy: T
    bent: T

    def supremum(self) -> T:
        """max(d0, f0, d1, sup D)."""
        return maximum(maximum(self.start, self.d1), _supremum(self.bound, self.omega))


def _supremum(D: DistanceBound[T], omega: T | None) -> T:
    """sup D; without a filter D is monotone, from d0 to A1."""
    return maximum(D.d0, D.ultimate()) if omega is None else D.supremum()


@quiet
def course(p: Plant[T], loop: Loop[T], e: Estimate[T], cost: Loss[T]) -> Course[T]:
    """delta_1, delta_H, d1 and the bound of (H.12)."""
    n, age, beta = p.n, ages_of_feedback(loop), acting(p, p.n.beta)
    mu = mean_wait(n.lam, loop.Ts)
    t_a = maximum(loop.Ts, loop.Tf) + loop.tau
    early = (cost.V_d * age.first + e.n_fb) / loop.f0
    delta_1 = maximum(n.lam * loop.f0, base_of(p, loop, e) + cost.at(age.first) * (1 + early))
    waiting = cost.ell1 * mean_wait(n.lam, loop.Tf)
    start = maximum(n.d0, loop.f0)
    # before t_a nothing is compensated; where the feedback is the slower one, the estimate acts already
    xi = e.H1 + loop.late * (e.X - e.H1)
    d1 = start * exp(-n.lam * t_a) + (beta * xi + delta_1) * t_a * decay_mean(n.lam * t_a)
    # where the saw-tooth of the faster clock does not begin at t_a, it adds its periodic solution at most: theory 8.4
    faster = loop.late * (beta * e.s1 * mu) + (1 - loop.late) * waiting
    d1 = d1 + loop.off * faster / n.lam
    return replace(resumed(p, loop, e, cost, d1), start=start)


@quiet
def resumed(p: Plant[T], loop: Loop[T], e: Estimate[T], cost: Loss[T], at: T) -> Course[T]:
    """The bound of (H.12) from d = `at` >= f0 on, once the feedback and the estimate act: D stays above f0."""
    n, age, omega = p.n, ages_of_feedback(loop), forgetting(p, loop)
    base = base_of(p, loop, e)
    later = (cost.V_d * age.oldest + e.n_fb) / loop.f0
    pushes = base + cost.at(age.youngest) + cost.at(age.oldest) * later
    lag = e.s1 * (loop.tau + mean_wait(n.lam, loop.Ts))
    return Course(
        start=at,
        d1=at,
        bound=DistanceBound(
            d0=at,
            beta=acting(p, n.beta),
            H0=maximum(n.H0, loop.S),
            S=loop.S,
            e=loop.N + lag,
            delta=maximum(n.lam * loop.f0, pushes) + cost.ell1 * mean_wait(n.lam, loop.Tf),
            lam=n.lam,
            omega=n.lam if omega is None else omega,
            horizon=n.horizon,
        ),
        omega=omega,
        base=base,
        lag=lag,
        noisy=cost.ell0 * (1 + later),
        bent=number(0, n.lam) if e.geodesics is None else e.geodesics.feedback * (1 + later),
    )


def base_of(p: Plant[T], loop: Loop[T], e: Estimate[T]) -> T:
    """What pushes whatever the feedback knows: the plan's defect, u* that is held, the wind, and rounding.

    The base of theory 8.3, with (H.36).
    """
    base = p.n.delta + acting(p, p.n.beta) * e.ups + p.beta_w * loop.wbar
    # Lam <= r_a + ell(age) (d + move), and d >= f0 where it counts, (H.36)
    return base if loop.lost is None else base + loop.lost.feedback / loop.f0


def mean_wait(rate: T, period: T) -> T:
    """mu = Ts/(1 - e^(-lambda Ts)) - 1/lambda, in [Ts/2, Ts]: Ts less the mean age of (4.6)."""
    return period - ages(period, rate, rate).m

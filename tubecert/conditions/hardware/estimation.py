"""What the estimate, the filter and the clip leave of h: (H.6), (H.7), (H.11), (H.17). Trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import (
    T,
    decay_mean,
    exp,
    expm1,
    maximum,
    minimum,
    number,
    quiet,
    sqrt,
)
from tubecert.conditions.hardware.gains import acting, applied, mistaken, raised, unpredicted
from tubecert.conditions.hardware.geodesics import Inexact, inexact
from tubecert.conditions.hardware.loop import Loop, Plant


@dataclass(frozen=True, slots=True, kw_only=True)
class Acts(Generic[T]):
    """What acts in a window of time: bounds of |kappa|, |u0 - u*| and |h - q^|."""

    kb: T
    ups: T
    X: T

    def with_those(self, before: Acts[T]) -> Acts[T]:
        """The larger of each: what acts in a window or in the one before it."""
        return Acts(
            kb=maximum(self.kb, before.kb), ups=maximum(self.ups, before.ups), X=maximum(self.X, before.X)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensed(Generic[T]):
    """The two parts of N, and the largest so far: the filter remembers the noise of earlier windows.

    `explained` is n_B, `turned` the part that a B^+ depending on x adds.
    """

    explained: T
    turned: T

    def with_those(self, before: Sensed[T]) -> Sensed[T]:
        """The larger of each part."""
        return Sensed(
            explained=maximum(self.explained, before.explained), turned=maximum(self.turned, before.turned)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Past(Generic[T]):
    """What the window before has to do with the next one (theorem HW)."""

    acts: Acts[T]
    sensed: Sensed[T]


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate(Generic[T]):
    """What the estimate, the filter and the clip leave of h, and what Y, S, N, np have to reach for that.

    `n_fb`: what noise is to the feedback, |Theta n| at most; `e_fb` the same in |.|; kb bounds |kappa|, ups |u0 - u*|,
    s1 the rate of h along the loop, H1 and X |h - q^| at first and always, `added` what all this is behind B. `gust` is
    the part of S that wind causes, `mistaken` the one that an uncertain gain does.
    After other windows kb, ups and X hold in the window before too; `acts` are those of its own. `geodesics`: what they
    lose where they are computed, None where they are exact.
    """

    n_fb: T
    e_fb: T
    kb: T
    ups: T
    s1: T
    H1: T
    X: T
    added: T
    gust: T
    mistaken: T
    bias: T
    ripple: T
    speed: T
    prediction: T | None
    acts: Acts[T]
    sensed: Sensed[T]
    geodesics: Inexact[T] | None


@quiet
def estimate(p: Plant[T], loop: Loop[T], past: Past[T] | None = None) -> Estimate[T]:
    """The estimate at Y, S, N (and np) of a recipe; `past` is that of the window before, if there is one.

    (H.6)-(H.11).
    """
    n = p.n
    n_fb, e_fb = noise_in_feedback(p, loop)
    s1 = n.Dht + n.Dhx * loop.Y
    t1 = loop.Ts + loop.tau
    H1 = minimum(n.Dh, n.H0 + s1 * t1)
    # S + (H0 - S)_+ = max(S, H0)
    X = minimum(n.Dh + n.R, maximum(H1, maximum(loop.S, n.H0) + loop.N + s1 * t1))
    geodesics = inexact(p, loop, n_fb)
    own = Acts(kb=raised(p, n.du) * (loop.dhat + n_fb), ups=input_error(p, loop, geodesics), X=X)
    acts = own if past is None else own.with_those(past.acts)
    known = n.Dus + acts.ups + acts.kb
    felt = noise_felt(p, loop)
    sensed = felt if past is None else felt.with_those(past.sensed)
    gust = wind_in_estimate(p, loop)
    kb, ups = acts.kb, acts.ups
    added, wrong = acting(p, kb + ups + acts.X), mistaken(p, loop, s1, kb, ups)
    bias = lag_of_filter(loop) * s1 + error_of_estimate(p, loop, s1, applied(p, ups, kb)) + gust
    return Estimate(
        n_fb=n_fb,
        e_fb=e_fb,
        kb=kb,
        ups=ups,
        s1=s1,
        H1=H1,
        X=acts.X,
        added=added,
        gust=gust,
        mistaken=wrong,
        bias=bias if p.gain is None else bias + wrong,
        ripple=noise_in_estimate(p, loop, sensed),
        speed=n.phi + n.DB * added + p.D_E * loop.wbar,
        prediction=prediction_error(p, loop, known, unpredicted(p, acts.X, kb, ups), geodesics),
        acts=own,
        sensed=sensed,
        geodesics=geodesics,
    )


def input_error(p: Plant[T], loop: Loop[T], geodesics: Inexact[T] | None) -> T:
    """ups, with what computed geodesics make of the input, (H.42)."""
    ups = feedforward_error(p, loop)
    return ups if geodesics is None else ups + geodesics.input


def noise_in_feedback(p: Plant[T], loop: Loop[T]) -> tuple[T, T]:
    """n_M and nbar; with prediction n_P = sqrt(A) np and np, theory 8.3 and 8.5."""
    n_M = loop.nu * p.m.n_M
    if loop.np is None:
        return n_M, loop.nu * p.m.n_E
    # n_P >= n_M by (H.17); both are bounds, each rounded for itself
    return maximum(n_M, sqrt(p.n.A) * loop.np), loop.np


def feedforward_error(p: Plant[T], loop: Loop[T]) -> T:
    """ups >= |u0 - u*|: 0, or what u* does while it is held, (H.6a); and what rounding does to the input, (H.36)."""
    held = number(0, loop.Ts)
    if p.held:
        most = 2 * p.n.Dus
        held = most if p.m.Lus is None else minimum(most, p.m.Lus * (maximum(loop.Ts, loop.Tf) + loop.tau))
    return held if loop.lost is None else held + loop.lost.input


def lag_of_filter(loop: Loop[T]) -> T:
    """((1 - th)/th) Ts = Ts/(e^(omega Ts) - 1), (H.6)."""
    return number(0, loop.Ts) if loop.omega is None else loop.Ts / expm1(loop.omega * loop.Ts)


def gain_of_filter(loop: Loop[T]) -> T:
    """th/Ts = (1 - e^(-omega Ts))/Ts, at most omega, (H.7)."""
    return 1 / loop.Ts if loop.omega is None else loop.omega * decay_mean(loop.omega * loop.Ts)


def error_of_estimate(p: Plant[T], loop: Loop[T], s1: T, whole: T) -> T:
    """e_s of (H.6) without wind and what is `mistaken`; `whole` is what `applied` says."""
    n = p.n
    b0 = minimum(n.DBp * n.DBx, n.DBpx * n.DB)
    nbar = loop.nu * p.m.n_E
    moved = loop.Y * loop.Ts / 2 + nbar
    found = (
        s1 * loop.Ts / 2
        + b0 * whole * moved
        + p.m.D_pf * (loop.Y * loop.Ts / 4 + nbar)
        + n.DBpx * p.rest * moved
    )
    if p.m.D_pt is not None:
        found = found + p.m.D_pt * loop.Ts / 4
    return found if loop.lost is None else found + loop.lost.estimate


def wind_in_estimate(p: Plant[T], loop: Loop[T]) -> T:
    """The part of e_s in (H.6) that wind causes."""
    moved = loop.Y * loop.Ts / 2 + loop.nu * p.m.n_E
    return (p.eps_w + p.n.DBpx * p.D_E * moved) * loop.wbar


def noise_felt(p: Plant[T], loop: Loop[T]) -> Sensed[T]:
    """The two parts of N with the constants of one window, (H.7)."""
    nbar = loop.nu * p.m.n_E
    return Sensed(explained=p.m.n_B, turned=p.n.DBpx * (loop.Y + 2 * nbar / loop.Ts) * nbar)


def noise_in_estimate(p: Plant[T], loop: Loop[T], sensed: Sensed[T]) -> T:
    """N of (H.7), or what noise of a bounded rate does if that is less."""
    summed = 2 * gain_of_filter(loop) * (loop.nu * sensed.explained) + sensed.turned
    return summed if p.drift is None else minimum(summed, sensed.explained * p.drift)


def prediction_error(
    p: Plant[T], loop: Loop[T], known: T, missed: T, geodesics: Inexact[T] | None = None
) -> T | None:
    """What np has to reach, (H.17); `known` bounds |u0 + kappa|, `missed` what else acts behind B."""
    if loop.np is None:
        return None
    n = p.n
    y = (n.Dfx + n.Dbx * known) * loop.tau
    # (e^y - 1)/D_p = tau e^y (1 - e^(-y))/y
    grown = exp(y)
    if loop.lost is not None:
        missed = missed + loop.lost.input
    if geodesics is not None:
        missed = missed + geodesics.input
    found = loop.nu * p.m.n_E * grown + (n.DB * missed + p.D_E * loop.wbar + p.rest) * (
        loop.tau * grown * decay_mean(y)
    )
    return found if loop.lost is None else found + loop.lost.prediction

"""What time and noise cost the feedback: (H.8), (H.9), (H.18), (H.19). Trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import (
    T,
    choose,
    maximum,
    minimum,
    nothing,
    number,
    quiet,
    sqrt,
)
from tubecert.conditions.hardware.estimation import Estimate
from tubecert.conditions.hardware.gains import steepness
from tubecert.conditions.hardware.loop import Loop, Plant
from tubecert.conditions.machine import Bent
from tubecert.conditions.obstacles import reach


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss(Generic[T]):
    """Lam <= (ell0 + ell1 age) (d + move), (H.15); `V_d` is how fast d changes; `chi` > 0 is test (5.1)."""

    ell0: T
    ell1: T
    V_d: T
    chi: T

    def at(self, age: T) -> T:
        """ell(age), (H.9)."""
        return self.ell0 + self.ell1 * age


@quiet
def loss(p: Plant[T], loop: Loop[T], e: Estimate[T]) -> Loss[T]:
    """(H.8), (H.9); what computed geodesics lose is part of ell0, (H.42)."""
    n, m = p.n, p.m
    G, L = 2 * m.G * n.rho, m.L_G * n.rho**2
    chi = 1 - G / 2 - L / 8
    bent = L + G
    added, blown = e.added, loop.wbar
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
    du = steepness(p)
    slope, turn = m.D_F + n.beta * du, m.D_Fx * (loop.dhat + e.n_fb) / 2
    # j1 n_M: a box of noise is measured by n_M as it is, and by sqrt(A) nbar where geodesics bend
    first = e.n_fb + bent / (2 * chi) * (sqrt(n.A) * e.e_fb)
    j0 = 1 + bent / (8 * chi)
    ell0 = slope * first + turn * j0 * e.e_fb
    ell1 = slope * V_M + turn * V_J + du * m.D_cx * m.Ystar * loop.dhat
    if m.bent is not None:
        other = covariant_loss(p, m.bent, loop, e)
        ell0, ell1 = minimum(ell0, other[0]), minimum(ell1, other[1])
    if m.D_Ft is not None:
        ell1 = ell1 + m.D_Ft * (loop.dhat + e.n_fb) / 2
    if e.geodesics is not None:
        ell0 = choose(e.geodesics.within, ell0 + e.geodesics.feedback, -nothing(chi))
    return Loss(ell0=ell0, ell1=ell1, V_d=V_d, chi=chi)


@quiet
def covariant_loss(p: Plant[T], m: Bent[T], loop: Loop[T], e: Estimate[T]) -> tuple[T, T]:
    """ell0 and ell' of (H.18), (H.19): every length is measured by the metric; infinite where chi' <= 0."""
    n = p.n
    K = m.K_R * reach(n) ** 2
    chi = 1 - K / 8
    added = m.beta_O * e.added + metric_gust(p, m) * loop.wbar + n.delta
    fastest = m.phi_M + added
    Q = K * fastest / chi
    du = steepness(p)
    slope, turn = p.m.D_F + n.beta * du, m.D_nF * (loop.dhat + e.n_fb) / 2
    ell0 = (slope * (1 + K / (2 * chi)) + turn * (1 + K / (8 * chi))) * e.n_fb
    ell1 = (
        slope * (m.D_nX * loop.dhat + added + Q / 2)
        + turn * (fastest + Q / 8)
        + du * m.D_nb * fastest * loop.dhat
    )
    endless = -nothing(chi)
    return choose(chi, ell0, endless), choose(chi, ell1, endless)


def metric_gust(p: Plant[T], m: Bent[T]) -> T:
    """A bound of |Theta E| at any state: beta_w may rest on beta, which is |Theta B| on the plan alone, (7.2)."""
    n = p.n
    return minimum(sqrt(n.A) * p.D_E, p.beta_w * maximum(number(1, n.beta), m.beta_O / n.beta))

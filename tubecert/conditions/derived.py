"""Derived constants of certificate A: everything in (26a)-(26c) that does not depend on omega or Gamma (theory 3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import T, quiet, sqrt
from tubecert.conditions.kernels import tight_kernel
from tubecert.conditions.predictor import Predictor
from tubecert.conditions.problem import Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class RateTerms(Generic[T]):
    """(26a)-(26c) as functions of omega: zeta_1 = weight1 k, zeta_2 = weight2 k, zeta_3 = third/omega."""

    speed: T  # Dxdot, bound of |xdot|
    s1: T  # bound of |dh/dt| along the closed loop
    hs: T  # bound of |sigma_hat - h|, (1 + r_H) Dh
    psi_x: T
    geodesic_rate: T
    psi_rate: T
    E0: T
    zeta_p: T
    weight1: T
    weight2: T
    third: T


@quiet
def rate_terms(n: Numbers[T]) -> RateTerms[T]:
    """(3.1)-(3.5), line by line."""
    hs = n.Dh + n.R
    kmax = sqrt(n.a) * n.rho * n.du  # (3.1)
    speed = n.phi + n.DB * (hs + kmax)  # (3.1), phi of (2.4)
    # (3.5)
    geodesic_rate = sqrt(n.A / n.a) * (n.Dfx + (hs + n.Dus + kmax) * n.Dbx + n.Dhx * n.DB) + (
        sqrt(n.A) * n.du * n.DB
    )
    psi_x = 2 * n.DBx + n.DB * n.DMx / n.a  # (3.5)
    # (3.5)
    psi_rate = n.A * (n.DB * geodesic_rate + n.DB * n.DMx * speed / sqrt(n.A * n.a) + n.DBx * speed)
    return RateTerms(
        speed=speed,
        s1=n.Dht + n.Dhx * speed,  # (3.1)
        hs=hs,
        psi_x=psi_x,
        geodesic_rate=geodesic_rate,
        psi_rate=psi_rate,
        E0=n.d0**2,  # (3.6)
        zeta_p=n.rho * n.delta / (n.lam * sqrt(n.a)),  # (3.4)
        weight1=2 * n.rho * n.DB * (n.A / n.a),  # (3.3)
        weight2=n.A * psi_x,  # (3.3)
        third=n.Dhx * (4 * n.lam * n.A * n.DB + psi_rate) / n.lam,  # (3.4)
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Zetas(Generic[T]):
    """zeta_1, zeta_2, zeta_3 at one omega."""

    zeta1: T
    zeta2: T
    zeta3: T


@quiet
def zetas(n: Numbers[T], terms: RateTerms[T], omega: T) -> Zetas[T]:
    """zeta_1 to zeta_3 with the kernel J of (2.19), (3.3), (3.4)."""
    k = tight_kernel(2 * n.lam, omega, n.Dh, terms.s1)
    return Zetas(zeta1=terms.weight1 * k, zeta2=terms.weight2 * k, zeta3=terms.third / omega)


@quiet
def prediction_error(hs: T, s1: T, q: T) -> T:
    """Dxt = sqrt(2 (1+r_H) Dh s1/q + ((1+r_H) Dh)^2): |xhat - x| <= Dxt/sqrt(Gamma), for P = I, (2.11)."""
    return sqrt(2 * hs * s1 / q + hs**2)


@quiet
def filter_error(n: Numbers[T], terms: RateTerms[T], omega: T, p: Predictor[T]) -> T:
    """Deta of certificate A: (DBpx Dxdot + (|sC| + |A_m|) DBp) Dxt with |sC| = 2 omega, (2.13)."""
    gain = n.DBpx * terms.speed + (2 * omega + p.norm) * n.DBp
    return gain * prediction_error(terms.hs, terms.s1, p.q)

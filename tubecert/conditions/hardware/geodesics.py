"""What geodesics cost that are computed at a few nodes, in a few sweeps: (H.41), (H.42). Trusted.

Where the metric is constant nothing is lost, for then the symbols are 0. Implements: theory 8.12, theorem H-G.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Generic

from tubecert.conditions.arithmetic import T, minimum, number, quiet, sqrt
from tubecert.conditions.hardware.loop import Loop, Plant
from tubecert.spec import Picard


@dataclass(frozen=True, slots=True, kw_only=True)
class Inexact(Generic[T]):
    """What a computed geodesic loses at distances of dhat + n_M at most.

    `feedback` r_g in d/s: alpha/2 + c'kappa <= r_g d; `input` r_k: |kappa| may be that much above du d; `length`: d as
    it is computed differs from d by at most that. All of it holds where `within` > 0.
    """

    feedback: T
    input: T
    length: T
    within: T


@quiet
def inexact(p: Plant[T], loop: Loop[T], n_fb: T) -> Inexact[T] | None:
    """(H.41), (H.42); None where geodesics are exact. `n_fb` is n_M, or n_P."""
    if p.geodesic is None:
        return None
    n, D = p.n, loop.dhat + n_fb
    r = D / sqrt(n.a)
    within = minimum(2 - 5 * (p.m.G * r), 1 - p.m.G * r * sqrt(n.A / n.a))
    off = sqrt(n.A) * error_of_speed(p.geodesic, p.m.G, p.m.L_G, r)
    alpha = off * (drift_along(p, D) + n.lam * (D + off / 4))
    law = n.beta * n.du * off * (2 * D + off / 2)
    return Inexact(feedback=(alpha + law) / D, input=n.du * off / 2, length=off / 2, within=within)


def error_of_speed(geodesic: Picard, G: T, L: T, r: T) -> T:
    """e of (H.41): the computed geodesic's second derivative is off by that in the mean, its ends' speeds by half."""
    g, nodes = G * r, geodesic.nodes
    q = L * r**2 / 8 + g * (2 + g) / 2
    between = number((1 + Fraction(1, nodes**2)) / (4 * nodes), r) * (L + 2 * G**2) * r**3
    e = G * r**2
    for _ in range(geodesic.sweeps):
        e = q * (e + between)
    return e + between


def drift_along(p: Plant[T], D: T) -> T:
    """Phi of (H.41): |Theta (f + B u*)| is at most that at x* and where the feedback looks."""
    n, m = p.n, p.m
    most = sqrt(n.A) * n.phi
    if m.bent is None:
        return most
    return minimum(minimum(most, m.bent.phi_M), sqrt(n.A) * (m.Ystar + n.delta_p) + m.bent.D_nX * D)

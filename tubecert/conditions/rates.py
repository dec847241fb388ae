"""Certificate A: the margins of the paper's conditions (26a), (26b), (26c) at given gains. Trusted.

A margin is (allowed - needed)/allowed. Its lower end is proven: it is evaluated at numbers for which the
theorem holds. Its upper end bounds the margin for the constants themselves, whatever they are within their
enclosures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic

import numpy as np

from tubecert.bounds.constants import Constant
from tubecert.conditions.arithmetic import Array, T, choose, nothing, quiet, sqrt, vector
from tubecert.conditions.inputs import InputShares, shares
from tubecert.conditions.kernels import tight_kernel
from tubecert.conditions.obstacles import obstacle, reach
from tubecert.conditions.problem import Numbers, Shortfall, TubeProblem
from tubecert.conditions.theorem import LoopGains, Theorem
from tubecert.conditions.wind import not_covered, prediction_error, provisos
from tubecert.enclosure.interval import Interval

Margins = dict[str, Interval]


@dataclass(frozen=True, slots=True, kw_only=True)
class RateRecipe(LoopGains):
    """Everything that the conditions (26) are checked at."""


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


@quiet
def zetas(n: Numbers[T], terms: RateTerms[T], omega: T) -> tuple[T, T, T]:
    """zeta_1 to zeta_3 at one omega, with the kernel J of (2.19), (3.3), (3.4)."""
    k = tight_kernel(2 * n.lam, omega, n.Dh, terms.s1)
    return terms.weight1 * k, terms.weight2 * k, terms.third / omega


@quiet
def filter_error(n: Numbers[T], terms: RateTerms[T], omega: T, g: T) -> T:
    """Deta of certificate A: (DBpx Dxdot + (|sC| + |A_m|) DBp) Dxt with |sC| = 2 omega, |A_m| = g, (2.13)."""
    gain = n.DBpx * terms.speed + (2 * omega + g) * n.DBp
    return gain * prediction_error(terms.hs, terms.s1, g)


@quiet
def margins_26_along(problem: TubeProblem, recipes: Sequence[RateRecipe]) -> Margins:
    """Margins at many gains at once, shape `(len(recipes),)`; recipes share the projection radius."""
    R_H = recipes[0].projection_radius
    serves = all(r.projection_radius == R_H for r in recipes) and problem.radius_serves(R_H)
    omega = vector([r.bandwidth for r in recipes])
    Gamma = vector([r.adaptation_rate for r in recipes])
    g = vector([r.predictor_gain for r in recipes])
    proven = rate_margins(problem.proven(R_H), omega, Gamma, g)
    possible = rate_margins(problem.enclosed(R_H), omega, Gamma, g)
    return {
        claim: Interval(low if serves else np.full_like(low, -np.inf), np.maximum(low, possible[claim].hi))
        for claim, low in ((claim, margin.lo) for claim, margin in proven.items())
    }


def rate_margins(n: Numbers[T], omega: T, Gamma: T, g: T) -> dict[str, T]:
    """The three margins in one arithmetic; (26c) is -inf where (26b) leaves nothing to divide by."""
    terms = rate_terms(n)
    zeta1, zeta2, zeta3 = zetas(n, terms, omega)
    first = 1 - (terms.E0 / n.a + zeta1 + terms.zeta_p) / n.rho_r**2
    rest = n.a - zeta2 - zeta3
    needed = theta(n, terms, omega, g) / (n.rho_a * rest)
    third = choose(rest, 1 - needed / sqrt(Gamma), nothing(rest))
    return {"26a": _known(first), "26b": _known(rest / n.a), "26c": _known(third)}


def _known(x: T) -> T:
    return x.sanitised() if isinstance(x, Interval) else x


def theta(n: Numbers[T], terms: RateTerms[T], omega: T, g: T) -> T:
    """Dtheta = DB A Deta/lambda, (3.2)."""
    return n.DB * n.A * filter_error(n, terms, omega, g) / n.lam


def derived_constants(problem: TubeProblem, recipe: RateRecipe) -> dict[str, Constant]:
    """The derived constants at the printed gains as enclosures, by their names in the certificate."""
    omega = Interval.of(recipe.bandwidth)
    g = Interval.of(recipe.predictor_gain)
    below, above = (
        _derived(n, omega, g)
        for n in (problem.enclosed(recipe.projection_radius), problem.proven(recipe.projection_radius))
    )
    return {
        name: Constant(below=float(below[name].lo), above=float(np.maximum(above[name].hi, below[name].lo)))
        for name in below
    }


@quiet
def _derived(n: Numbers[Interval], omega: Interval, g: Interval) -> dict[str, Interval]:
    terms = rate_terms(n)
    zeta1, zeta2, zeta3 = zetas(n, terms, omega)
    return {
        "speed": terms.speed,
        "uncertainty_rate": terms.s1,
        "prediction_error": prediction_error(terms.hs, terms.s1, g),
        "filter_error": filter_error(n, terms, omega, g),
        "theta": theta(n, terms, omega, g),
        "Psi_x": terms.psi_x,
        "geodesic_rate": terms.geodesic_rate,
        "Psi_rate": terms.psi_rate,
        "zeta_1": zeta1.sanitised(),
        "zeta_2": zeta2.sanitised(),
        "zeta_3": zeta3.sanitised(),
    }


def input_shares(problem: TubeProblem, recipe: RateRecipe) -> InputShares | None:
    """|k| <= du dbar: theorem A says of d no more than that it stays below dbar; |u_a| <= R_H."""
    n = problem.proven(recipe.projection_radius)
    return shares(n, reach(n), recipe.projection_radius)


def _at_once(problem: TubeProblem, n: Numbers[Array]) -> object:
    """All of (26a)-(26c) at some gains."""
    del problem
    one = np.asarray(1.0)
    return rate_margins(n, one, one, one)


def _obstacles(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """Why no bandwidth serves, if so: the initial error and the plan's defect alone need rho_r^2 <= E0/a + zeta_p."""
    allowed, needed = [], []
    for n in (problem.proven(), problem.enclosed()):
        terms = rate_terms(n)
        needed.append(terms.E0 / n.a + terms.zeta_p)
        allowed.append(n.rho_r**2)
    found = obstacle("26a", allowed, needed)
    return () if found is None else (found,)


def _provisos(problem: TubeProblem) -> tuple[Shortfall, ...]:
    """Theorem A knows nothing that is no input, and no B that is not known."""
    return (*not_covered(problem), *provisos(problem))


THEOREM = Theorem(
    recipe=RateRecipe,
    margins=margins_26_along,
    ceilings=lambda problem, recipe: {},  # a recipe is its gains: the upper ends hold for all there is
    formula=_at_once,
    obstacles=_obstacles,
    provisos=_provisos,
    inputs=input_shares,
)

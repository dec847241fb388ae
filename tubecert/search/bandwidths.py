"""Which bandwidths (26a) and (26b) admit: with the kernel J of (2.19) both fall with omega, so a half-line each."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.rates import RateTerms, rate_terms, zetas
from tubecert.enclosure.constant import round_up
from tubecert.search.scan import smallest

_POINTS, _DIGITS = 41, 4  # of the bandwidths around one
_BELOW, _ABOVE = 0.4, 6.0  # times that one
_LOWEST = 1e-3  # the least bandwidth considered, in units of the rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidth:
    """The smallest feasible bandwidth, and the condition that sets it."""

    low: float
    binds: str


@dataclass(frozen=True, slots=True, kw_only=True)
class RateSearch:
    """What every step of this search needs: the problem, its numbers in floats, the derived constants."""

    problem: TubeProblem
    n: Numbers[Array]
    terms: RateTerms[Array]

    @staticmethod
    @quiet
    def of(problem: TubeProblem) -> RateSearch:
        """Floats on the safe side."""
        n = problem.floats(problem.projection_radius)
        return RateSearch(problem=problem, n=n, terms=rate_terms(n))


@quiet
def _least(s: RateSearch, claim: str, share_left: float) -> float:
    """The bandwidth from which on one of the conditions holds, or inf."""
    n, terms = s.n, s.terms
    weight, rest = (terms.weight1, 0.0) if claim == "26a" else (terms.weight2, float(terms.third))
    allowed = (
        float(n.rho_r**2 - terms.E0 / n.a - terms.zeta_p) if claim == "26a" else float(n.a) * (1 - share_left)
    )
    if allowed <= 0:
        return float("inf")

    def holds(omega: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        zeta1, zeta2, zeta3 = zetas(n, terms, omega)
        return (zeta1 if claim == "26a" else zeta2 + zeta3) <= allowed

    floor = _LOWEST * float(n.lam)
    # the kernel is at most Dh/omega + s1/(2 lambda omega)
    first = float(weight) * float(n.Dh)
    second = max(float(weight) * float(terms.s1 / (2.0 * n.lam)) + rest, 0.0)
    return smallest(holds, floor, max((first + second) / allowed, floor) * 1.01)


def bandwidth(s: RateSearch, share_left: float) -> Bandwidth | None:
    """The smallest bandwidth of (26a) and (26b), or None; `share_left` of (26b) is kept free for Gamma."""
    first, second = _least(s, "26a", share_left), _least(s, "26b", share_left)
    low = max(first, second)
    # the condition whose half-line begins at the common lower end is the one that binds
    return Bandwidth(low=low, binds="26b" if low == second else "26a") if np.isfinite(low) else None


def bandwidths_around(omega: Fraction) -> list[Fraction]:
    """Printed bandwidths around one, which is among them; ascending, without repetitions."""
    factors = np.geomspace(_BELOW, _ABOVE, _POINTS)
    return sorted({omega, *(round_up(float(omega) * float(factor), _DIGITS) for factor in factors)})

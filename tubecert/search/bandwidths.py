"""Which bandwidths (26a) and (26b) admit: windows with the paper's kernel, a half-line with the tight one."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import round_up
from tubecert.conditions.derived import RateTerms, rate_terms, zetas
from tubecert.conditions.kernels import Kernel
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.search.scan import smallest
from tubecert.search.windows import Window, intersection, windows

_POINTS, _DIGITS = 41, 4  # of the bandwidths around one
_BELOW, _ABOVE = 0.4, 6.0  # times that one
_LOWEST = 1e-3  # the least bandwidth considered, in units of the rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidth:
    """The smallest feasible bandwidth, the set it belongs to, and the condition that sets it."""

    low: float
    high: float
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
        return RateSearch(problem=problem, n=n, terms=rate_terms(problem, n))


def _budgets(s: RateSearch, share_left: float) -> dict[str, tuple[float, float, float]]:
    """(c1, c2, R) of the two bandwidth conditions."""
    n, terms = s.n, s.terms
    slow = float(terms.s1 / (2.0 * n.lam))
    first, second = float(terms.weight1), float(terms.weight2)
    allowed = float(n.rho_r**2 - terms.E0 / n.a - terms.zeta_p)
    return {
        "26a": (first * float(n.Dh), max(first * slow, 0.0), allowed),
        "26b": (
            second * float(n.Dh),
            max(second * slow + float(terms.third), 0.0),
            float(n.a) * (1 - share_left),
        ),
    }


@quiet
def _feasible(s: RateSearch, claim: str, share_left: float) -> list[Window]:
    """Bandwidths that satisfy one of the conditions."""
    c1, c2, R = _budgets(s, share_left)[claim]
    c = 2.0 * float(s.n.lam)
    if R <= 0:
        return []
    if s.problem.active_kernel is Kernel.PAPER:
        return windows(c1, c2, R, c)

    def holds(omega: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        z = zetas(s.problem, s.n, s.terms, omega)
        return (z.zeta1 if claim == "26a" else z.zeta2 + z.zeta3) <= R

    floor = _LOWEST * float(s.n.lam)
    # the kernel is at most Dh/omega + s1/(2 lambda omega), so the half-line begins below (c1 + c2)/R
    return [(smallest(holds, floor, max((c1 + c2) / R, floor) * 1.01), float("inf"))]


def bandwidths(s: RateSearch, share_left: float) -> list[Bandwidth]:
    """The feasible set of (26a) and (26b), ascending; `share_left` of (26b) is kept free for Gamma."""
    first, second = _feasible(s, "26a", share_left), _feasible(s, "26b", share_left)
    floor = _LOWEST * float(s.n.lam)
    common = [(max(low, floor), high) for low, high in intersection(first, second) if high >= floor]
    # the condition whose own interval begins at the common lower end is the one that binds
    starts = {low for low, _ in second}
    return [Bandwidth(low=low, high=high, binds="26b" if low in starts else "26a") for low, high in common]


def bandwidths_around(omega: Fraction) -> list[Fraction]:
    """Printed bandwidths around one, which is among them; ascending, without repetitions."""
    factors = np.geomspace(_BELOW, _ABOVE, _POINTS)
    return sorted({omega, *(round_up(float(omega) * float(factor), _DIGITS) for factor in factors)})

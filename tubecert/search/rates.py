"""Search of certificate A: the smallest bandwidth of (26a), (26b), its rate, the least Gamma, the curve.

With the kernel J of (2.19) the left-hand sides of both bandwidth conditions fall with omega: a half-line each.
Implements: theory section 3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance as theorem_b
from tubecert.conditions import rates as theorem_a
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.rates import RateRecipe, rate_terms, theta, zetas
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.enclosure.constant import round_up
from tubecert.search.distance import recipes_at
from tubecert.search.gains import DIGITS, LEAST, Gains, GainSearch, Mask, smallest

SHARE_LEFT = 0.01  # of (26b) that the pair leaves where (26b) binds
_LOWEST = 1e-3  # the least bandwidth considered, in units of the rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Bandwidth:
    """The smallest feasible bandwidth, infinite if there is none, and the condition that sets it."""

    low: float
    binds: str


class RateSearch(GainSearch[RateRecipe]):
    """The gains of certificate A."""

    span = 1e6

    @quiet
    def __init__(self, problem: TubeProblem, n: Numbers[Array] | None = None) -> None:
        super().__init__(problem, n)
        self.terms = rate_terms(self.n)

    @property
    def blocked(self) -> bool:
        """Whether a constant that the theorem needs has no bound."""
        return bool(theorem_a.THEOREM.unbounded(self.problem))

    def smallest(self) -> float:
        """That of the pair."""
        return self.bandwidth(SHARE_LEFT).low

    def bandwidth(self, share_left: float) -> Bandwidth:
        """The smallest bandwidth of (26a) and (26b); `share_left` of (26b) is kept free for Gamma."""
        first, second = (self._least(claim, share_left) for claim in ("26a", "26b"))
        low = max(first, second)
        # the condition whose half-line begins at the common lower end is the one that binds
        return Bandwidth(low=low, binds="26b" if low == second else "26a")

    @quiet
    def _least(self, claim: str, share_left: float) -> float:
        """The bandwidth from which on one of the conditions holds, or inf."""
        n, terms = self.n, self.terms
        weight, rest = (terms.weight1, 0.0) if claim == "26a" else (terms.weight2, float(terms.third))
        allowed = (
            float(n.rho_r**2 - terms.E0 / n.a - terms.zeta_p)
            if claim == "26a"
            else float(n.a) * (1 - share_left)
        )
        if allowed <= 0:
            return float("inf")

        def holds(omega: Array) -> Mask:
            zeta1, zeta2, zeta3 = zetas(n, terms, omega)
            return (zeta1 if claim == "26a" else zeta2 + zeta3) <= allowed

        floor = _LOWEST * float(n.lam)
        # the kernel is at most Dh/omega + s1/(2 lambda omega)
        first = float(weight) * float(n.Dh)
        second = max(float(weight) * float(terms.s1 / (2.0 * n.lam)) + rest, 0.0)
        return smallest(holds, floor, max((first + second) / allowed, floor) * 1.01)

    @quiet
    def needed(self, omega: Array, g: Array | None = None) -> Array:
        """The Gamma of (26c), infinite where (26b) leaves nothing."""
        if g is None:
            given = self.problem.predictor_gain
            g = self._best(omega) if given is None else np.full_like(omega, float(given))
        _, zeta2, zeta3 = zetas(self.n, self.terms, omega)
        rest = self.n.a - zeta2 - zeta3
        value = (theta(self.n, self.terms, omega, g) / (self.n.rho_a * rest)) ** 2
        return np.where(rest > 0, value, np.inf)

    @quiet
    def _best(self, omega: Array) -> Array:
        """The g of A_m = -g I with the smallest Deta; never below a thousandth of the bandwidth."""
        r = self.terms.s1 / self.terms.hs
        k = self.n.DBpx * self.terms.speed / self.n.DBp + 2 * omega
        return np.fmax((np.sqrt(r * (r + 8.0 * k)) - r) / 4.0, 1e-3 * omega)

    def best(self, bandwidths: Sequence[Fraction]) -> list[Fraction]:
        """One at a time."""
        return [round_up(float(self._best(np.asarray(float(w)))), DIGITS) for w in bandwidths]

    def made(self, gains: Sequence[Gains]) -> tuple[RateRecipe, ...]:
        """A recipe is its gains."""
        R_H = self.problem.projection_radius
        return tuple(
            RateRecipe(bandwidth=w, adaptation_rate=Gamma, predictor_gain=g, projection_radius=R_H)
            for w, Gamma, g in gains
        )

    def propose(self, asked: Asked) -> Proposal[RateRecipe]:
        """The smallest bandwidth and its rate, or the gains asked for, with the pair of least Gamma and the curve."""
        if self.blocked:
            return Proposal()
        found, whole = self.bandwidth(SHARE_LEFT), self.bandwidth(0.0)
        serves = np.isfinite(found.low)
        recipe = self.from_bandwidth(found.low) if asked.gains is None else self.given(*asked.gains)
        least = self.least(found.low)
        told = recipe if asked.curve else None
        return Proposal(
            decisive=recipe,
            role="pair",
            beside={} if least is None else {LEAST: least},
            companion=None if told is None else self._companion(told),
            curve=self.curve(found.low) if serves and asked.curve else (),
            around=() if told is None else self.around(told),
            infimum=whole.low if np.isfinite(whole.low) else None,
            binds=found.binds if serves else None,
        )

    def _companion(self, recipe: RateRecipe) -> DistanceRecipe | None:
        """A recipe of certificate B at the same gains: it tells the ultimate radius."""
        if theorem_b.THEOREM.unbounded(self.problem):
            return None
        return recipes_at(self.problem, [(recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain)])[
            0
        ]

"""Search of certificate B: the split pair, the pair of least Gamma, the curve Gamma(omega), gains asked for.

For given (omega, e) the least Y is closed; sup D rises with e, so the largest admissible e is a boundary,
and Gamma = (Deta/e)^2. Implements: theory section 4, "Search and proof".
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance as theorem_b
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.conditions.wind import felt, is_felt, pushed, taken
from tubecert.enclosure.constant import round_up
from tubecert.kernel import obstacles
from tubecert.search.gains import (
    DIGITS,
    LEAST,
    SLACK,
    Gains,
    GainSearch,
    Mask,
    boundary,
    minimum_lanes,
    smallest,
)

_LOWEST, _HIGHEST = 1e-3, 1e9  # the bandwidths considered, in units of the rate


@quiet
def best_gain(n: Numbers[Array], omega: Array, Y: Array) -> Array:
    """The g of A_m = -g I with the smallest Deta: omega for a constant B."""
    r = (n.Dht + n.Dhx * Y) / (n.Dh + n.R)
    k = n.DBpx * Y / n.DBp
    return np.fmax(omega, (np.sqrt(r * (r + 8.0 * k)) - r) / 4.0)


@quiet
def least_rate(
    problem: TubeProblem, n: Numbers[Array], omega: Array, gain: Array | None = None
) -> tuple[Array, Array]:
    """The least Gamma per bandwidth, infinite where none serves, and its e; all of shape (lanes,)."""

    def inside(e: Array) -> Mask:
        Y = theorem_b.least_speed(n, omega, e)
        return theorem_b.distance_bound(n, omega, theorem_b.uncertainty(n, Y, omega), e).supremum() < reach(n)

    given = gain
    if given is None and problem.predictor_gain is not None:
        given = np.asarray(float(problem.predictor_gain))
    most = np.broadcast_to((reach(n) * n.lam - pushed(n)) / n.beta, omega.shape)
    zero = np.zeros_like(omega)
    feasible = (most > 0) & inside(zero)
    e_max = boundary(inside, zero, np.where(feasible, most, 0.0)) * (1 - SLACK)

    def rate(e: Array) -> Array:
        Y = theorem_b.least_speed(n, omega, e)
        g = best_gain(n, omega, Y) if given is None else given
        if is_felt(n):
            return np.where(feasible & (e > 0), _rate_beside(n, omega, Y, g, e), np.inf)
        return np.where(feasible & (e > 0), (theorem_b.filter_error(n, Y, omega, g) / e) ** 2, np.inf)

    if not np.any(n.DBpx > 0):
        return rate(e_max), e_max
    # Deta grows with Y(e): the least may lie inside
    return minimum_lanes(rate, np.maximum(1e-4 * e_max, 1e-300), np.maximum(e_max, 1e-300))


def _rate_beside(n: Numbers[Array], omega: Array, Y: Array, g: Array, e: Array) -> Array:
    """The Gamma for which (7.9) gives e, infinite where none does: a quadratic equation for 1/Gamma."""
    room, q = (e - taken(n)) / theorem_b.estimation_gain(n, Y, omega, g), 2 * g
    drag, hs = felt(n) / q, n.Dh + n.R
    c = 2 * hs * (n.Dht + n.Dhx * Y) / q
    K, A = hs**2 + c, room**2 - 2 * drag**2
    linear = A * K + 2 * drag**2 * c
    root = 2 * drag * np.sqrt(np.maximum(A * K * c + drag**2 * (c**2 + K**2), 0.0))
    return np.where(room > 2 * drag, (linear + root) / (room**2 * (room**2 - 4 * drag**2)), np.inf)


@quiet
def smallest_bandwidth(n: Numbers[Array], distance: Array) -> float:
    """The smallest omega with sup D < distance at e = 0 (Gamma without bound), or inf."""

    def inside(omega: Array) -> Mask:
        zero = np.zeros_like(omega)
        S = theorem_b.uncertainty(n, theorem_b.least_speed(n, omega, zero), omega)
        return theorem_b.distance_bound(n, omega, S, zero).supremum() < distance

    return smallest(inside, float(n.lam) * _LOWEST, float(n.lam) * _HIGHEST)


@quiet
def _recipes(problem: TubeProblem, gains: Sequence[Gains], inflation: float) -> list[DistanceRecipe]:
    """Recipes at given gains: the least fixed point Y, e, S in floats, inflated, as decimals."""
    R_H = problem.projection_radius
    n = problem.floats(R_H)
    omega, Gamma, g = np.array(gains, dtype=float).T
    e = np.zeros_like(omega)
    for _ in range(400):
        # Y is closed for a given e, so that only the error itself is iterated
        Y = theorem_b.least_speed(n, omega, e)
        raised = theorem_b.error_needed(n, Y, omega, g, Gamma)
        settled = np.all(raised <= e * (1 + 1e-15))
        e = raised
        if settled:
            break
    Y = Y * (1 + inflation)
    e = theorem_b.error_needed(n, Y, omega, g, Gamma) * (1 + 1e-12)
    S = theorem_b.uncertainty(n, Y, omega) * (1 + 1e-12) + 1e-12 * n.H0 + 1e-30
    return [
        DistanceRecipe(
            bandwidth=own[0],
            adaptation_rate=own[1],
            predictor_gain=own[2],
            projection_radius=R_H,
            speed=round_up(float(Y[i]), 13),
            prediction_error=round_up(float(e[i]), 13),
            uncertainty=round_up(float(S[i]), 13),
        )
        for i, own in enumerate(gains)
    ]


def recipes_at(problem: TubeProblem, gains: Sequence[Gains]) -> list[DistanceRecipe]:
    """The best recipes found at given gains; where they serve at all, their inequalities have room."""
    for inflation in (1e-9, 1e-6, 1e-3):
        recipes = _recipes(problem, gains, inflation)
        margin = theorem_b.margin_distance_along(problem, recipes)
        if np.all(margin.lo > -np.inf):
            break
    return recipes


class DistanceSearch(GainSearch[DistanceRecipe]):
    """The gains of certificate B."""

    span, raised, first = 1e4, (1.01, 2.0), 1.02

    @property
    def blocked(self) -> bool:
        """Whether a constant has no bound, or the tube is too narrow for any gains."""
        return bool(obstacles(self.problem, theorem_b.THEOREM))

    def smallest(self) -> float:
        """That for which sup D < dbar with Gamma without bound."""
        return smallest_bandwidth(self.n, reach(self.n))

    def needed(self, omega: Array, g: Array | None = None) -> Array:
        """Deta/e squared, for the largest e that is admitted."""
        return least_rate(self.problem, self.n, omega, g)[0]

    def best(self, bandwidths: Sequence[Fraction]) -> list[Fraction]:
        """At the e of least Gamma."""
        errors = least_rate(self.problem, self.n, np.array(bandwidths, dtype=float))[1]
        return [self._predictor(w, e) for w, e in zip(bandwidths, errors, strict=True)]

    def _predictor(self, omega: Fraction, e: float) -> Fraction:
        w = np.asarray(float(omega))
        g = float(best_gain(self.n, w, theorem_b.least_speed(self.n, w, np.asarray(float(e)))))
        return omega if g <= float(omega) else round_up(g, DIGITS)

    def made(self, gains: Sequence[Gains]) -> tuple[DistanceRecipe, ...]:
        """With Y, e and S."""
        return tuple(recipes_at(self.problem, gains))

    def propose(self, asked: Asked) -> Proposal[DistanceRecipe]:
        """The pairs of least bandwidth and of least Gamma, the curve, and the gains asked for, which then decide."""
        if self.blocked:
            return Proposal()
        n, low = self.n, self.smallest()
        least = self.least(low)
        split = self.from_bandwidth(smallest_bandwidth(n, np.sqrt(n.a) * n.rho_r))
        if least is not None and split is not None and least.bandwidth < split.bandwidth:
            split = least  # much is left to rho_a: the pair of least Gamma has the smaller bandwidth as well
        found = {LEAST: least, "split": split}
        roles = {role: recipe for role, recipe in found.items() if recipe is not None}
        if asked.gains is None:
            role = next(iter(roles), "")
            decisive = roles.pop(role, None)
        else:
            role, decisive = "asked", self.given(*asked.gains)
        return Proposal(
            decisive=decisive,
            role=role,
            beside=roles,
            curve=self.curve(low) if asked.curve and np.isfinite(low) else (),
            around=self.around(decisive) if asked.curve and decisive is not None else (),
        )

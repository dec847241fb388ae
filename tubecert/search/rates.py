"""Search of certificate A: the smallest bandwidth of (26a), (26b), its rate, the least Gamma, the curve.

The left-hand sides of both bandwidth conditions fall with omega: one half-line. Implements: theory section 3.
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance as theorem_b
from tubecert.conditions import rates as theorem_a
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe, theta, zetas
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.enclosure.constant import next_up, round_up
from tubecert.search import distance
from tubecert.search.bandwidths import Bandwidth, RateSearch, bandwidth, bandwidths_around
from tubecert.search.scan import minimum_log, serves, smallest

DIGITS = 4
CURVE_POINTS = 25
SHARE_LEFT = 0.01  # of (26b) that the pair leaves where (26b) binds
_SLACK = 1e-12


@quiet
def needed_rate(s: RateSearch, omega: Array, g: Array) -> Array:
    """The Gamma of (26c), infinite where (26b) leaves nothing."""
    _, zeta2, zeta3 = zetas(s.n, s.terms, omega)
    rest = s.n.a - zeta2 - zeta3
    value = (theta(s.n, s.terms, omega, g) / (s.n.rho_a * rest)) ** 2
    return np.where(rest > 0, value, np.inf)


@quiet
def best_gain(s: RateSearch, omega: Array) -> Array:
    """The g of A_m = -g I with the smallest Deta; never below a thousandth of the bandwidth."""
    r = s.terms.s1 / s.terms.hs
    k = s.n.DBpx * s.terms.speed / s.n.DBp + 2 * omega
    return np.fmax((np.sqrt(r * (r + 8.0 * k)) - r) / 4.0, 1e-3 * omega)


def printed_gain(s: RateSearch, omega: Fraction) -> Fraction:
    """The predictor gain at a printed bandwidth: the one given, or the best one to 4 digits."""
    if s.problem.predictor_gain is not None:
        return s.problem.predictor_gain
    return round_up(float(best_gain(s, np.asarray(float(omega)))), DIGITS)


def gains_along(s: RateSearch, omega: Array) -> Array:
    """The predictor gains of a search along omega."""
    g = s.problem.predictor_gain
    return best_gain(s, omega) if g is None else np.full_like(omega, float(g))


def recipe_at(s: RateSearch, omega: Fraction, Gamma: Fraction | None = None) -> RateRecipe | None:
    """The recipe at a printed bandwidth, with the least Gamma if none is given; None if there is none."""
    g = printed_gain(s, omega)
    if Gamma is None:
        needed = float(needed_rate(s, np.array([float(omega)]), np.array([float(g)]))[0])
        if not np.isfinite(needed):
            return None
        Gamma = round_up(max(needed * (1 + _SLACK), 1e-12), DIGITS)
    return RateRecipe(
        bandwidth=omega,
        adaptation_rate=Gamma,
        predictor_gain=g,
        projection_radius=s.problem.projection_radius,
    )


def _serving(problem: TubeProblem, recipe: RateRecipe | None) -> RateRecipe | None:
    """The recipe if its margins are positive; the rate may have to go up by one in its last digit."""
    if recipe is None:
        return None
    for Gamma in (recipe.adaptation_rate, next_up(recipe.adaptation_rate, DIGITS)):
        raised = replace(recipe, adaptation_rate=Gamma)
        if serves(problem, raised):
            return raised
    return None


def recipe_from(s: RateSearch, low: float) -> RateRecipe | None:
    """The recipe at the first printed bandwidth that serves; more digits only where 4 do not."""
    for digits in (DIGITS, 5, 6, 8, 12):
        recipe = _serving(s.problem, recipe_at(s, round_up(low * (1 + _SLACK), digits)))
        if recipe is not None:
            return recipe
    return None


def least_recipe(s: RateSearch, found: Bandwidth | None) -> RateRecipe | None:
    """The recipe of least Gamma over all feasible bandwidths."""
    return None if found is None else recipe_from(s, _best(s, found.low))


def _best(s: RateSearch, low: float) -> float:
    """The bandwidth of least Gamma above the smallest that serves."""
    return minimum_log(lambda w: needed_rate(s, w, gains_along(s, w)), low, 1e6 * low)


def curve(s: RateSearch, low: float) -> tuple[RateRecipe, ...]:
    """Gamma(omega) at printed bandwidths."""
    candidates = (recipe_at(s, round_up(w, DIGITS)) for w in np.geomspace(low, 20 * low, CURVE_POINTS))
    return tuple(recipe for recipe in candidates if recipe is not None)


def _asked_recipe(
    s: RateSearch, omega: Fraction | None, Gamma: Fraction | None, found: Bandwidth | None
) -> RateRecipe | None:
    """The recipe for gains asked for; what is not asked for is chosen as small as possible."""
    if omega is not None:
        return recipe_at(s, omega, Gamma)
    assert Gamma is not None
    if found is None:
        return None
    least = _best(s, found.low)

    def enough(w: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        flat = w.ravel()
        return (needed_rate(s, flat, gains_along(s, flat)) <= float(Gamma)).reshape(w.shape)

    at = smallest(enough, found.low, least, 60)
    return recipe_at(s, round_up((at if np.isfinite(at) else least) * (1 + _SLACK), DIGITS), Gamma)


def propose_rates(problem: TubeProblem, asked: Asked) -> Proposal[RateRecipe]:
    """The smallest bandwidth and its rate, or the gains asked for, with the pair of least Gamma and the curve."""
    if theorem_a.THEOREM.unbounded(problem):
        return Proposal()
    s = RateSearch.of(problem)
    found, whole = bandwidth(s, SHARE_LEFT), bandwidth(s, 0.0)
    hopeless = None
    if asked.bandwidth is None and asked.adaptation_rate is None:
        recipe = None if found is None else recipe_from(s, found.low)
    else:
        recipe = _asked_recipe(s, asked.bandwidth, asked.adaptation_rate, found)
        if recipe is None and asked.bandwidth is not None:
            # (26b) leaves nothing for any rate: the bandwidth alone is to be judged
            hopeless = recipe_at(s, asked.bandwidth, Fraction(10) ** 100)
    least = least_recipe(s, found)
    return Proposal(
        decisive=recipe,
        role="pair",
        hopeless=hopeless,
        beside={} if least is None else {"least_adaptation": least},
        companion=_companion(problem, recipe) if recipe is not None and asked.curve else None,
        curve=curve(s, found.low) if found is not None and asked.curve else (),
        around=_around(recipe) if recipe is not None and asked.curve else (),
        infimum=None if whole is None else whole.low,
        binds=None if found is None else found.binds,
    )


def least_rates(problem: TubeProblem) -> RateRecipe | None:
    """The pair of least Gamma alone, as `propose_rates` has it beside the others."""
    if theorem_a.THEOREM.unbounded(problem):
        return None
    s = RateSearch.of(problem)
    return least_recipe(s, bandwidth(s, SHARE_LEFT))


def _companion(problem: TubeProblem, recipe: RateRecipe) -> DistanceRecipe | None:
    """A recipe of certificate B at the same gains: it tells the ultimate radius."""
    if theorem_b.THEOREM.unbounded(problem):
        return None
    return distance.recipe_at(problem, recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain)


def _around(recipe: RateRecipe) -> tuple[RateRecipe, ...]:
    """The same rate and predictor at other bandwidths."""
    return tuple(replace(recipe, bandwidth=omega) for omega in bandwidths_around(recipe.bandwidth))

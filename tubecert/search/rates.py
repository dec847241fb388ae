"""Search of certificate A: the smallest bandwidth of (26a), (26b), its rate, the least Gamma, the curve.

With the paper's kernel each bandwidth condition is c1/|2 lambda - omega| + c2/omega <= R: a ray and
possibly a window below 2 lambda, in closed form. With the tight kernel the left-hand sides fall with omega:
one half-line. Implements: theory section 3, "Closed form".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance as theorem_b
from tubecert.conditions import rates as theorem_a
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import next_up, round_up
from tubecert.conditions.derived import zetas
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked, RateProposal
from tubecert.conditions.rates import RateRecipe, theta
from tubecert.search import distance
from tubecert.search.bandwidths import Bandwidth, RateSearch, bandwidths, bandwidths_around
from tubecert.search.scan import minimum_log, serves, smallest

DIGITS = 4
CURVE_POINTS = 25
SHARE_LEFT = 0.01  # of (26b) that the pair leaves where (26b) binds
_SLACK = 1e-12


@quiet
def needed_rate(s: RateSearch, omega: Array, g: Array | None) -> Array:
    """The Gamma of (26c), infinite where (26b) leaves nothing."""
    z = zetas(s.problem, s.n, s.terms, omega)
    rest = s.n.a - z.zeta2 - z.zeta3
    value = (theta(s.problem, s.n, s.terms, omega, g) / (s.n.rho_a * rest)) ** 2
    return np.where(rest > 0, value, np.inf)


@quiet
def best_gain(s: RateSearch, omega: Array) -> Array:
    """The g of A_m = -g I with the smallest Deta; never below a thousandth of the bandwidth."""
    r = s.terms.s1 / s.terms.hs
    k = s.n.DBpx * s.terms.speed / s.n.DBp + s.problem.filter_factor * omega
    return np.fmax((np.sqrt(r * (r + 8.0 * k)) - r) / 4.0, 1e-3 * omega)


def printed_gain(s: RateSearch, omega: Fraction) -> Fraction | None:
    """The predictor gain at a printed bandwidth: the one given, or the best one to 4 digits."""
    if s.problem.A_m is not None:
        return s.problem.predictor_gain
    return round_up(float(best_gain(s, np.asarray(float(omega)))), DIGITS)


def gains_along(s: RateSearch, omega: Array) -> Array | None:
    """The predictor gains of a search along omega."""
    if s.problem.A_m is None:
        return best_gain(s, omega)
    g = s.problem.predictor_gain
    return None if g is None else np.full_like(omega, float(g))


def recipe_at(s: RateSearch, omega: Fraction, Gamma: Fraction | None = None) -> RateRecipe | None:
    """The recipe at a printed bandwidth, with the least Gamma if none is given; None if there is none."""
    g = printed_gain(s, omega)
    if Gamma is None:
        gain = None if g is None else np.array([float(g)])
        needed = float(needed_rate(s, np.array([float(omega)]), gain)[0])
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


def recipe_from(s: RateSearch, found: Bandwidth) -> RateRecipe | None:
    """The recipe at the first printed bandwidth that serves; more digits only if 4 overshoot the window."""
    for digits in (DIGITS, 5, 6, 8, 12):
        w = round_up(found.low * (1 + _SLACK), digits)
        if float(w) <= found.high and (recipe := _serving(s.problem, recipe_at(s, w))) is not None:
            return recipe
    return None


def least_recipe(s: RateSearch, found: Sequence[Bandwidth]) -> RateRecipe | None:
    """The recipe of least Gamma over the whole feasible set."""
    best: RateRecipe | None = None
    for part in found:
        high = min(part.high, 1e6 * part.low)
        omega = minimum_log(lambda w: needed_rate(s, w, gains_along(s, w)), part.low, high)
        recipe = recipe_from(s, Bandwidth(low=omega, high=part.high, binds=part.binds))
        if recipe and (best is None or recipe.adaptation_rate < best.adaptation_rate):
            best = recipe
    return best


def curve(s: RateSearch, low: float) -> tuple[RateRecipe, ...]:
    """Gamma(omega) at printed bandwidths."""
    candidates = (recipe_at(s, round_up(w, DIGITS)) for w in np.geomspace(low, 20 * low, CURVE_POINTS))
    return tuple(recipe for recipe in candidates if recipe is not None)


def _asked_recipe(
    s: RateSearch, bandwidth: Fraction | None, Gamma: Fraction | None, found: Sequence[Bandwidth]
) -> RateRecipe | None:
    """The recipe for gains asked for; what is not asked for is chosen as small as possible."""
    if bandwidth is not None:
        return recipe_at(s, bandwidth, Gamma)
    assert Gamma is not None
    best: tuple[float, float] = (np.inf, np.inf)
    for part in found:
        low, high = part.low, min(part.high, 1e6 * part.low)
        least = minimum_log(lambda w: needed_rate(s, w, gains_along(s, w)), low, high)

        def enough(w: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
            flat = w.ravel()
            return (needed_rate(s, flat, gains_along(s, flat)) <= float(Gamma)).reshape(w.shape)

        at = smallest(enough, low, least, 60)
        best = min(best, (0.0, at) if np.isfinite(at) else (1.0, least))
    return recipe_at(s, round_up(best[1] * (1 + _SLACK), DIGITS), Gamma) if np.isfinite(best[1]) else None


def propose_rates(problem: TubeProblem, asked: Asked) -> RateProposal[RateRecipe]:
    """The smallest bandwidth and its rate, or the gains asked for, with the pair of least Gamma and the curve."""
    if theorem_a.THEOREM.unbounded(problem):
        return RateProposal()
    s = RateSearch.of(problem)
    found = bandwidths(s, SHARE_LEFT)
    whole = bandwidths(s, 0.0)
    hopeless = None
    if asked.bandwidth is None and asked.adaptation_rate is None:
        recipe = recipe_from(s, found[0]) if found else None
    else:
        recipe = _asked_recipe(s, asked.bandwidth, asked.adaptation_rate, found)
        if recipe is None and asked.bandwidth is not None:
            # (26b) leaves nothing for any rate: the bandwidth alone is to be judged
            hopeless = recipe_at(s, asked.bandwidth, Fraction(10) ** 100)
    least = least_recipe(s, found)
    return RateProposal(
        decisive=recipe,
        role="pair",
        hopeless=hopeless,
        beside={} if least is None else {"least_adaptation": least},
        companion=_companion(problem, recipe) if recipe is not None and asked.curve else None,
        curve=curve(s, found[0].low) if found and asked.curve else (),
        around=_around(recipe) if recipe is not None and asked.curve else (),
        infimum=float(whole[0].low) if whole else None,
        binds=found[0].binds if found else None,
    )


def least_rates(problem: TubeProblem) -> RateRecipe | None:
    """The pair of least Gamma alone, as `propose_rates` has it beside the others."""
    if theorem_a.THEOREM.unbounded(problem):
        return None
    s = RateSearch.of(problem)
    return least_recipe(s, bandwidths(s, SHARE_LEFT))


def _companion(problem: TubeProblem, recipe: RateRecipe) -> DistanceRecipe | None:
    """A recipe of certificate B at the same gains: it tells the ultimate radius."""
    if theorem_b.THEOREM.unbounded(problem):
        return None
    return distance.recipe_at(problem, recipe.bandwidth, recipe.adaptation_rate, recipe.predictor_gain)


def _around(recipe: RateRecipe) -> tuple[RateRecipe, ...]:
    """The same rate and predictor at other bandwidths."""
    return tuple(replace(recipe, bandwidth=omega) for omega in bandwidths_around(recipe.bandwidth))

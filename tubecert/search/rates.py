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

from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import next_up, round_up
from tubecert.conditions.derived import rate_terms, zetas
from tubecert.conditions.distance import ultimate_radius
from tubecert.conditions.predictor import Matrix
from tubecert.conditions.problem import Certificate, TubeProblem
from tubecert.conditions.rates import Margins, RateRecipe, margins_26, margins_26_along, theta
from tubecert.conditions.verdict import NOTHING_FOUND, UNKNOWN, Shortfall, Verdict, unbounded, verdict
from tubecert.enclosure.interval import Interval
from tubecert.search.bandwidths import Bandwidth, RateSearch, bandwidths
from tubecert.search.distance import prove as prove_distance
from tubecert.search.results import Conditions26, RatePair
from tubecert.search.scan import minimum_log, smallest

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


def _proven(problem: TubeProblem, recipe: RateRecipe | None) -> RatePair | None:
    """The pair if its margins are proven; the rate may have to go up by one in its last digit."""
    if recipe is None:
        return None
    for Gamma in (recipe.adaptation_rate, next_up(recipe.adaptation_rate, DIGITS)):
        pair = judged(problem, replace(recipe, adaptation_rate=Gamma))
        if verdict(pair.margins.values()) is Verdict.CERTIFIED:
            return pair
    return None


def judged(problem: TubeProblem, recipe: RateRecipe) -> RatePair:
    """A pair of gains with its margins, and the ultimate radius that certificate B proves for it."""
    if problem.unbounded(Certificate.DISTANCE):
        return RatePair(recipe=recipe, margins=margins_26(problem, recipe))
    distance = prove_distance(problem, [recipe.bandwidth], [recipe.adaptation_rate], [recipe.predictor_gain])[
        0
    ]
    radius = ultimate_radius(problem, distance.recipe) if distance.margin.lo > 0 else None
    return RatePair(recipe=recipe, margins=margins_26(problem, recipe), ultimate_radius=radius)


def pair_from(s: RateSearch, found: Bandwidth) -> RatePair | None:
    """The pair at the first printed bandwidth that is proven; more digits only if 4 overshoot the window."""
    for digits in (DIGITS, 5, 6, 8, 12):
        w = round_up(found.low * (1 + _SLACK), digits)
        if float(w) <= found.high and (pair := _proven(s.problem, recipe_at(s, w))) is not None:
            return pair
    return None


def least_pair(s: RateSearch, found: Sequence[Bandwidth]) -> RatePair | None:
    """The pair of least Gamma over the whole feasible set."""
    best: RatePair | None = None
    for part in found:
        high = min(part.high, 1e6 * part.low)
        omega = minimum_log(lambda w: needed_rate(s, w, gains_along(s, w)), part.low, high)
        pair = pair_from(s, Bandwidth(low=omega, high=part.high, binds=part.binds))
        if pair and (best is None or pair.recipe.adaptation_rate < best.recipe.adaptation_rate):
            best = pair
    return best


def curve(s: RateSearch, low: float) -> tuple[RatePair, ...]:
    """Gamma(omega) at printed, proven pairs."""
    candidates = (recipe_at(s, round_up(w, DIGITS)) for w in np.geomspace(low, 20 * low, CURVE_POINTS))
    recipes = [recipe for recipe in candidates if recipe is not None]
    if not recipes:
        return ()
    margins = margins_26_along(s.problem, recipes)
    pairs = [
        RatePair(recipe=recipe, margins={claim: margin[i] for claim, margin in margins.items()})
        for i, recipe in enumerate(recipes)
    ]
    return tuple(pair for pair in pairs if verdict(pair.margins.values()) is Verdict.CERTIFIED)


def _predictor_matrix(problem: TubeProblem, g: Fraction | None) -> Matrix | None:
    """The A_m that the pair belongs to."""
    if problem.A_m is not None or g is None:
        return problem.A_m
    n = range(problem.states)
    return tuple(tuple(-g if i == j else Fraction(0) for j in n) for i in n)


def _no_bandwidth(s: RateSearch) -> tuple[Shortfall, ...]:
    """Why no bandwidth serves: rho_r^2 <= E0/a + zeta_p."""
    problem = s.problem
    margins = []
    for n in (problem.proven(), problem.enclosed()):
        terms = rate_terms(problem, n)
        margins.append(1.0 - (terms.E0 / n.a + terms.zeta_p) / n.rho_r**2)
    allowed = float(s.n.rho_r**2)
    return (
        Shortfall(
            claim="26a",
            margin=Interval(margins[0].lo, np.maximum(margins[0].lo, margins[1].hi)),
            allowed=allowed,
            needed=float(s.terms.E0 / s.n.a + s.terms.zeta_p),
        ),
    )


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

        def serves(w: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
            flat = w.ravel()
            return (needed_rate(s, flat, gains_along(s, flat)) <= float(Gamma)).reshape(w.shape)

        at = smallest(serves, low, least, 60)
        best = min(best, (0.0, at) if np.isfinite(at) else (1.0, least))
    return recipe_at(s, round_up(best[1] * (1 + _SLACK), DIGITS), Gamma) if np.isfinite(best[1]) else None


def _failing(margins: Margins) -> tuple[Shortfall, ...]:
    return tuple(Shortfall(claim=claim, margin=m) for claim, m in margins.items() if not m.lo > 0)


def _asked(
    s: RateSearch,
    result: Conditions26,
    bandwidth: Fraction | None,
    Gamma: Fraction | None,
    found: Sequence[Bandwidth],
) -> Conditions26:
    """The same result with the verdict on the gains asked for."""
    recipe = _asked_recipe(s, bandwidth, Gamma, found)
    if recipe is None and bandwidth is not None:
        # (26b) leaves nothing for any rate: judge the bandwidth alone
        recipe = recipe_at(s, bandwidth, Fraction(10) ** 100)
        margins = margins_26(s.problem, recipe) if recipe else {}
        refuted = any(margin.hi <= 0 for margin in margins.values())
        return replace(
            result,
            pair=None,
            verdict=Verdict.REFUTED if refuted else Verdict.UNDECIDED,
            shortfalls=_failing(margins),
        )
    if recipe is None:
        return replace(result, verdict=Verdict.UNDECIDED, shortfalls=NOTHING_FOUND)
    pair = judged(s.problem, recipe)
    return replace(
        result, pair=pair, verdict=verdict(pair.margins.values()), shortfalls=_failing(pair.margins)
    )


def search_26(
    problem: TubeProblem,
    *,
    bandwidth: Fraction | None = None,
    adaptation_rate: Fraction | None = None,
) -> Conditions26:
    """Certificate A: the smallest bandwidth and its rate, or the verdict on the gains asked for.

    `states` is n, the size of A_m in the result. With the paper's own formulas the verdict is undecided,
    whatever the numbers: they prove nothing.
    """
    endless = unbounded(problem.unbounded(Certificate.RATES))
    if endless:
        return Conditions26(verdict=Verdict.UNDECIDED, pair=None, A_m=problem.A_m, shortfalls=endless)
    s = RateSearch.of(problem)
    found = bandwidths(s, SHARE_LEFT)
    whole = bandwidths(s, 0.0)
    pair = pair_from(s, found[0]) if found else None
    result = Conditions26(
        verdict=Verdict.CERTIFIED if pair else Verdict.UNDECIDED,
        pair=pair,
        A_m=problem.A_m,
        least_adaptation=least_pair(s, found),
        curve=curve(s, found[0].low) if found else (),
        infimum=float(whole[0].low) if whole else None,
        binds=found[0].binds if found else None,
    )
    if bandwidth is not None or adaptation_rate is not None:
        result = _asked(s, result, bandwidth, adaptation_rate, found)
    elif not found:
        short = _no_bandwidth(s)
        result = replace(result, shortfalls=short, verdict=verdict(item.margin for item in short))
    elif pair is None:
        result = replace(result, shortfalls=NOTHING_FOUND)
    return _finished(problem, result)


def _finished(problem: TubeProblem, result: Conditions26) -> Conditions26:
    """A_m of the pair, the window it lies in, and the proviso of the printed formulas."""
    if result.pair is not None:
        recipe = result.pair.recipe
        result = replace(
            result,
            A_m=_predictor_matrix(problem, recipe.predictor_gain),
            below_twice_rate=recipe.bandwidth < 2 * problem.rate,
        )
    if problem.as_printed:
        proviso = Shortfall(claim="corrected_formulas", margin=UNKNOWN)
        result = replace(result, verdict=Verdict.UNDECIDED, shortfalls=(proviso, *result.shortfalls))
    return result

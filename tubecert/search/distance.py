"""Search of certificate B: the split pair, the pair of least Gamma, the curve Gamma(omega), gains asked for.

For given (omega, e) the least Y is closed; sup D rises with e, so the largest admissible e is a boundary,
and Gamma = (Deta/e)^2. Implements: theory section 4, "Search and proof".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import distance as theorem_b
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.conditions.wind import felt, is_felt, pushed, taken
from tubecert.enclosure.constant import next_up, round_up
from tubecert.kernel import obstacles
from tubecert.search.bandwidths import bandwidths_around
from tubecert.search.scan import boundary, minimum_lanes, minimum_log, serves, smallest

DIGITS = 4
CURVE_POINTS = 25
_SLACK = 1e-12  # the search is in floats: stay this far inside
_ENDLESS = Fraction(10) ** 100  # an adaptation rate that leaves no estimation error
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

    def inside(e: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        Y = theorem_b.least_speed(n, omega, e)
        return theorem_b.distance_bound(n, omega, theorem_b.uncertainty(n, Y, omega), e).supremum() < reach(n)

    given = gain
    if given is None and problem.predictor_gain is not None:
        given = np.asarray(float(problem.predictor_gain))
    most = np.broadcast_to((reach(n) * n.lam - pushed(n)) / n.beta, omega.shape)
    zero = np.zeros_like(omega)
    feasible = (most > 0) & inside(zero)
    e_max = boundary(inside, zero, np.where(feasible, most, 0.0)) * (1 - _SLACK)

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

    def inside(omega: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        zero = np.zeros_like(omega)
        S = theorem_b.uncertainty(n, theorem_b.least_speed(n, omega, zero), omega)
        return theorem_b.distance_bound(n, omega, S, zero).supremum() < distance

    return smallest(inside, float(n.lam) * _LOWEST, float(n.lam) * _HIGHEST)


@quiet
def recipes_at(
    problem: TubeProblem,
    bandwidths: Sequence[Fraction],
    rates: Sequence[Fraction],
    gains: Sequence[Fraction],
    inflation: float = 1e-9,
) -> list[DistanceRecipe]:
    """Recipes at given gains: the least fixed point Y, e, S in floats, inflated, as decimals."""
    R_H = problem.projection_radius
    n = problem.floats(R_H)
    omega, Gamma = (np.array([float(x) for x in xs]) for xs in (bandwidths, rates))
    g = np.array([float(own) for own in gains])
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
            bandwidth=bandwidths[i],
            adaptation_rate=rates[i],
            predictor_gain=gains[i],
            projection_radius=R_H,
            speed=round_up(float(Y[i]), 13),
            prediction_error=round_up(float(e[i]), 13),
            uncertainty=round_up(float(S[i]), 13),
        )
        for i in range(len(bandwidths))
    ]


def recipes_served(
    problem: TubeProblem,
    bandwidths: Sequence[Fraction],
    rates: Sequence[Fraction],
    gains: Sequence[Fraction],
) -> list[DistanceRecipe]:
    """The best recipes found at given pairs of gains; where they serve at all, their inequalities have room."""
    for inflation in (1e-9, 1e-6, 1e-3):
        recipes = recipes_at(problem, bandwidths, rates, gains, inflation)
        margin = theorem_b.margin_distance_along(problem, recipes)
        if np.all(margin.lo > -np.inf):
            break
    return recipes


def recipe_at(problem: TubeProblem, omega: Fraction, Gamma: Fraction, g: Fraction) -> DistanceRecipe:
    """The best recipe found at one pair of gains."""
    return recipes_served(problem, [omega], [Gamma], [g])[0]


def printed_gain(problem: TubeProblem, n: Numbers[Array], omega: Fraction, e: float) -> Fraction:
    """The predictor gain at a printed bandwidth: the one given, or the best one to 4 digits."""
    if problem.predictor_gain is not None:
        return problem.predictor_gain
    w = np.asarray(float(omega))
    g = float(best_gain(n, w, theorem_b.least_speed(n, w, np.asarray(e))))
    return omega if g <= float(omega) else round_up(g, DIGITS)


def printed_rates(
    problem: TubeProblem, bandwidths: Sequence[Fraction]
) -> list[tuple[Fraction, Fraction, Fraction]]:
    """(omega, Gamma, g) at printed bandwidths: g first, then Gamma for the printed g, rounded up."""
    n = problem.floats(problem.projection_radius)
    omega = np.array([float(w) for w in bandwidths])
    e = least_rate(problem, n, omega)[1]
    gains = [printed_gain(problem, n, w, float(e[i])) for i, w in enumerate(bandwidths)]
    Gamma = least_rate(problem, n, omega, np.array([float(g) for g in gains]))[0]
    return [
        (w, round_up(max(float(G) * (1 + _SLACK), 1e-12), DIGITS), g)
        for w, G, g in zip(bandwidths, Gamma, gains, strict=True)
        if np.isfinite(G)
    ]


def least_at(problem: TubeProblem, omega: Fraction) -> DistanceRecipe | None:
    """The recipe of least Gamma at a printed bandwidth, or None if no Gamma serves there."""
    for w, Gamma, g in printed_rates(problem, [omega]):
        # more than the least rate is needed only where rounding decides
        for rate in (
            Gamma,
            next_up(Gamma, DIGITS),
            *(round_up(x * float(Gamma), DIGITS) for x in (1.01, 2.0)),
        ):
            recipe = recipe_at(problem, w, rate, g)
            if serves(problem, recipe):
                return recipe
    return None


def recipe_from(problem: TubeProblem, omega: float) -> DistanceRecipe | None:
    """The recipe at the first printed bandwidth that serves; more digits only where 4 do not."""
    if not np.isfinite(omega):
        return None
    for digits in (DIGITS, 5, 6, 8, 12):
        if (recipe := least_at(problem, round_up(omega * (1 + _SLACK), digits))) is not None:
            return recipe
    return None


def _curve(problem: TubeProblem, low: float) -> tuple[DistanceRecipe, ...]:
    bandwidths = [round_up(w, DIGITS) for w in np.geomspace(1.02 * low, 20 * low, CURVE_POINTS)]
    points = printed_rates(problem, bandwidths)
    if not points:
        return ()
    return tuple(recipes_served(problem, *map(list, zip(*points, strict=True))))


def _asked(problem: TubeProblem, asked: Asked) -> DistanceRecipe | None:
    """The recipe at gains asked for; what is not asked for is chosen as small as possible."""
    n = problem.floats(problem.projection_radius)
    bandwidth, rate = asked.bandwidth, asked.adaptation_rate
    if bandwidth is None and rate is not None:
        low = smallest_bandwidth(n, reach(n))
        if not np.isfinite(low):
            return None
        best = minimum_log(lambda w: least_rate(problem, n, w)[0], low, 1e4 * low)

        def enough(w: Array) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
            return (least_rate(problem, n, w.ravel())[0] <= float(rate)).reshape(w.shape)

        at = smallest(enough, low, best, 60)
        bandwidth = round_up((at if np.isfinite(at) else best) * (1 + _SLACK), DIGITS)
    if bandwidth is None:
        return None
    if rate is None:
        return least_at(problem, bandwidth)
    e = least_rate(problem, n, np.array([float(bandwidth)]))[1]
    return recipe_at(problem, bandwidth, rate, printed_gain(problem, n, bandwidth, float(e[0])))


def propose_distance(problem: TubeProblem, asked: Asked) -> Proposal[DistanceRecipe]:
    """The pairs of least bandwidth and of least Gamma, the curve, and the gains asked for, which then decide."""
    if obstacles(problem, theorem_b.THEOREM):
        return Proposal()
    n = problem.floats(problem.projection_radius)
    low = smallest_bandwidth(n, reach(n))
    least = recipe_from(problem, _best(problem, n, low))
    split = recipe_from(problem, smallest_bandwidth(n, np.sqrt(n.a) * n.rho_r))
    if least is not None and split is not None and least.bandwidth < split.bandwidth:
        split = least  # much is left to rho_a: the pair of least Gamma has the smaller bandwidth as well
    found = {"least_adaptation": least, "split": split}
    roles = {role: recipe for role, recipe in found.items() if recipe is not None}
    curve = _curve(problem, low) if asked.curve and np.isfinite(low) else ()
    whole = Proposal(beside=roles, curve=curve)
    if asked.bandwidth is None and asked.adaptation_rate is None:
        role = next(iter(roles), "")
        decisive = roles.pop(role, None)
        around = _around(problem, decisive) if asked.curve else ()
        return replace(whole, decisive=decisive, role=role, around=around)
    decisive = _asked(problem, asked)
    if decisive is not None:
        return replace(whole, decisive=decisive, role="asked", around=_around(problem, decisive))
    if asked.bandwidth is None:
        return whole
    g = problem.predictor_gain or asked.bandwidth
    return replace(whole, hopeless=recipe_at(problem, asked.bandwidth, _ENDLESS, g))


def least_distance(problem: TubeProblem) -> DistanceRecipe | None:
    """The pair of least Gamma alone, as `propose_distance` has it beside the others."""
    if obstacles(problem, theorem_b.THEOREM):
        return None
    n = problem.floats(problem.projection_radius)
    return recipe_from(problem, _best(problem, n, smallest_bandwidth(n, reach(n))))


def _best(problem: TubeProblem, n: Numbers[Array], low: float) -> float:
    """The bandwidth of least Gamma above the smallest that serves; infinite if none does."""
    return minimum_log(lambda w: least_rate(problem, n, w)[0], low, 1e4 * low) if np.isfinite(low) else np.inf


def _around(problem: TubeProblem, recipe: DistanceRecipe | None) -> tuple[DistanceRecipe, ...]:
    """The same rate and predictor at other bandwidths."""
    if recipe is None:
        return ()
    omegas = bandwidths_around(recipe.bandwidth)
    rates, gains = [recipe.adaptation_rate] * len(omegas), [recipe.predictor_gain] * len(omegas)
    return tuple(recipes_served(problem, omegas, rates, gains))

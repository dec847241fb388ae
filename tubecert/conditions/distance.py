"""Certificate B: the Riemannian distance d(x*, x) bounded directly. Trusted.

THEOREM B. If Y > phi + DB[du dbar + min((1+r_H) Dh, max(H0, S) + e)] with S >= (Dht + Dhx Y)/omega and e >=
Deta(omega, g, Y)/sqrt(Gamma), then dbar = sqrt(a) rho > sup D implies |x - x*| < rho over the horizon. A
proof is a recipe, a tuple of decimals for which these inequalities are verified; a recipe that fails
refutes nothing but itself. What refutes gains is `distance_ceiling`: every Y that serves is at least the
least fixed point, whatever the constants are within their enclosures. Implements: theory section 4.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from tubecert.conditions.arithmetic import (
    Array,
    T,
    absolute,
    least_solution,
    maximum,
    minimum,
    quiet,
    sqrt,
    vector,
)
from tubecert.conditions.inputs import InputShares, shares
from tubecert.conditions.kernels import DistanceBound
from tubecert.conditions.obstacles import obstacles, reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import LoopGains, Theorem
from tubecert.conditions.wind import (
    drifting,
    felt,
    is_felt,
    prediction,
    prediction_error,
    provisos,
    pushed,
    taken,
)
from tubecert.enclosure.interval import Interval

_RISES = 200  # iterations towards the least fixed point from below; any number of them is sound


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceRecipe(LoopGains):
    """The proof of theorem B at printed gains: `speed` is Y, `prediction_error` e, `uncertainty` S."""

    speed: Fraction
    prediction_error: Fraction
    uncertainty: Fraction


@quiet
def drift_bound(n: Numbers[T]) -> T:
    """What |xdot| is at most without the uncertainty: phi + DB du dbar, two terms of (4.3)."""
    return drifting(n) + n.DB * (n.du * reach(n))


@quiet
def speed_needed(n: Numbers[T], S: T, e: T) -> T:
    """What Y has to exceed: phi + DB[du dbar + min((1+r_H) Dh, max(H0, S) + e)], (4.3)."""
    return drift_bound(n) + n.DB * minimum(n.Dh + n.R, maximum(n.H0, S) + e)


@quiet
def least_speed(n: Numbers[T], omega: T, e: T) -> T:
    """The least Y for S = (Dht + Dhx Y)/omega and a given e, in closed form: (4.1) and (4.3) solved for Y."""
    drift = drift_bound(n)
    crude = drift + n.DB * (n.Dh + n.R)
    settled = least_solution(drift + n.DB * (e + n.Dht / omega), n.DB * n.Dhx / omega)
    return minimum(crude, maximum(drift + n.DB * (n.H0 + e), settled))


@quiet
def uncertainty(n: Numbers[T], Y: T, omega: T) -> T:
    """What the filter leaves of h: S = (Dht + Dhx Y)/omega, (4.1)."""
    return (n.Dht + n.Dhx * Y) / omega


@quiet
def filter_error(n: Numbers[T], Y: T, omega: T, g: T) -> T:
    """Deta of certificate B: (DBpx Y + DBp (omega + |A_m + omega I|)) Dxt with A_m = -g I, (2.12)."""
    return estimation_gain(n, Y, omega, g) * prediction_error(n.Dh + n.R, n.Dht + n.Dhx * Y, g)


@quiet
def estimation_gain(n: Numbers[T], Y: T, omega: T, g: T) -> T:
    """What an estimate is off per |xt|: DBpx Y + DBp (omega + |omega - g|), (2.12)."""
    return n.DBpx * Y + n.DBp * (omega + absolute(omega - g))


@quiet
def error_needed(n: Numbers[T], Y: T, omega: T, g: T, Gamma: T) -> T:
    """What e has to be at least: Deta/sqrt(Gamma), (4.2); with what is no input (7.9)."""
    if not is_felt(n):
        return filter_error(n, Y, omega, g) / sqrt(Gamma)
    xt = prediction(n, n.Dht + n.Dhx * Y, g, Gamma, felt(n))
    return estimation_gain(n, Y, omega, g) * xt + taken(n)


def distance_bound(n: Numbers[T], omega: T, S: T, e: T) -> DistanceBound[T]:
    """D(t) of theorem B, (2.15)."""
    return DistanceBound(
        d0=n.d0, beta=n.beta, H0=n.H0, S=S, e=e, delta=pushed(n), lam=n.lam, omega=omega, horizon=n.horizon
    )


@quiet
def margin_distance_along(problem: TubeProblem, recipes: Sequence[DistanceRecipe]) -> Interval:
    """Margins of many recipes at once, shape `(len(recipes),)`; recipes share the projection radius."""
    R_H = recipes[0].projection_radius
    serves = all(r.projection_radius == R_H for r in recipes) and problem.radius_serves(R_H)
    omega, Gamma = vector([r.bandwidth for r in recipes]), vector([r.adaptation_rate for r in recipes])
    Y, e, S = (
        vector([getattr(r, name) for r in recipes]) for name in ("speed", "prediction_error", "uncertainty")
    )
    g = vector([r.predictor_gain for r in recipes])
    n = problem.proven(R_H)
    filtered = uncertainty(n, Y, omega).hi <= S.lo  # (4.1)
    if is_felt(n):
        predicted = error_needed(n, Y, omega, g, Gamma).hi <= e.lo  # (7.9)
    else:
        predicted = filter_error(n, Y, omega, g).hi <= (e * sqrt(Gamma)).lo  # (4.2)
    fast = speed_needed(n, S, e).hi < Y.lo  # (4.3)
    low, high = _margin(n, omega, S, e).lo, _margin(problem.enclosed(R_H), omega, S, e).hi
    return Interval(np.where(serves & filtered & predicted & fast, low, -np.inf), np.maximum(low, high))


def _margin(n: Numbers[Interval], omega: Interval, S: Interval, e: Interval) -> Interval:
    """1 - sup D/dbar, (4.4)."""
    return (1 - distance_bound(n, omega, S, e).supremum() / reach(n)).sanitised()


@quiet
def distance_ceiling(problem: TubeProblem, recipe: DistanceRecipe) -> float:
    """An upper bound of the margin that any Y, e, S can prove at the recipe's gains; <= 0 refutes the gains.

    Y is replaced by a lower bound of the least fixed point, approached from below; sup D rises with e and S,
    they with Y. The bound holds for all constants within their enclosures.
    Theory 4.2.
    """
    n = problem.enclosed(recipe.projection_radius)
    omega, Gamma = Interval.of(recipe.bandwidth), Interval.of(recipe.adaptation_rate)
    g = Interval.of(recipe.predictor_gain)

    def errors(Y: Interval) -> tuple[Interval, Interval]:
        S = uncertainty(n, Y, omega).sanitised()
        e = error_needed(n, Y, omega, g, Gamma).sanitised()
        return Interval.exact(np.maximum(S.lo, 0.0)), Interval.exact(np.maximum(e.lo, 0.0))

    Y = least_from_below(lambda Y: speed_needed(n, *errors(Y)))
    S, e = errors(Y)
    return float(_margin(n, omega, S, e).hi)


def least_from_below(needed: Callable[[Interval], Interval]) -> Interval:
    """A lower bound of every Y >= needed(Y), for a nondecreasing `needed`: iterates from 0, rounded down.

    Theory 4.2.
    """
    Y = Interval.exact(0.0)
    for _ in range(_RISES):
        raised: Array = np.maximum(Y.lo, needed(Y).sanitised().lo)
        if raised <= Y.lo * (1 + 1e-13):
            break
        Y = Interval.exact(raised)
    return Y


def _proven(
    problem: TubeProblem, recipe: DistanceRecipe
) -> tuple[Numbers[Interval], DistanceBound[Interval]]:
    """D(t) of a recipe that is proven, with the numbers on their safe side."""
    n = problem.proven(recipe.projection_radius)
    S, e = Interval.of(recipe.uncertainty), Interval.of(recipe.prediction_error)
    return n, distance_bound(n, Interval.of(recipe.bandwidth), S, e)


def ultimate_radius(problem: TubeProblem, recipe: DistanceRecipe) -> float | None:
    """A1/sqrt(a): |x - x*| is at most this in the long run, proven, theory 4.3."""
    n, bound = _proven(problem, recipe)
    return float((bound.ultimate() / sqrt(n.a)).hi)


def input_shares(problem: TubeProblem, recipe: DistanceRecipe) -> InputShares | None:
    """|k| <= du sup D, |u_a| <= R_H, (4.13)."""
    n, bound = _proven(problem, recipe)
    return shares(n, bound.supremum(), recipe.projection_radius)


def _at_once(problem: TubeProblem, n: Numbers[Array]) -> object:
    """Everything that theorem B compares, at some gains."""
    one = np.asarray(1.0)
    S = uncertainty(n, least_speed(n, one, one), one)
    return filter_error(n, one, one, one), distance_bound(n, one, S, one).supremum() < reach(n)


THEOREM = Theorem(
    recipe=DistanceRecipe,
    margins=lambda problem, recipes: {"distance": margin_distance_along(problem, recipes)},
    ceilings=lambda problem, recipe: {"distance": distance_ceiling(problem, recipe)},
    formula=_at_once,
    obstacles=obstacles,
    provisos=provisos,
    ultimate=ultimate_radius,
    inputs=input_shares,
)

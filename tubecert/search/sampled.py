"""Search of certificate C: the largest sample time with omega = 1/Ts, the limit, the curve Ts(omega).

Round first, then verify the printed (omega, Ts, g): the theorem is not monotone in omega by proof.
Implements: theory section 4b.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.conditions import sampled as theorem_c
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.obstacles import reach
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.proposal import Asked, SampledProposal
from tubecert.conditions.sampled import SampledRecipe
from tubecert.kernel import obstacles
from tubecert.search.scan import largest
from tubecert.search.scan import serves as all_positive

DIGITS = 4
CURVE_POINTS = 25
_SLACK = 1e-12
_SHORTEST, _LONGEST = 1e-9, 1e2  # sample times considered, in units of 1/rate
_FAST = 1e9  # omega Ts that stands for omega without bound

Mask = np.ndarray[tuple[int, ...], np.dtype[np.bool_]]


@quiet
def serves(n: Numbers[Array], Ts: Array, omega: Array, g: Array) -> Mask:
    """Whether theorem C holds at these gains, in floats."""
    age = theorem_c.ages(Ts, omega, g)
    return theorem_c.sampled_supremum(n, Ts, omega, age, theorem_c.least_speed(n, Ts, age)) < reach(n)


def longest(n: Numbers[Array], omega: Array | None, g: Array | None) -> Array:
    """The largest Ts per lane at given bandwidths; None means omega = 1/Ts, or g = omega."""

    def test(Ts: Array) -> Mask:
        w = 1.0 / Ts if omega is None else np.broadcast_to(omega, Ts.shape)
        return serves(n, Ts, w, w if g is None else g)

    lanes = 1 if omega is None else omega.shape[0]
    rate = float(n.lam)
    return largest(test, np.full(lanes, _SHORTEST / rate), np.full(lanes, _LONGEST / rate))


def limit(n: Numbers[Array], g: float) -> float:
    """The largest Ts as omega grows without bound at a fixed predictor gain; not attained."""
    rate = float(n.lam)
    gain = np.asarray(g)
    ends = np.array([_SHORTEST / rate]), np.array([_LONGEST / rate])
    return float(largest(lambda Ts: serves(n, Ts, _FAST / Ts, gain), *ends)[0])


def recipes_at(
    problem: TubeProblem, gains: Sequence[tuple[Fraction, Fraction, Fraction]], inflation: float = 1e-9
) -> list[SampledRecipe]:
    """Recipes at printed (Ts, omega, g): the least Y in floats, inflated, as a decimal."""
    R_H = problem.clipping_radius
    n = problem.floats(R_H)
    Ts, omega, g = (np.array([float(x[i]) for x in gains]) for i in range(3))
    Y = theorem_c.least_speed(n, Ts, theorem_c.ages(Ts, omega, g)) * (1 + inflation)
    return [
        SampledRecipe(
            sample_time=item[0],
            bandwidth=item[1],
            predictor_gain=item[2],
            projection_radius=R_H,
            speed=round_up(float(Y[i]), 13),
        )
        for i, item in enumerate(gains)
    ]


def recipes_served(
    problem: TubeProblem, gains: Sequence[tuple[Fraction, Fraction, Fraction]]
) -> list[SampledRecipe]:
    """The best recipes found at (Ts, omega, g); where they serve at all, their inequalities have room."""
    for inflation in (1e-9, 1e-6, 1e-3):
        recipes = recipes_at(problem, gains, inflation)
        margin = theorem_c.margin_sampled_along(problem, recipes)
        if np.all(margin.lo > -np.inf):
            break
    return recipes


def recipe_at(problem: TubeProblem, Ts: Fraction, omega: Fraction, g: Fraction) -> SampledRecipe:
    """The best recipe found at one sample time."""
    return recipes_served(problem, [(Ts, omega, g)])[0]


def _longest(problem: TubeProblem, n: Numbers[Array], bandwidth: Fraction | None) -> SampledRecipe | None:
    """The largest printed sample time that serves, at the bandwidth given or at omega = 1/Ts."""
    g = problem.predictor_gain
    gain = None if g is None else np.asarray(float(g))
    omega = None if bandwidth is None else np.array([float(bandwidth)])
    found = float(longest(n, omega, gain)[0])
    if not found > 0:
        return None
    for attempt in range(4):
        Ts = round_down(found * (1 - _SLACK) * (1 - attempt * 2e-4), DIGITS)
        w = round_up(1 / Ts, DIGITS) if bandwidth is None else bandwidth
        recipe = recipe_at(problem, Ts, w, w if g is None else g)
        if all_positive(problem, recipe):
            return recipe
    return None


def _curve(problem: TubeProblem, n: Numbers[Array], center: float, g: Fraction) -> tuple[SampledRecipe, ...]:
    """Ts(omega) at printed triples, all at the predictor gain of the pair."""
    bandwidths = [round_up(w, DIGITS) for w in np.geomspace(center / 4, 64 * center, CURVE_POINTS)]
    Ts = longest(n, np.array([float(w) for w in bandwidths]), np.asarray(float(g)))
    gains = [
        (round_down(float(T) * (1 - _SLACK), DIGITS), w, g)
        for T, w in zip(Ts, bandwidths, strict=True)
        if T > 0
    ]
    return tuple(recipes_served(problem, gains)) if gains else ()


def propose_sampled(problem: TubeProblem, asked: Asked) -> SampledProposal[SampledRecipe]:
    """The largest sample time (at a bandwidth asked for), or the one asked for."""
    if obstacles(problem, theorem_c.THEOREM):
        return SampledProposal()
    n = problem.floats(problem.clipping_radius)
    if asked.sample_time is not None:
        w = asked.bandwidth if asked.bandwidth is not None else round_up(1 / asked.sample_time, DIGITS)
        recipe: SampledRecipe | None = recipe_at(problem, asked.sample_time, w, problem.predictor_gain or w)
    else:
        recipe = _longest(problem, n, asked.bandwidth)
    if recipe is not None:
        g = recipe.predictor_gain
        if not asked.curve:
            return SampledProposal(decisive=recipe, role="pair")
        most = limit(n, float(g))
        return SampledProposal(
            decisive=recipe,
            role="pair",
            limit=float(round_down(most, DIGITS)) if most > 0 else None,
            curve=_curve(problem, n, float(recipe.bandwidth), g),
        )
    if asked.bandwidth is None:
        return SampledProposal()
    # no sample time serves at this bandwidth: a very short one decides
    short = round_down(_SHORTEST / float(problem.rate), DIGITS)
    return SampledProposal(
        hopeless=recipe_at(problem, short, asked.bandwidth, problem.predictor_gain or asked.bandwidth)
    )

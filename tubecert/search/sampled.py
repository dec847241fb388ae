"""Search of certificate C: the largest sample time with omega = 1/Ts, the limit, the curve Ts(omega).

Round first, then verify the printed (omega, Ts, g): the theorem is not monotone in omega by proof.
Implements: theory section 4b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.conditions import sampled as theorem_c
from tubecert.conditions.arithmetic import Array, quiet
from tubecert.conditions.decimals import round_down, round_up
from tubecert.conditions.distance import reach
from tubecert.conditions.problem import Certificate, Numbers, TubeProblem
from tubecert.conditions.sampled import SampledRecipe
from tubecert.conditions.verdict import NOTHING_FOUND, Shortfall, Verdict, unbounded, verdict
from tubecert.enclosure.interval import Interval
from tubecert.search.obstacles import obstacles
from tubecert.search.results import SampledPair, SampledResult
from tubecert.search.scan import largest

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


def prove(problem: TubeProblem, gains: Sequence[tuple[Fraction, Fraction, Fraction]]) -> list[SampledPair]:
    """The best recipe found at each (Ts, omega, g), with its margin (-inf below if no recipe is valid)."""
    for inflation in (1e-9, 1e-6, 1e-3):
        recipes = recipes_at(problem, gains, inflation)
        margin = theorem_c.margin_sampled_along(problem, recipes)
        if np.all(margin.lo > -np.inf):
            break
    return [SampledPair(recipe=recipe, margin=margin[i]) for i, recipe in enumerate(recipes)]


def judged(problem: TubeProblem, Ts: Fraction, omega: Fraction, g: Fraction) -> SampledPair:
    """One sample time: margin proven below by a recipe and bounded above for every recipe."""
    pair = prove(problem, [(Ts, omega, g)])[0]
    ceiling = max(theorem_c.sampled_ceiling(problem, pair.recipe), float(pair.margin.lo))
    radius = theorem_c.ultimate_radius(problem, pair.recipe) if pair.margin.lo > 0 else None
    return replace(pair, margin=Interval(pair.margin.lo, np.asarray(ceiling)), ultimate_radius=radius)


def _pair(problem: TubeProblem, n: Numbers[Array], bandwidth: Fraction | None) -> SampledPair | None:
    """The largest printed sample time that is proven, at the bandwidth given or at omega = 1/Ts."""
    g = problem.predictor_gain
    gain = None if g is None else np.asarray(float(g))
    omega = None if bandwidth is None else np.array([float(bandwidth)])
    found = float(longest(n, omega, gain)[0])
    if not found > 0:
        return None
    for attempt in range(4):
        Ts = round_down(found * (1 - _SLACK) * (1 - attempt * 2e-4), DIGITS)
        w = round_up(1 / Ts, DIGITS) if bandwidth is None else bandwidth
        pair = judged(problem, Ts, w, w if g is None else g)
        if pair.margin.lo > 0:
            return pair
    return None


def _curve(problem: TubeProblem, n: Numbers[Array], center: float, g: Fraction) -> tuple[SampledPair, ...]:
    """Ts(omega) at printed, proven triples, all at the predictor gain of the pair."""
    bandwidths = [round_up(w, DIGITS) for w in np.geomspace(center / 4, 64 * center, CURVE_POINTS)]
    Ts = longest(n, np.array([float(w) for w in bandwidths]), np.asarray(float(g)))
    gains = [
        (round_down(float(T) * (1 - _SLACK), DIGITS), w, g)
        for T, w in zip(Ts, bandwidths, strict=True)
        if T > 0
    ]
    return tuple(pair for pair in prove(problem, gains) if pair.margin.lo > 0) if gains else ()


def search_sampled(
    problem: TubeProblem, *, bandwidth: Fraction | None = None, sample_time: Fraction | None = None
) -> SampledResult:
    """Certificate C: the largest proven sample time (at a bandwidth asked for), or the verdict on one."""
    blocked = unbounded(problem.unbounded(Certificate.SAMPLED)) or obstacles(problem)
    if blocked:
        return SampledResult(verdict=verdict(item.margin for item in blocked), shortfalls=blocked)
    n = problem.floats(problem.clipping_radius)
    if sample_time is not None:
        w = bandwidth if bandwidth is not None else round_up(1 / sample_time, DIGITS)
        asked = judged(problem, sample_time, w, problem.predictor_gain or w)
        return _decided(asked, n, problem)
    pair = _pair(problem, n, bandwidth)
    if pair is None and bandwidth is not None:
        # no sample time serves at this bandwidth: the ceiling for a very short one decides
        short = round_down(_SHORTEST / float(problem.rate), DIGITS)
        asked = judged(problem, short, bandwidth, problem.predictor_gain or bandwidth)
        missing = (Shortfall(claim="sampled", margin=asked.margin),)
        refuted = Verdict.REFUTED if asked.margin.hi <= 0 else Verdict.UNDECIDED
        return SampledResult(verdict=refuted, shortfalls=missing)
    if pair is None:
        return SampledResult(verdict=Verdict.UNDECIDED, shortfalls=NOTHING_FOUND)
    return _decided(pair, n, problem)


def _decided(pair: SampledPair, n: Numbers[Array], problem: TubeProblem) -> SampledResult:
    g = pair.recipe.predictor_gain
    most = limit(n, float(g))
    return SampledResult(
        verdict=verdict([pair.margin]),
        pair=pair,
        sample_time_limit=float(round_down(most, DIGITS)) if most > 0 else None,
        curve=_curve(problem, n, float(pair.recipe.bandwidth), g),
        shortfalls=() if pair.margin.lo > 0 else (Shortfall(claim="sampled", margin=pair.margin),),
    )

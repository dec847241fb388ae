"""Margins against the bandwidth, at the rate of the gains found: how far omega may move before something breaks.

In: a problem and a proven pair. Out: bandwidths around it and the proven side of each margin there, as data for
figures and for choosing a bandwidth. Every number is a proof of its own gains; the verdict does not rest on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.conditions.decimals import printed, round_up
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import margins_26_along
from tubecert.enclosure.constant import printable_below
from tubecert.search.distance import prove
from tubecert.search.results import DistancePair, Json, RatePair

_POINTS = 41
_BELOW, _ABOVE = 0.4, 6.0  # times the bandwidth of the pair
_DIGITS = 4


def margins_26_around(problem: TubeProblem, pair: RatePair) -> Json:
    """Margins of (26a), (26b), (26c) along the bandwidth, at the rate and the predictor of the pair."""
    recipes = [replace(pair.recipe, bandwidth=omega) for omega in _around(pair.recipe.bandwidth)]
    margins = margins_26_along(problem, recipes)
    below = {claim: _proven(margin.lo) for claim, margin in margins.items()}
    return {**_axis(pair, [recipe.bandwidth for recipe in recipes]), **below}


def margins_distance_around(problem: TubeProblem, pair: DistancePair) -> Json:
    """The margin of certificate B along the bandwidth, at the rate and the predictor of the pair."""
    omegas, recipe = _around(pair.recipe.bandwidth), pair.recipe
    count = len(omegas)
    pairs = prove(problem, omegas, [recipe.adaptation_rate] * count, [recipe.predictor_gain] * count)
    return {**_axis(pair, omegas), "margin": _proven(float(found.margin.lo) for found in pairs)}


def _around(omega: Fraction) -> list[Fraction]:
    """Printed bandwidths around the one of the pair, which is among them; ascending, without repetitions."""
    factors = np.geomspace(_BELOW, _ABOVE, _POINTS)
    return sorted({omega, *(round_up(float(omega) * float(factor), _DIGITS) for factor in factors)})


def _axis(pair: RatePair | DistancePair, omegas: Sequence[Fraction]) -> Json:
    gain = pair.recipe.predictor_gain
    return {
        "bandwidth": [printed(omega) for omega in omegas],
        "adaptation_rate": printed(pair.recipe.adaptation_rate),
        "predictor_gain": None if gain is None else printed(gain),
    }


def _proven(values: Iterable[float]) -> list[float | None]:
    """Bounds from below as they can be printed; null where nothing is proven."""
    return [printable_below(float(value)) if np.isfinite(value) else None for value in values]

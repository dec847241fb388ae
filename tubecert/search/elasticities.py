"""How strongly the least rates react to each constant: d log(Gamma_least)/d log(constant).

At a minimum over omega the derivative is the partial one at that omega (envelope theorem), so all constants
are perturbed in one vectorised evaluation. Numbers to explain a result, not part of any proof.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from tubecert.bounds.constants import TABLE, Constant
from tubecert.conditions.arithmetic import Array
from tubecert.conditions.problem import FIELDS, Numbers, TubeProblem
from tubecert.conditions.theorem import LoopGains
from tubecert.search.gains import GainSearch

_STEP = 1e-4


def elasticities(
    search: type[GainSearch[Any]], problem: TubeProblem, least: LoopGains | None
) -> dict[str, float]:
    """By constant, for gains of least Gamma; empty if there are none.

    Where (26a) fixes the bandwidth of certificate A's, the constants in (26a) act through it too: not counted.
    """
    if least is None:
        return {}
    n, lanes = _perturbed(problem)
    return _slopes(search(problem, n).needed(np.full(lanes, float(least.bandwidth))))


def _perturbed(problem: TubeProblem) -> tuple[Numbers[Array], int]:
    """Numbers with one lane per constant made larger and one made smaller; the radius goes with Dh."""
    n = problem.floats(problem.projection_radius)
    count = len(FIELDS)
    lanes = {name: np.full(2 * count, float(getattr(n, name))) for name in (*FIELDS, "R")}
    for i, name in enumerate(FIELDS):
        for moved in (name, "R") if name == "Dh" else (name,):
            lanes[moved][i] *= 1 + _STEP
            lanes[moved][count + i] *= 1 - _STEP
    return replace(n, **lanes), 2 * count


def _slopes(Gamma: Array) -> dict[str, float]:
    """Central differences in logarithms by constant; what does not act is left out."""
    logs = np.log(Gamma)
    count = len(FIELDS)
    slopes = (logs[:count] - logs[count:]) / (np.log1p(_STEP) - np.log1p(-_STEP))
    return {
        field: float(np.round(slope, 4))
        for field, slope in zip(FIELDS.values(), slopes, strict=True)
        if np.isfinite(slope) and abs(slope) > 5e-5
    }


def halving(
    problem: TubeProblem, slopes: Mapping[str, float], least: Callable[[TubeProblem], Fraction | None]
) -> dict[str, float]:
    """Gamma_least with a constant halved over Gamma_least, for the two constants to which it reacts most.

    Searched anew, not extrapolated. The metric and the actuators are left out: nobody can relax their size alone.
    """
    now = least(problem)
    named = sorted((-slope, name) for name, slope in slopes.items() if slope > 0 and not TABLE[name].given)
    factors = {}
    for _, name in named[:2]:
        value: Constant = getattr(problem.constants, name)
        changes = {name: Constant(below=value.below / 2, above=value.above / 2)}
        if name == "h":  # the start is one of the values that are halved
            start = problem.constants.h_initial
            changes["h_initial"] = Constant(below=start.below / 2, above=start.above / 2)
        then = least(replace(problem, constants=replace(problem.constants, **changes)))
        if now is not None and then is not None:
            factors[name] = float(then / now)
    return factors

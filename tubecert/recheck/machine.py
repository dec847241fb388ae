"""The constants that certificate H needs beside those of A, B and C, each as a claim over the tube or on the plan.

Written from their definitions (theory 8.2) in the coordinates z of the tube: how the feedback and the plan turn, how
the drift differs from that of the plan, what noise is (given in x), and what geodesics need.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.geodesics import SymbolsBelow
from tubecert.recheck.metric import stated
from tubecert.recheck.noise import noise_explained, noise_metric, noise_size
from tubecert.recheck.place import Place
from tubecert.recheck.relative import (
    Known,
    drift_difference,
    drift_difference_metric,
    drift_explained,
    drift_rate,
    drift_slope_metric,
)
from tubecert.recheck.specified.numbers import Numbers
from tubecert.recheck.turning import (
    feedback_curvature,
    feedback_drift,
    feedback_slope,
    input_rate,
    plan_speed,
    plan_tilt,
)

ALWAYS = (
    "feedback_slope",
    "feedback_curvature",
    "plan_tilt",
    "plan_speed",
    "drift_difference",
    "drift_explained",
    "noise_size",
    "noise_metric",
    "noise_explained",
    "symbols",
    "symbols_slope",
)
OF_CONSTANT_METRICS = ("drift_difference_metric", "drift_slope_metric")
OF_HELD_INPUTS = ("input_rate",)
OF_MOVING = ("feedback_drift", "drift_rate")
"""Those of an f that depends on t."""

NAMES = (*ALWAYS, *OF_CONSTANT_METRICS, *OF_HELD_INPUTS, *OF_MOVING)


def bounded(place: Place, name: str, limit: Fraction, noise: Numbers | None, known: Known) -> Outcome:
    """Whether the constant `name` is at most `limit`.

    One unit of noise is |n| <= 1 in x where `noise` is None, else |n_i| <= noise_i. `known` are upper bounds that the
    certificate states, and that are examined for themselves.
    """
    if limit < 0:
        return stated(False, "it is negative")
    if name in _OF_NOISE:
        return _OF_NOISE[name](place, limit, noise)
    if name in _OF_OTHERS:
        return _OF_OTHERS[name](place, limit, known)
    return _CLAIMS[name](place, limit)


def _symbols(place: Place, limit: Fraction, order: int) -> Outcome:
    """|Gamma| or |dGamma|, by the norms of unfoldings: a bound that is too large refutes nothing."""
    if place.system.flat:
        return stated(True, "")
    return prove(SymbolsBelow(place.fields, order, limit), place.tube(), place.budget)


_CLAIMS: dict[str, Callable[[Place, Fraction], Outcome]] = {
    "feedback_slope": feedback_slope,
    "feedback_curvature": feedback_curvature,
    "plan_tilt": plan_tilt,
    "plan_speed": plan_speed,
    "drift_difference": drift_difference,
    "drift_slope_metric": drift_slope_metric,
    "input_rate": input_rate,
    "feedback_drift": feedback_drift,
    "symbols": lambda place, limit: _symbols(place, limit, 0),
    "symbols_slope": lambda place, limit: _symbols(place, limit, 1),
}
_OF_OTHERS: dict[str, Callable[[Place, Fraction, Known], Outcome]] = {
    "drift_difference_metric": drift_difference_metric,
    "drift_explained": drift_explained,
    "drift_rate": drift_rate,
}
_OF_NOISE: dict[str, Callable[[Place, Fraction, Numbers | None], Outcome]] = {
    "noise_size": noise_size,
    "noise_metric": noise_metric,
    "noise_explained": noise_explained,
}

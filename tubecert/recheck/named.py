"""Any constant of a certificate by its name, over the tube of a place."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

from tubecert.recheck import constants, covariant, machine, unknown, wind
from tubecert.recheck.cover import Outcome
from tubecert.recheck.place import Place
from tubecert.recheck.specified.numbers import Numbers

_OF_TUBE = (
    "lower",
    "upper",
    "B",
    "B_x",
    "B_pinv",
    "B_pinv_x",
    "h",
    "h_x",
    "h_t",
    "u_star",
    "feedback_gain",
    "metric_input_gain",
    "drift_on_plan",
    "plan_defect",
    "plan_defect_metric",
)
_OF_ALL = ("noise_size", "symbols", "symbols_slope", "input_rate")
_OF_MACHINE = tuple(name for name in machine.NAMES if name not in _OF_ALL)

ALONG = (*_OF_TUBE, *wind.CONSTANTS, *unknown.CONSTANTS, *_OF_MACHINE, *covariant.NAMES)
"""Those that may be of a part of the plan."""

_ROUND_UP = Fraction(1001, 1000)


def bounded(
    place: Place, name: str, limit: Fraction, noise: Numbers | None, known: Callable[[str], Fraction | None]
) -> Outcome:
    """Whether a constant is at most `limit` (`lower`: at least) over the tube of a place.

    `known` are bounds of others in that place, which are examined for themselves.
    """
    if name in wind.CONSTANTS:
        beta, eps = known("metric_input_gain"), known("wind_explained")
        return wind.bounded(place, name, limit, None if beta is None or eps is None else beta * eps)
    if name in unknown.CONSTANTS:
        return unknown.bounded(place, name, limit)
    if name in machine.NAMES:
        return machine.bounded(place, name, limit, noise, known)
    if name in covariant.NAMES:
        return covariant.bounded(place, name, limit)
    return constants.bounded(place, name, limit, largest_push(known("B"), known("upper")))


def largest_push(B: Fraction | None, upper: Fraction | None) -> Fraction | None:
    """smax(Theta B) <= |B| sqrt(A); None where one of them is not bounded."""
    if B is None or upper is None:
        return None
    return Fraction(float(B) * float(upper) ** 0.5) * _ROUND_UP if upper > 0 else Fraction(0)

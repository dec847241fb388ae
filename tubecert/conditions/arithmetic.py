"""One formula, two arithmetics: the functions that the conditions need on floats and on intervals.

Every formula of this room is written once, over a type `T` that is either a float64 array (the search,
untrusted) or an `Interval` (the margins, trusted). A comparison that an interval cannot decide yields the
hull of both.
"""

from __future__ import annotations

from collections.abc import Callable
from contextvars import ContextVar
from fractions import Fraction
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure import interval as iv
from tubecert.enclosure.interval import Interval

Array = NDArray[np.float64]
T = TypeVar("T", Interval, Array)

_QUIET: ContextVar[bool] = ContextVar("quiet", default=False)
P = ParamSpec("P")
R = TypeVar("R")


def quiet(function: Callable[P, R]) -> Callable[P, R]:
    """Branches are evaluated before they are chosen: division by 0 in a branch not taken is not news.

    Formulas call each other: it is the outermost that silences numpy, which takes as long as ten additions.
    """

    @wraps(function)
    def silenced(*args: P.args, **options: P.kwargs) -> R:
        if _QUIET.get():
            return function(*args, **options)
        token = _QUIET.set(True)
        try:
            with np.errstate(all="ignore"):
                return function(*args, **options)
        finally:
            _QUIET.reset(token)

    return silenced


def number(value: Fraction | int, like: T) -> T:
    """An exact number in the arithmetic of `like`."""
    if isinstance(like, Interval):
        return Interval.of(value)
    return np.asarray(float(value))


def nothing(like: T) -> T:
    """-inf, the margin of what is not bounded."""
    return Interval.exact(-np.inf) if isinstance(like, Interval) else np.asarray(-np.inf)


def vector(values: list[Fraction]) -> Interval:
    """Exact numbers as one interval array, shape `(len(values),)`."""
    bounds = [iv.fraction_bounds(value) for value in values]
    return Interval(np.array([lo for lo, _ in bounds]), np.array([hi for _, hi in bounds]))


def sqrt(x: T) -> T:
    """Square root of a quantity known to be nonnegative (rounding below 0 is cut off)."""
    if isinstance(x, Interval):
        return iv.sqrt(Interval(np.where(x.lo < 0, 0.0, x.lo), x.hi))
    return np.sqrt(np.maximum(x, 0.0))


def exp(x: T) -> T:
    """Exponential."""
    return iv.exp(x) if isinstance(x, Interval) else np.exp(x)


def expm1(x: T) -> T:
    """exp(x) - 1."""
    return iv.expm1(x) if isinstance(x, Interval) else np.expm1(x)


def absolute(x: T) -> T:
    """|x|."""
    if isinstance(x, Interval):
        return Interval(x.mignitude, x.magnitude)
    return np.abs(x)


def maximum(x: T, y: T) -> T:
    """The larger of two."""
    if isinstance(x, Interval):
        return Interval(np.maximum(x.lo, y.lo), np.maximum(x.hi, y.hi))
    return np.maximum(x, y)


def minimum(x: T, y: T) -> T:
    """The smaller of two."""
    if isinstance(x, Interval):
        return Interval(np.minimum(x.lo, y.lo), np.minimum(x.hi, y.hi))
    return np.minimum(x, y)


def choose(test: T, positive: T, otherwise: T) -> T:
    """`positive` where test > 0, `otherwise` where test <= 0; the hull of both where that is undecided."""
    if isinstance(test, Interval):
        both = positive.hull(otherwise).sanitised()
        yes, no = test.lo > 0, test.hi <= 0
        return Interval(
            np.where(yes, positive.lo, np.where(no, otherwise.lo, both.lo)),
            np.where(yes, positive.hi, np.where(no, otherwise.hi, both.hi)),
        )
    return np.where(test > 0, positive, otherwise)


def confined(x: T, lowest: T, highest: T) -> T:
    """`x`, known to lie between two others: an interval is cut (or, if unknown, replaced) accordingly."""
    if isinstance(x, Interval):
        known = x.sanitised()
        return Interval(np.fmax(known.lo, lowest.lo), np.fmin(known.hi, highest.hi))
    return x


@quiet
def log1p_ratio(x: T) -> T:
    """log(1 + x)/x with value 1 at 0, decreasing on x > -1; unknown (interval) or NaN (float) at x <= -1.

    The r of (2.16).
    """
    if isinstance(x, Interval):
        return Interval(_ratio_at(x.hi).lo, _ratio_at(x.lo).hi).sanitised()
    small = np.abs(x) < 1e-5
    if not small.any():
        return np.asarray(np.log1p(x) / x)
    return np.where(small, 1 - x / 2 + x * x / 3, np.log1p(x) / np.where(small, 1.0, x))


def _ratio_at(x: Array) -> Interval:
    """The same at floats; near 0 from 1 - x/2 <= r(x) <= 1 - x/2 + x^2/2, which holds for |x| <= 1/3."""
    point = Interval.exact(x)
    return _near_one(x, iv.log1p(point) / point)


def _near_one(x: Array, quotient: Interval) -> Interval:
    """A quotient that is 1 at 0; near 0 by 1 - x/2 and 1 - x/2 + x^2/2."""
    near = np.abs(x) <= 1e-5
    if not near.any():
        return quotient
    point = Interval.exact(x)
    line = 1 - point / 2
    return Interval(
        np.where(near, line.lo, quotient.lo), np.where(near, (line + point**2 / 2).hi, quotient.hi)
    )


@quiet
def decay_mean(y: T) -> T:
    """(1 - e^(-y))/y, the mean of e^(-s) over [0, y]: decreasing, 1 at 0, as (4.0) has it."""
    if isinstance(y, Interval):
        return Interval(_decay_mean_at(y.hi).lo, _decay_mean_at(y.lo).hi).sanitised()
    near = np.abs(y) < 1e-5
    if not near.any():
        return np.asarray(-np.expm1(-y) / y)
    return np.where(near, 1 - y / 2 + y * y / 6, -np.expm1(-y) / np.where(near, 1.0, y))


def _decay_mean_at(y: Array) -> Interval:
    """The same at floats; near 0 from 1 - y/2 <= value <= 1 - y/2 + y^2/2."""
    point = Interval.exact(y)
    return _near_one(y, iv.expm1(-point) / (-point))


@quiet
def least_solution(constant: T, slope: T) -> T:
    """The least Y >= 0 with constant + slope Y <= Y: constant/(1 - slope), infinite if slope >= 1.

    `constant >= 0`, `slope >= 0`. The set of such Y is a ray, which is why minima and maxima of several such
    bounds are solved by the minimum and maximum of their solutions.
    As theory 4.6 asks for.
    """
    rest = 1 - slope
    if isinstance(rest, Interval):
        lo, hi = (constant / Interval.exact(rest.hi)).lo, (constant / Interval.exact(rest.lo)).hi
        return Interval(np.where(rest.hi > 0, lo, np.inf), np.where(rest.lo > 0, hi, np.inf))
    return np.where(rest > 0, constant / rest, np.inf)

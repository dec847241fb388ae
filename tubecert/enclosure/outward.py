"""Floats one step further out: what every rounding of an interval ends with. Trusted: yes."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
_UNIT: Final = 2.0**-52
_LEAST: Final = 2.0**-1074
_GREATEST: Final = float(np.finfo(np.float64).max)
_MOST: Final = 2.0**972  # two units in the last place of the greatest number
INFINITE: Final = np.array(np.inf)
NEGATIVE: Final = np.array(-np.inf)
_UNIT_ARRAY: Final = np.array(_UNIT)
_LEAST_ARRAY: Final = np.array(_LEAST)
_MOST_ARRAY: Final = np.array(_MOST)
_GREATEST_ARRAY: Final = np.array(_GREATEST)
_LOWEST_ARRAY: Final = np.array(-_GREATEST)


def down(x: ArrayLike) -> Array:
    """A float64 below x, one or two units in the last place; below inf the greatest number."""
    value = np.asarray(x, dtype=np.float64)
    if value.size == 1:
        return _like(value, number_below(value.item()))
    step = _step(value)
    np.minimum(np.subtract(value, step, out=step), _GREATEST_ARRAY, out=step)
    return step


def up(x: ArrayLike) -> Array:
    """A float64 above x, one or two units in the last place; above -inf the least number.

    |x| 2**-52 is at least one unit in the last place, exactly as long as it is no subnormal number; there the least
    positive number makes up for its rounding. A fifth of the time of `nextafter`.
    """
    value = np.asarray(x, dtype=np.float64)
    if value.size == 1:
        return _like(value, number_above(value.item()))
    step = _step(value)
    np.maximum(np.add(value, step, out=step), _LOWEST_ARRAY, out=step)
    return step


def _step(x: Array) -> Array:
    """What arrays are moved by, in an array of its own."""
    step: Array = np.abs(x)
    step *= _UNIT_ARRAY
    step += _LEAST_ARRAY
    np.minimum(step, _MOST_ARRAY, out=step)
    return step


def _like(array: Array, number: float) -> Array:
    """The number in the shape of an array with one entry."""
    found: Array = np.array(number, ndmin=array.ndim)[()]
    return found


def number_below(x: float) -> float:
    """`down` of one number, which needs no array: to the bit the same."""
    return _GREATEST if x == np.inf else x - (abs(x) * _UNIT + _LEAST)


def number_above(x: float) -> float:
    """`up` of one number."""
    return -_GREATEST if x == -np.inf else x + (abs(x) * _UNIT + _LEAST)

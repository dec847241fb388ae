"""Exact numbers as floats, for looking at a specification: what is beyond all floats is infinite."""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.enclosure.interval import Array


def nearest(value: Fraction) -> float:
    """The nearest float, infinite beyond their range."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def floats(values: Sequence[Fraction]) -> Array:
    """The nearest floats."""
    return np.array([nearest(value) for value in values])

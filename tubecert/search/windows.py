"""Closed form of the bandwidth conditions with the paper's kernel: c1/|c - omega| + c2/omega <= R.

A ray above c and, for small c1 and c2, a window below it. Implements: theory section 3, "Closed form".
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Window = tuple[float, float]


def windows(c1: float, c2: float, R: float, c: float) -> list[Window]:
    """Where c1/|c - omega| + c2/omega <= R, ascending, for c1, c2 >= 0: closed form."""
    if R <= 0:
        return []
    if c1 == 0:
        return [(c2 / R, float("inf"))]
    b = c * R + c1 + c2
    ray = ((b + np.sqrt(b * b - 4 * c * R * c2)) / (2 * R), float("inf"))
    if np.sqrt(c1) + np.sqrt(c2) > np.sqrt(c * R):
        return [ray]
    b = c * R + c2 - c1
    larger = (b + np.sqrt(max(b * b - 4 * c * R * c2, 0.0))) / (2 * R)
    return [(c * c2 / (R * larger) if larger > 0 else 0.0, larger), ray]


def intersection(first: Sequence[Window], second: Sequence[Window]) -> list[Window]:
    """The common part of two unions of intervals, ascending."""
    parts = [(max(a, c), min(b, d)) for a, b in first for c, d in second]
    return sorted((low, high) for low, high in parts if low <= high)

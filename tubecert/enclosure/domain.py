"""Domains of a search, and boxes as such: the safe set, or a range of time. Trusted: yes."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.enclosure.objective import Estimate

Range = tuple[Fraction | float, Fraction | float]


class Domain(Protocol):
    """A set of points, known through boxes."""

    def variables(self, needed: tuple[str, ...]) -> tuple[str, ...]:
        """The variables to search over: those needed, then those that the domain itself depends on."""
        ...

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """Boxes (N, d) that cover the domain's projection to `variables`."""
        ...

    def contract(
        self, variables: tuple[str, ...], lo: Array, hi: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Smaller boxes with the same points of the domain, and which of them may contain any."""
        ...

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """Thin boxes near the given points, each proven to lie in the domain's projection; shape (P', d)."""
        ...

    def priorities(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> Array:
        """How much splitting each variable promises, (N, d); <= 0 where it cannot be split."""
        ...


class BoxDomain:
    """The product of exact closed ranges, one for each variable."""

    def __init__(self, ranges: Mapping[str, Range]) -> None:
        self._outer = {v: (_bounds(lo)[0], _bounds(hi)[1]) for v, (lo, hi) in ranges.items()}
        self._inner = {v: (_bounds(lo)[1], _bounds(hi)[0]) for v, (lo, hi) in ranges.items()}

    def variables(self, needed: tuple[str, ...]) -> tuple[str, ...]:
        """Nothing beside what the objective needs."""
        return needed

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """The box itself, rounded outward."""
        ends = np.array([self._outer[v] for v in variables]).reshape(-1, 2)
        return ends[None, :, 0].copy(), ends[None, :, 1].copy()

    def contract(
        self, variables: tuple[str, ...], lo: Array, hi: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Boxes never leave the domain: nothing to do."""
        return lo, hi, np.ones(len(lo), dtype=bool)

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """The points, moved into the box rounded inward (a range without a float inside gives no points)."""
        ends = np.array([self._inner[v] for v in variables]).reshape(-1, 2)
        if np.any(ends[:, 0] > ends[:, 1]):
            return points[:0], points[:0]
        moved = np.clip(points, ends[:, 0], ends[:, 1])
        return moved, moved

    def priorities(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> Array:
        """Split what causes the overestimate."""
        return np.where(hi > lo, estimate.caused, 0.0)


def _bounds(value: Fraction | float) -> tuple[float, float]:
    return fraction_bounds(value) if isinstance(value, Fraction) else (float(value), float(value))

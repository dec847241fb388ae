"""Points of a box where a score is large: random points and corners, then climbing by random steps.

Floats only: what is missed here is found by branch and bound. Untrusted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.synthesis.parity import canonical

Score = Callable[[Array], Array]
_CLIMBS = 24
_TRIES = 6  # random steps per climber and round


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """The part of a box that matters: `variables` vary, those `at_ends` only between their ends, others stay put."""

    lo: Array
    hi: Array
    variables: tuple[int, ...]
    at_ends: tuple[int, ...] = ()
    symmetries: Array = field(repr=False)

    @property
    def inner(self) -> tuple[int, ...]:
        """The variables that vary freely."""
        return tuple(i for i in self.variables if i not in self.at_ends)

    @property
    def order(self) -> tuple[int, ...]:
        """All states, those first that vary freely, then those at ends."""
        rest = (i for i in range(len(self.lo)) if i not in self.variables)
        return (*self.inner, *self.at_ends, *rest)

    def random(self, count: int, generator: np.random.Generator) -> Array:
        """Points (count, n): uniform, a third of them pushed to the boundary of the free variables."""
        points = np.tile(0.5 * (self.lo + self.hi), (count, 1))
        inner, ends = list(self.inner), list(self.at_ends)
        t = generator.uniform(-0.25, 1.25, (count, len(inner)))  # a sixth beyond either end
        points[:, inner] = self.lo[inner] + np.clip(t, 0.0, 1.0) * (self.hi - self.lo)[inner]
        chosen = generator.integers(0, 2, (count, len(ends)))
        points[:, ends] = np.where(chosen == 1, self.hi[ends], self.lo[ends])
        return points

    def corners(self, most: int, generator: np.random.Generator) -> Array:
        """The corners, or some of them if there are more than `most`."""
        chosen = list(self.variables)
        if 2 ** len(chosen) > most:
            picks = generator.integers(0, 2, (most, len(chosen)))
        else:
            picks = np.arange(2 ** len(chosen))[:, None] >> np.arange(len(chosen)) & 1
        points = np.tile(0.5 * (self.lo + self.hi), (len(picks), 1))
        points[:, chosen] = np.where(picks == 1, self.hi[chosen], self.lo[chosen])
        return points

    def step(self, points: Array, size: float, generator: np.random.Generator) -> Array:
        """The points moved at random by up to `size` of the box, and kept inside."""
        inner = list(self.inner)
        moved = points.copy()
        width = size * (self.hi - self.lo)[inner]
        which = generator.integers(0, 2, (len(points), len(inner)))
        which[np.arange(len(points)), generator.integers(0, max(len(inner), 1), len(points))] = 1
        moved[:, inner] += generator.normal(size=(len(points), len(inner))) * width * which
        return np.clip(moved, self.lo, self.hi)


def worst(
    score: Score, region: Region, generator: np.random.Generator, *, samples: int, climbers: int, keep: int
) -> tuple[Array, Array]:
    """Up to `keep` points (P, n), far apart, at which the score is large, and their scores, the largest first.

    Scores that are no numbers count as +inf: a point where nothing can be computed is no point to be proud of.
    """
    points = np.concatenate([region.corners(samples // 4, generator), region.random(samples, generator)])
    values = _known(score(points))
    start = _spread(points, values, region, climbers, 0.15)
    points, values = points[start], values[start]
    size = 0.1
    for _ in range(_CLIMBS if region.inner else 0):
        tried = region.step(np.repeat(points, _TRIES, axis=0), size, generator)
        found = _known(score(tried)).reshape(len(points), _TRIES)
        best = found.argmax(axis=1)
        rows = np.arange(len(points))
        better = found[rows, best] > values
        points = np.where(better[:, None], tried.reshape(len(points), _TRIES, -1)[rows, best], points)
        values = np.where(better, found[rows, best], values)
        size *= 0.8
    points = canonical(points, region.symmetries)
    chosen = _spread(points, values, region, keep, 0.03)
    return points[chosen], values[chosen]


def floats(safe_set: Sequence[tuple[Fraction, Fraction]]) -> tuple[Array, Array]:
    """Lower and upper ends (n,), nearest floats."""
    ends = np.array([[float(lo), float(hi)] for lo, hi in safe_set]).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def _known(values: Array) -> Array:
    return np.where(np.isnan(values), np.inf, values)


def _spread(points: Array, values: Array, region: Region, count: int, distance: float) -> list[int]:
    """Indices of the best points that keep a distance (in widths of the box, over all variables) from better ones."""
    width = np.where(region.hi > region.lo, region.hi - region.lo, 1.0)
    order = np.argsort(-values, kind="stable")[: 20 * count]
    scaled = (points / width)[order]
    chosen: list[int] = []
    apart = np.ones(len(order), dtype=bool)
    while len(chosen) < count and apart.any():
        i = int(apart.argmax())
        chosen.append(int(order[i]))
        apart &= np.abs(scaled - scaled[i]).max(axis=1) > distance
        apart[i] = False
    return chosen

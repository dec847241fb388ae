"""One-dimensional searches in floats, many at once: boundaries of feasible sets and minima.

Nothing here is proven; functions take arrays with the grid along the first axis.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.theorem import R
from tubecert.kernel import margins_along

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SECTIONS = 15  # points per round: 4 bits for the price of one vectorised evaluation


def boundary(test: Callable[[Array], Mask], good: Array, bad: Array, rounds: int = 13) -> Array:
    """The last point that passes from `good` to `bad`, per lane; `test` maps (15, lanes) to masks."""
    share = (np.arange(1, _SECTIONS + 1) / (_SECTIONS + 1))[:, None]
    lanes = np.arange(good.shape[0])
    for _ in range(rounds):
        points = good + (bad - good) * share
        passed = np.logical_and.accumulate(test(points), axis=0).sum(axis=0)
        ladder = np.vstack([good, points, bad])
        good, bad = ladder[passed, lanes], ladder[passed + 1, lanes]
    return good


def smallest(test: Callable[[Array], Mask], low: float, high: float, points: int = 120) -> float:
    """The smallest x in [low, high] from which on `test` holds, or inf; scans, then refines in logarithms."""
    grid = np.geomspace(low, high, points)
    holds = test(grid[:, None])[:, 0]
    if not holds[-1]:
        return float("inf")
    failing = np.flatnonzero(~holds)
    if failing.size == 0:
        return low
    first = int(failing[-1])
    u = np.log(grid)
    return float(np.exp(boundary(lambda own: test(np.exp(own)), u[[first + 1]], u[[first]])[0]))


def minimum_log(function: Callable[[Array], Array], low: float, high: float, rounds: int = 6) -> float:
    """Where a function of a positive number is least on [low, high]: grid and zoom; inf is allowed."""
    best = low
    for _ in range(rounds):
        grid = np.geomspace(low, high, 33)
        values = function(grid)
        at = int(np.nanargmin(np.where(np.isnan(values), np.inf, values)))
        best, low, high = grid[at], grid[max(at - 1, 0)], grid[min(at + 1, 32)]
    return float(best)


def minimum_lanes(
    function: Callable[[Array], Array], low: Array, high: Array, rounds: int = 3
) -> tuple[Array, Array]:
    """Least value and its place on [low, high] per lane, for functions of arrays (33, lanes)."""
    lanes = np.arange(low.shape[0])
    for _ in range(rounds):
        grid = np.geomspace(low, high, 33)
        values = function(grid)
        at = np.argmin(np.where(np.isnan(values), np.inf, values), axis=0)
        best = values[at, lanes], grid[at, lanes]
        low, high = grid[np.maximum(at - 1, 0), lanes], grid[np.minimum(at + 1, 32), lanes]
    return best


def serves(problem: TubeProblem, recipe: R) -> bool:
    """Whether all margins of a recipe are positive: worth proposing."""
    return all(bool(margin.lo[0] > 0) for margin in margins_along(problem, [recipe]).values())

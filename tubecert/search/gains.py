"""What the searches of all theorems do with gains: the least Gamma, decimals that serve, a curve, other bandwidths.

In floats. Nothing here is proven: recipes are proposed, and the kernel decides about them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import ClassVar, Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from tubecert.conditions.arithmetic import Array
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Asked, LoopGains, Proposal, R
from tubecert.enclosure.constant import next_up, round_up
from tubecert.kernel import margins_along

DIGITS: Final = 4
_SECTIONS: Final = 15  # points per round: 4 bits for the price of one vectorised evaluation
SLACK: Final = 1e-12  # searches are in floats: stay this far inside
LEAST: Final = "least_adaptation"
_CURVE_POINTS: Final = 25
_AROUND: Final = np.geomspace(0.4, 6.0, 41)  # bandwidths around one
Gains = tuple[Fraction, Fraction, Fraction]  # omega, Gamma, g
Mask = NDArray[np.bool_]
L = TypeVar("L", bound=LoopGains)


class GainSearch(ABC, Generic[L]):
    """The gains of one theorem over a problem, `n` being its numbers in floats on the safe side.

    `span`: the bandwidth of least Gamma is looked for up to so many times the smallest that serves. `raised`: what a
    printed Gamma is multiplied by where its last digit is not enough. `first`: where a curve begins, in that smallest.
    """

    span: ClassVar[float]
    raised: ClassVar[tuple[float, ...]] = ()
    first: ClassVar[float] = 1.0

    def __init__(self, problem: TubeProblem, n: Numbers[Array] | None = None) -> None:
        self.problem = problem
        self.n = problem.floats(problem.projection_radius) if n is None else n

    @property
    @abstractmethod
    def blocked(self) -> bool:
        """Whether no gains serve, whatever they are."""

    @abstractmethod
    def smallest(self) -> float:
        """The smallest bandwidth that serves with some Gamma; infinite if none does."""

    @abstractmethod
    def needed(self, omega: Array, g: Array | None = None) -> Array:
        """The least Gamma per bandwidth (lanes,), infinite where none serves; `g`: predictors in place of the best."""

    @abstractmethod
    def best(self, bandwidths: Sequence[Fraction]) -> list[Fraction]:
        """The best predictor gain at each printed bandwidth, to 4 digits."""

    @abstractmethod
    def made(self, gains: Sequence[Gains]) -> tuple[L, ...]:
        """The best recipes found at given gains."""

    @abstractmethod
    def propose(self, asked: Asked) -> Proposal[L]:
        """What the search hands over."""

    def predictors(self, bandwidths: Sequence[Fraction]) -> list[Fraction]:
        """The predictor gain at each printed bandwidth: the one given, or the best one."""
        given = self.problem.predictor_gain
        return self.best(bandwidths) if given is None else [given] * len(bandwidths)

    def printed(self, bandwidths: Sequence[Fraction]) -> list[Gains]:
        """The gains at printed bandwidths: g first, then Gamma for the printed g, rounded up; where there is one."""
        gains = self.predictors(bandwidths)
        Gamma = self.needed(np.array(bandwidths, dtype=float), np.array(gains, dtype=float))
        return [
            (w, round_up(max(float(G) * (1 + SLACK), 1e-12), DIGITS), g)
            for w, G, g in zip(bandwidths, Gamma, gains, strict=True)
            if np.isfinite(G)
        ]

    def at(self, omega: Fraction) -> L | None:
        """The recipe of least Gamma at a printed bandwidth; None if no Gamma serves there."""
        for w, Gamma, g in self.printed([omega]):
            # more than the least rate is needed only where rounding decides
            more = (round_up(x * float(Gamma), DIGITS) for x in self.raised)
            for rate in (Gamma, next_up(Gamma, DIGITS), *more):
                (recipe,) = self.made([(w, rate, g)])
                if serves(self.problem, recipe):
                    return recipe
        return None

    def given(self, omega: Fraction, Gamma: Fraction) -> L:
        """The recipe at gains that are asked for."""
        (g,) = self.predictors([omega])
        return self.made([(omega, Gamma, g)])[0]

    def from_bandwidth(self, omega: float) -> L | None:
        """The recipe at the first printed bandwidth that serves; more digits only where 4 do not."""
        if not np.isfinite(omega):
            return None
        printed = (round_up(omega * (1 + SLACK), digits) for digits in (DIGITS, 5, 6, 8, 12))
        return next((recipe for w in printed if (recipe := self.at(w)) is not None), None)

    def least(self, low: float | None = None) -> L | None:
        """The recipe of least Gamma, at or above the smallest bandwidth that serves."""
        if low is None:
            low = np.inf if self.blocked else self.smallest()
        return (
            self.from_bandwidth(minimum_log(self.needed, low, self.span * low)) if np.isfinite(low) else None
        )

    def curve(self, low: float) -> tuple[L, ...]:
        """Gamma(omega) at printed bandwidths from the smallest that serves on."""
        omegas = np.geomspace(self.first * low, 20 * low, _CURVE_POINTS)
        points = self.printed([round_up(w, DIGITS) for w in omegas])
        return self.made(points) if points else ()

    def around(self, recipe: L) -> tuple[L, ...]:
        """The same rate and predictor at other printed bandwidths, its own among them; ascending."""
        own = recipe.bandwidth
        omegas = sorted({own, *(round_up(float(own) * float(factor), DIGITS) for factor in _AROUND)})
        return self.made([(omega, recipe.adaptation_rate, recipe.predictor_gain) for omega in omegas])


# -- one-dimensional searches, many at once; functions take arrays with the grid along the first axis


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

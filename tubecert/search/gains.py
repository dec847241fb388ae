"""What the searches of all theorems do with gains: the least Gamma, decimals that serve, a curve, other bandwidths.

Nothing here is proven: recipes are proposed, and the kernel decides about them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import ClassVar, Final, Generic, TypeVar

import numpy as np

from tubecert.conditions.arithmetic import Array
from tubecert.conditions.problem import Numbers, TubeProblem
from tubecert.conditions.theorem import Asked, LoopGains, Proposal
from tubecert.enclosure.constant import next_up, round_up
from tubecert.search.scan import minimum_log, serves

DIGITS: Final = 4
SLACK: Final = 1e-12  # searches are in floats: stay this far inside
LEAST: Final = "least_adaptation"
_CURVE_POINTS: Final = 25
_AROUND: Final = np.geomspace(0.4, 6.0, 41)  # bandwidths around one
Gains = tuple[Fraction, Fraction, Fraction]  # omega, Gamma, g
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
    def predictors(self, bandwidths: Sequence[Fraction]) -> list[Fraction]:
        """The predictor gain at each printed bandwidth: the one given, or the best one to 4 digits."""

    @abstractmethod
    def made(self, gains: Sequence[Gains]) -> tuple[L, ...]:
        """The best recipes found at given gains."""

    @abstractmethod
    def propose(self, asked: Asked) -> Proposal[L]:
        """What the search hands over."""

    def printed(self, bandwidths: Sequence[Fraction]) -> list[Gains]:
        """The gains at printed bandwidths: g first, then Gamma for the printed g, rounded up; where there is one."""
        gains = self.predictors(bandwidths)
        Gamma = self.needed(_floats(bandwidths), _floats(gains))
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


def _floats(values: Iterable[Fraction]) -> Array:
    return np.array([float(value) for value in values])

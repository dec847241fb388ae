"""Who proposes gains for which theorem, and who explains them. One table: a new kind adds its line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Final, Protocol

from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.theorem import Asked, Proposal
from tubecert.search.distance import least_distance, propose_distance
from tubecert.search.elasticities import elasticities_26, elasticities_distance, halving
from tubecert.search.rates import least_rates, propose_rates

LEAST = "least_adaptation"


class _Rated(Protocol):
    """Gains with an adaptation rate."""

    @property
    def adaptation_rate(self) -> Fraction: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposer:
    """`propose` gains; `slopes`: how the least adaptation rate reacts to each constant, if there is one.

    `least`: the recipe of least adaptation rate alone, at a fraction of the time of a whole proposal.
    """

    propose: Callable[[TubeProblem, Asked], Proposal[Any]]
    slopes: Callable[[TubeProblem, Any], dict[str, float]] | None = None
    least: Callable[[TubeProblem], _Rated | None] | None = None

    def explain(self, problem: TubeProblem, at: Callable[[str], Any]) -> Explained:
        """What the gains depend on, `at` being the recipes by role; no claim rests on these numbers."""
        if self.slopes is None:
            return Explained()
        slopes = self.slopes(problem, at(LEAST))
        return Explained(slopes=slopes, halved=halving(problem, slopes, self._least))

    def _least(self, problem: TubeProblem) -> Fraction | None:
        recipe = None if self.least is None else self.least(problem)
        return None if recipe is None else recipe.adaptation_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Explained:
    """`slopes`: d log(Gamma)/d log(constant); `halved`: what halving a constant makes of Gamma. None: no such rate."""

    slopes: Mapping[str, float] | None = None
    halved: Mapping[str, float] = field(default_factory=dict)


PROPOSERS: Final[Mapping[type, Proposer]] = {
    NoGains: Proposer(propose=lambda problem, asked: Proposal(decisive=NoGains(), role="feedback")),
    RateRecipe: Proposer(propose=propose_rates, slopes=elasticities_26, least=least_rates),
    DistanceRecipe: Proposer(propose=propose_distance, slopes=elasticities_distance, least=least_distance),
}

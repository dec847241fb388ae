"""Who proposes gains for which theorem, and who explains them. One table: a new kind adds its line."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from functools import partial
from typing import Any, Final

from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.theorem import Asked, LoopGains, Proposal
from tubecert.search.distance import DistanceSearch
from tubecert.search.elasticities import elasticities, halving
from tubecert.search.gains import LEAST, GainSearch
from tubecert.search.rates import RateSearch


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposer:
    """`propose` gains; `slopes`: how the least adaptation rate reacts to each constant, if there is one.

    `least`: the recipe of least adaptation rate alone, at a fraction of the time of a whole proposal.
    """

    propose: Callable[[TubeProblem, Asked], Proposal[Any]]
    slopes: Callable[[TubeProblem, Any], dict[str, float]] | None = None
    least: Callable[[TubeProblem], LoopGains | None] | None = None

    @classmethod
    def of(cls, search: type[GainSearch[Any]]) -> Proposer:
        """By the search of a theorem's gains."""
        return cls(
            propose=lambda problem, asked: search(problem).propose(asked),
            slopes=partial(elasticities, search),
            least=lambda problem: search(problem).least(),
        )

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
    RateRecipe: Proposer.of(RateSearch),
    DistanceRecipe: Proposer.of(DistanceSearch),
}

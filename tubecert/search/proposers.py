"""Who proposes gains for which theorem, and who explains them. One table: a new kind adds its line."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, Final, Protocol

from tubecert.claims.advice import HardwareCause, HardwarePart
from tubecert.conditions import hardware as theorem_h
from tubecert.conditions.alone import NoGains
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Asked, Proposal
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.sampled import SampledRecipe
from tubecert.kernel import obstacles
from tubecert.search.along import propose_in_windows
from tubecert.search.distance import least_distance, propose_distance
from tubecert.search.elasticities import elasticities_26, elasticities_distance, halving
from tubecert.search.hardware import propose_hardware
from tubecert.search.machines import PARTS, easier, filled, halved
from tubecert.search.rates import least_rates, propose_rates
from tubecert.search.sampled import propose_sampled
from tubecert.search.scan import serves
from tubecert.search.stretches import propose_distance_in_parts, propose_sampled_in_parts

LEAST, MACHINE, LARGEST = "least_adaptation", "machine", "largest"


class _Rated(Protocol):
    """Gains with an adaptation rate."""

    @property
    def adaptation_rate(self) -> Fraction: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposer:
    """`propose` gains; `slopes`: how the least adaptation rate reacts to each constant, if there is one.

    `least`: the recipe of least adaptation rate alone, at a fraction of the time of a whole proposal.
    `machine`: what is proposed is about a machine, of which another one may be better or easier to have.
    """

    propose: Callable[[TubeProblem, Asked], Proposal[Any]]
    slopes: Callable[[TubeProblem, Any], dict[str, float]] | None = None
    least: Callable[[TubeProblem], _Rated | None] | None = None
    machine: bool = False

    def explain(
        self, problem: TubeProblem, at: Callable[[str], Any], parts: Sequence[HardwarePart] = PARTS
    ) -> Explained:
        """What the gains depend on, `at` being the recipes by role; no claim rests on these numbers.

        `parts` of a machine are those that can be changed alone.
        """
        if self.machine:
            found = at(MACHINE) or at(LARGEST)
            if found is None or not serves(problem, found):
                return Explained(eased=easier(problem, parts), filled=filled(problem, found))
            return Explained(halved_parts=halved(problem, found, parts))
        if self.slopes is None:
            return Explained()
        problem = replace(problem, parts=())  # what the rate depends on is told for the whole plan
        slopes = self.slopes(problem, at(LEAST))
        return Explained(slopes=slopes, halved=halving(problem, slopes, self._least))

    def _least(self, problem: TubeProblem) -> Fraction | None:
        recipe = None if self.least is None else self.least(problem)
        return None if recipe is None else recipe.adaptation_rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Explained:
    """`slopes`: d log(Gamma)/d log(constant); `halved`: what halving a constant makes of Gamma. None: no such rate.

    `halved_parts`: what halving a part of the machine makes of the tube; `eased`: parts with which it would serve;
    `filled`: what fills the level of a loop that does not serve.
    """

    slopes: Mapping[str, float] | None = None
    halved: Mapping[str, float] = field(default_factory=dict)
    halved_parts: Mapping[HardwarePart, float] = field(default_factory=dict)
    eased: Mapping[HardwarePart, Fraction] = field(default_factory=dict)
    filled: Mapping[HardwareCause, float] = field(default_factory=dict)


def _propose_on_machine(problem: TubeProblem, asked: Asked) -> Proposal[HardwareRecipe]:
    """Of one window, or of several."""
    machine = problem.machine
    if machine is None or not machine.windows:
        return propose_hardware(problem, asked)
    blocked = obstacles(problem, theorem_h.THEOREM)
    return Proposal() if blocked else propose_in_windows(problem, machine, asked.lost)


def _propose_distance(problem: TubeProblem, asked: Asked) -> Proposal[DistanceRecipe]:
    """For the whole plan, or with levels in windows of it."""
    return propose_distance_in_parts(problem, asked) if problem.parts else propose_distance(problem, asked)


def _propose_sampled(problem: TubeProblem, asked: Asked) -> Proposal[SampledRecipe]:
    """For the whole plan, or with levels in windows of it."""
    return propose_sampled_in_parts(problem, asked) if problem.parts else propose_sampled(problem, asked)


PROPOSERS: Final[Mapping[type, Proposer]] = {
    NoGains: Proposer(propose=lambda problem, asked: Proposal(decisive=NoGains(), role="feedback")),
    RateRecipe: Proposer(propose=propose_rates, slopes=elasticities_26, least=least_rates),
    DistanceRecipe: Proposer(propose=_propose_distance, slopes=elasticities_distance, least=least_distance),
    SampledRecipe: Proposer(propose=_propose_sampled),
    HardwareRecipe: Proposer(propose=_propose_on_machine, machine=True),
}

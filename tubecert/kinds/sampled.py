"""Certificate C: piecewise-constant adaptation with a sample time. Implements: theory 4b, theorem C."""

from __future__ import annotations

from dataclasses import dataclass, replace

from tubecert.claims import GainsSuffice
from tubecert.conditions import sampled
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal, SampledProposal
from tubecert.conditions.sampled import SampledRecipe
from tubecert.kernel import Checked, judge
from tubecert.kinds import SAMPLED
from tubecert.kinds.kind import Json, Kind, Section, gains_json, margin_json, shortfall_json

_GAINS = ("sample_time", "bandwidth", "predictor_gain", "projection_radius")


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSection(Section[SampledRecipe]):
    """The sample time (largest with omega = 1/Ts, or as asked for) and the curve.

    `sample_time_limit` is approached as omega grows, at the predictor gain of the pair, and never attained.
    """

    name = SAMPLED

    sample_time_limit: float | None

    @property
    def pair(self) -> Checked[SampledRecipe] | None:
        """The gains that the verdict is about."""
        return self.decisive

    def claim(self) -> GainsSuffice:
        """That the sample time suffices, with its predictor."""
        gain = None if self.pair is None else self.pair.recipe.predictor_gain
        return replace(Section.claim(self), predictor_gain=gain)

    def to_json(self) -> Json:
        """The section `sampled` of the certificate."""
        pair = self.pair
        return {
            "verdict": str(self.verdict),
            **(dict.fromkeys(_GAINS) if pair is None else gains_json(pair.recipe, *_GAINS)),
            "margin": None if pair is None else margin_json(pair.margins["sampled"]),
            "ultimate_radius": self.judgement.ultimate_radius,
            "sample_time_limit": self.sample_time_limit,
            "curve": [gains_json(r, "bandwidth", "sample_time") for r in self.curve],
            "shortfalls": [shortfall_json(item) for item in self.shortfalls],
        }


class Sampled(Kind[SampledRecipe]):
    """Certificate C."""

    name = SAMPLED
    theorem = sampled.THEOREM

    def section(self, problem: TubeProblem, proposal: Proposal[SampledRecipe]) -> SampledSection:
        """The section about a proposal."""
        limit = proposal.limit if isinstance(proposal, SampledProposal) else None
        return SampledSection(judgement=judge(problem, self.theorem, proposal), sample_time_limit=limit)

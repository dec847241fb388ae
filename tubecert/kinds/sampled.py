"""Certificate C: piecewise-constant adaptation with a sample time. Implements: theory 4b, theorem C."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

from tubecert.claims.gains import GainsSuffice
from tubecert.conditions import sampled
from tubecert.conditions.inputs import InputBound, LimitedInput
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal, SampledProposal
from tubecert.conditions.sampled import SampledRecipe
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked, judge
from tubecert.kinds import SAMPLED
from tubecert.kinds.data import Pair, Role, SectionData, margin_data, missing_data
from tubecert.kinds.kind import Kind, Section
from tubecert.kinds.windows import WindowData, bound_of, told, untold


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplePoint:
    """A proven point of a curve: the sample time that a bandwidth allows."""

    bandwidth: Fraction
    sample_time: Fraction


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledData(SectionData):
    """Certificate C: the longest sample time, or the one asked for; the curve.

    `sample_time_limit` is approached as the bandwidth grows, and never attained. `windows`: what is proven in each,
    where the specification has them.
    """

    name = SAMPLED
    sample_time: Fraction | None
    bandwidth: Fraction | None
    predictor_gain: Fraction | None
    projection_radius: Fraction | None
    margin: Constant | None
    sample_time_limit: float | None
    curve: tuple[SamplePoint, ...]
    windows: tuple[WindowData, ...] = ()

    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """The one set of gains."""
        if self.sample_time is None or self.bandwidth is None:
            return ()
        margins = {} if self.margin is None else {SAMPLED.key: self.margin}
        role: Role = "asked" if asked else "longest_sample"
        return (Pair(role=role, bandwidth=self.bandwidth, sample_time=self.sample_time, margins=margins),)

    def points(self) -> tuple[tuple[float, float], ...]:
        """Bandwidth and sample time."""
        return tuple((float(p.bandwidth), float(p.sample_time)) for p in self.curve)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampledSection(Section[SampledRecipe]):
    """The sample time (largest with omega = 1/Ts, or as asked for) and the curve.

    `sample_time_limit` is approached as omega grows, at the predictor gain of the pair, and never attained.
    """

    name = SAMPLED

    sample_time_limit: float | None
    windows: tuple[WindowData, ...] = ()

    def input_bound(self, own: LimitedInput) -> InputBound | None:
        """What an input with limits does in the loop, by the proof; in windows, in any of them."""
        return bound_of(own, self.proof, self.windows)

    def input_along(self, name: str) -> tuple[tuple[float, float], ...]:
        """The range of an input in each window."""
        return () if self.proof is None else tuple(w.inputs[name] for w in self.windows if name in w.inputs)

    @property
    def pair(self) -> Checked[SampledRecipe] | None:
        """The gains that the verdict is about."""
        return self.decisive

    def claim(self) -> GainsSuffice:
        """That the sample time suffices, with its predictor."""
        gain = None if self.pair is None else self.pair.recipe.predictor_gain
        return replace(Section.claim(self), predictor_gain=gain)

    def data(self) -> SampledData:
        """The section `sampled` of the certificate."""
        pair = self.pair
        recipe = None if pair is None else pair.recipe
        return SampledData(
            verdict=self.verdict,
            sample_time=None if recipe is None else recipe.sample_time,
            bandwidth=None if recipe is None else recipe.bandwidth,
            predictor_gain=None if recipe is None else recipe.predictor_gain,
            projection_radius=None if recipe is None else recipe.projection_radius,
            margin=None if pair is None else margin_data(pair.margins["sampled"]),
            ultimate_radius=self.judgement.ultimate_radius,
            sample_time_limit=self.sample_time_limit,
            curve=tuple(SamplePoint(bandwidth=r.bandwidth, sample_time=r.sample_time) for r in self.curve),
            shortfalls=missing_data(self.shortfalls),
            windows=self.windows,
        )


class Sampled(Kind[SampledRecipe]):
    """Certificate C."""

    name = SAMPLED
    theorem = sampled.THEOREM
    form = SampledData

    def section(self, problem: TubeProblem, proposal: Proposal[SampledRecipe]) -> SampledSection:
        """The section about a proposal."""
        limit = proposal.limit if isinstance(proposal, SampledProposal) else None
        judgement = judge(problem, self.theorem, proposal)
        proof = judgement.proof
        windows = untold(problem)
        if proof is not None and problem.parts:
            suprema, recipe = sampled.suprema_in_windows(problem, proof.recipe), proof.recipe
            windows = told(problem, recipe.windows, suprema, recipe.projection_radius)
        return SampledSection(judgement=judgement, sample_time_limit=limit, windows=windows)

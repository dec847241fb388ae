"""Certificate A: the conditions (26a)-(26c) of the paper, with its slips corrected. Implements: (26a)-(26c)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from tubecert.claims.gains import GainsSuffice
from tubecert.conditions import rates
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal, RateProposal
from tubecert.conditions.rates import RateRecipe
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked, Judgement, judge
from tubecert.kinds import RATES
from tubecert.kinds.data import (
    GainPoint,
    Pair,
    SectionData,
    margin_data,
    missing_data,
    proven_data,
)
from tubecert.kinds.kind import Kind, Section
from tubecert.records import keyed

CONDITIONS = ("26a", "26b", "26c")


@dataclass(frozen=True, slots=True, kw_only=True)
class RatePair:
    """Gains of certificate A with the margins of its conditions."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction
    margins: Mapping[str, Constant]


@dataclass(frozen=True, slots=True, kw_only=True)
class RatesAround:
    """Proven margins against the bandwidth, by condition."""

    bandwidth: tuple[Fraction, ...]
    adaptation_rate: Fraction
    predictor_gain: Fraction
    margins: Mapping[str, tuple[float | None, ...]] = field(
        metadata=keyed(lambda: dict.fromkeys(CONDITIONS, tuple[float | None, ...]))
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RatesData(SectionData):
    """Certificate A: the gains of least bandwidth, or asked for; those of least adaptation rate; the curve.

    `predictor_gain` is the g of A_m = -g I; `bandwidth_infimum` is where (26a) and (26b) begin to hold, `binds` the
    condition that sets the bandwidth.
    """

    name = RATES
    bandwidth: Fraction | None
    adaptation_rate: Fraction | None
    predictor_gain: Fraction | None
    projection_radius: Fraction | None
    margins: Mapping[str, Constant] | None
    least_adaptation: RatePair | None
    curve: tuple[GainPoint, ...] = ()
    bandwidth_infimum: float | None = None
    binds: str | None = None
    margins_around: RatesAround | None = None

    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """The gains of least bandwidth, or asked for; and where none were, those of least adaptation rate."""
        found = []
        if self.bandwidth is not None:
            found.append(
                Pair(
                    role="asked" if asked else "least_bandwidth",
                    bandwidth=self.bandwidth,
                    adaptation_rate=self.adaptation_rate,
                    margins=self.margins or {},
                )
            )
        least = self.least_adaptation
        if least is not None and not asked:
            found.append(
                Pair(
                    role="least_adaptation",
                    bandwidth=least.bandwidth,
                    adaptation_rate=least.adaptation_rate,
                    margins=least.margins,
                )
            )
        return tuple(found)

    def points(self) -> tuple[tuple[float, float], ...]:
        """Bandwidth and adaptation rate."""
        return tuple((float(p.bandwidth), float(p.adaptation_rate)) for p in self.curve)


@dataclass(frozen=True, slots=True, kw_only=True)
class RatesSection(Section[RateRecipe]):
    """The pair of least bandwidth (or asked for), the pair of least rate, the curve.

    `infimum` is the smallest bandwidth that (26a), (26b) admit; where (26b) binds it is not attained, and the pair has
    the smallest bandwidth that leaves 1 % of (26b). `binds` names the condition that sets the bandwidth.
    """

    name = RATES

    problem: TubeProblem
    infimum: float | None
    binds: str | None

    @property
    def pair(self) -> Checked[RateRecipe] | None:
        """The gains that the verdict is about."""
        return self.decisive

    @property
    def least_adaptation(self) -> Checked[RateRecipe] | None:
        """The gains of least adaptation rate."""
        return self.at("least_adaptation")

    def claim(self) -> GainsSuffice:
        """That the gains suffice, and which condition sets the bandwidth."""
        return replace(Section.claim(self), binds=self.binds)

    def data(self) -> RatesData:
        """The section `conditions_26` of the certificate."""
        at, judgement = _pair_data(self.pair), self.judgement
        return RatesData(
            verdict=self.verdict,
            bandwidth=None if at is None else at.bandwidth,
            adaptation_rate=None if at is None else at.adaptation_rate,
            predictor_gain=None if at is None else at.predictor_gain,
            projection_radius=None if at is None else at.projection_radius,
            margins=None if at is None else at.margins,
            ultimate_radius=judgement.ultimate_radius,
            least_adaptation=_pair_data(self.least_adaptation),
            curve=tuple(
                GainPoint(
                    bandwidth=r.bandwidth, adaptation_rate=r.adaptation_rate, predictor_gain=r.predictor_gain
                )
                for r in self.curve
            ),
            bandwidth_infimum=self.infimum,
            binds=self.binds,
            shortfalls=missing_data(self.shortfalls),
            margins_around=_around_data(judgement) if judgement.around_at else None,
        )


def _pair_data(pair: Checked[RateRecipe] | None) -> RatePair | None:
    if pair is None:
        return None
    recipe = pair.recipe
    return RatePair(
        bandwidth=recipe.bandwidth,
        adaptation_rate=recipe.adaptation_rate,
        predictor_gain=recipe.predictor_gain,
        projection_radius=recipe.projection_radius,
        margins={condition: margin_data(margin) for condition, margin in pair.margins.items()},
    )


def _around_data(judgement: Judgement[RateRecipe]) -> RatesAround:
    recipes = judgement.around_at
    return RatesAround(
        bandwidth=tuple(recipe.bandwidth for recipe in recipes),
        adaptation_rate=recipes[0].adaptation_rate,
        predictor_gain=recipes[0].predictor_gain,
        margins={condition: proven_data(low) for condition, low in judgement.around.items()},
    )


class Rates(Kind[RateRecipe]):
    """Certificate A."""

    name = RATES
    theorem = rates.THEOREM
    form = RatesData

    def section(self, problem: TubeProblem, proposal: Proposal[RateRecipe]) -> RatesSection:
        """The section about a proposal."""
        met = proposal if isinstance(proposal, RateProposal) else RateProposal()
        judgement = judge(problem, self.theorem, proposal)
        return RatesSection(judgement=judgement, problem=problem, infimum=met.infimum, binds=met.binds)

    def derived(self, section: Section[RateRecipe]) -> Mapping[str, Constant]:
        """The derived constants of (26a)-(26c) at the pair."""
        if not isinstance(section, RatesSection) or section.pair is None:
            return {}
        return rates.derived_constants(section.problem, section.pair.recipe)

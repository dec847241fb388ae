"""Certificate B: a sharper bound of the Riemannian distance to the plan. Implements: theory 4, theorem B."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.conditions import distance
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.proposal import Proposal
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked, Judgement, judge
from tubecert.kinds import DISTANCE
from tubecert.kinds.data import (
    GainPoint,
    Pair,
    Role,
    SectionData,
    margin_data,
    missing_data,
    proven_data,
)
from tubecert.kinds.kind import Kind, Section


@dataclass(frozen=True, slots=True, kw_only=True)
class DistancePair:
    """Gains of certificate B with their margin."""

    bandwidth: Fraction
    adaptation_rate: Fraction
    predictor_gain: Fraction
    projection_radius: Fraction
    margin: Constant
    ultimate_radius: float | None

    def pair(self, role: Role) -> Pair:
        """As all kinds tell it."""
        return Pair(
            role=role,
            bandwidth=self.bandwidth,
            adaptation_rate=self.adaptation_rate,
            margins={DISTANCE.key: self.margin},
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceAround:
    """Proven margins against the bandwidth."""

    bandwidth: tuple[Fraction, ...]
    adaptation_rate: Fraction
    predictor_gain: Fraction
    margin: tuple[float | None, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceData(SectionData):
    """Certificate B: the pair of least bandwidth, of least adaptation rate, the one asked for, the curve."""

    name = DISTANCE
    split: DistancePair | None
    least_adaptation: DistancePair | None
    asked: DistancePair | None
    curve: tuple[GainPoint, ...] = ()
    margins_around: DistanceAround | None = None

    def pairs(self, *, asked: bool) -> tuple[Pair, ...]:
        """The pair asked for; or that of least rate, then that of least bandwidth."""
        roles: tuple[tuple[Role, DistancePair | None], ...] = (
            (("asked", self.asked),)
            if asked
            else (("least_adaptation", self.least_adaptation), ("least_bandwidth", self.split))
        )
        return tuple(pair.pair(role) for role, pair in roles if pair is not None)

    def points(self) -> tuple[tuple[float, float], ...]:
        """Bandwidth and adaptation rate."""
        return tuple((float(p.bandwidth), float(p.adaptation_rate)) for p in self.curve)


@dataclass(frozen=True, slots=True, kw_only=True)
class DistanceSection(Section[DistanceRecipe]):
    """The pair of least bandwidth, the pair of least rate, the pair asked for (which then decides), the curve."""

    name = DISTANCE

    @property
    def split(self) -> Checked[DistanceRecipe] | None:
        """The gains of least bandwidth."""
        return self.at("split")

    @property
    def least_adaptation(self) -> Checked[DistanceRecipe] | None:
        """The gains of least adaptation rate."""
        return self.at("least_adaptation")

    @property
    def asked(self) -> Checked[DistanceRecipe] | None:
        """The gains asked for."""
        return self.at("asked")

    def data(self) -> DistanceData:
        """The section `distance` of the certificate."""
        judgement = self.judgement
        return DistanceData(
            verdict=self.verdict,
            split=_pair_data(self.at("split")),
            least_adaptation=_pair_data(self.at("least_adaptation")),
            asked=_pair_data(self.at("asked")),
            ultimate_radius=judgement.ultimate_radius,
            curve=tuple(
                GainPoint(
                    bandwidth=r.bandwidth, adaptation_rate=r.adaptation_rate, predictor_gain=r.predictor_gain
                )
                for r in self.curve
            ),
            shortfalls=missing_data(self.shortfalls),
            margins_around=None if not judgement.around_at else _around_data(judgement),
        )


def _pair_data(pair: Checked[DistanceRecipe] | None) -> DistancePair | None:
    if pair is None:
        return None
    recipe = pair.recipe
    return DistancePair(
        bandwidth=recipe.bandwidth,
        adaptation_rate=recipe.adaptation_rate,
        predictor_gain=recipe.predictor_gain,
        projection_radius=recipe.projection_radius,
        margin=margin_data(pair.margins["distance"]),
        ultimate_radius=pair.ultimate_radius,
    )


def _around_data(judgement: Judgement[DistanceRecipe]) -> DistanceAround:
    recipes = judgement.around_at
    return DistanceAround(
        bandwidth=tuple(recipe.bandwidth for recipe in recipes),
        adaptation_rate=recipes[0].adaptation_rate,
        predictor_gain=recipes[0].predictor_gain,
        margin=proven_data(judgement.around["distance"]),
    )


class Distance(Kind[DistanceRecipe]):
    """Certificate B."""

    name = DISTANCE
    theorem = distance.THEOREM
    form = DistanceData

    def section(self, problem: TubeProblem, proposal: Proposal[DistanceRecipe]) -> DistanceSection:
        """The section about a proposal."""
        return DistanceSection(judgement=judge(problem, self.theorem, proposal))

"""Certificate B: a sharper bound of the Riemannian distance to the plan. Implements: theory 4, theorem B."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.conditions import distance
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.theorem import LoopGains
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked
from tubecert.kinds import DISTANCE
from tubecert.kinds.kind import (
    GainPoint,
    Kind,
    Pair,
    Role,
    Section,
    SectionData,
    margin_data,
    missing_data,
    proven_data,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DistancePair(LoopGains):
    """Gains of certificate B with their margin."""

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


def _data(section: Section[DistanceRecipe]) -> DistanceData:
    recipes = section.around_at
    return DistanceData(
        verdict=section.verdict,
        split=_pair_data(section.at("split")),
        least_adaptation=_pair_data(section.at("least_adaptation")),
        asked=_pair_data(section.at("asked")),
        ultimate_radius=section.ultimate_radius,
        curve=GainPoint.along(section.curve),
        shortfalls=missing_data(section.shortfalls),
        margins_around=None
        if not recipes
        else DistanceAround(
            bandwidth=tuple(recipe.bandwidth for recipe in recipes),
            adaptation_rate=recipes[0].adaptation_rate,
            predictor_gain=recipes[0].predictor_gain,
            margin=proven_data(section.around[DISTANCE.key]),
        ),
    )


def _pair_data(pair: Checked[DistanceRecipe] | None) -> DistancePair | None:
    if pair is None:
        return None
    margin = margin_data(pair.margins[DISTANCE.key])
    return DistancePair(**pair.recipe.gains, margin=margin, ultimate_radius=pair.ultimate_radius)


KIND: Final = Kind(name=DISTANCE, theorem=distance.THEOREM, form=DistanceData, data=_data)

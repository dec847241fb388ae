"""Certificate A: the conditions (26a)-(26c) of the paper, with its slips corrected. Implements: (26a)-(26c)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final

from tubecert.conditions import rates
from tubecert.conditions.rates import RateRecipe
from tubecert.conditions.theorem import LoopGains
from tubecert.enclosure.constant import Constant
from tubecert.kernel import Checked
from tubecert.kinds import RATES
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
from tubecert.records import keyed

CONDITIONS = ("26a", "26b", "26c")


@dataclass(frozen=True, slots=True, kw_only=True)
class RatePair(LoopGains):
    """Gains of certificate A with the margins of its conditions."""

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
        roles: tuple[tuple[Role, RatesData | RatePair | None], ...] = (
            ("asked" if asked else "least_bandwidth", None if self.bandwidth is None else self),
            ("least_adaptation", None if asked else self.least_adaptation),
        )
        return tuple(
            Pair(
                role=role,
                bandwidth=pair.bandwidth,
                adaptation_rate=pair.adaptation_rate,
                margins=pair.margins or {},
            )
            for role, pair in roles
            if pair is not None
        )


def _data(section: Section[RateRecipe]) -> RatesData:
    """The pair of least bandwidth (or asked for), the pair of least rate, the curve.

    The infimum is the smallest bandwidth that (26a), (26b) admit; where (26b) binds it is not attained, and the pair
    has the smallest bandwidth that leaves 1 % of (26b).
    """
    at, proposal = _pair_data(section.decisive), section.proposal
    recipes = section.around_at
    return RatesData(
        verdict=section.verdict,
        bandwidth=None if at is None else at.bandwidth,
        adaptation_rate=None if at is None else at.adaptation_rate,
        predictor_gain=None if at is None else at.predictor_gain,
        projection_radius=None if at is None else at.projection_radius,
        margins=None if at is None else at.margins,
        ultimate_radius=section.ultimate_radius,
        least_adaptation=_pair_data(section.at("least_adaptation")),
        curve=GainPoint.along(section.curve),
        bandwidth_infimum=proposal.infimum,
        binds=proposal.binds,
        shortfalls=missing_data(section.shortfalls),
        margins_around=None
        if not recipes
        else RatesAround(
            bandwidth=tuple(recipe.bandwidth for recipe in recipes),
            adaptation_rate=recipes[0].adaptation_rate,
            predictor_gain=recipes[0].predictor_gain,
            margins={condition: proven_data(low) for condition, low in section.around.items()},
        ),
    )


def _pair_data(pair: Checked[RateRecipe] | None) -> RatePair | None:
    if pair is None:
        return None
    margins = {condition: margin_data(margin) for condition, margin in pair.margins.items()}
    return RatePair(**pair.recipe.gains, margins=margins)


KIND: Final = Kind(
    name=RATES, theorem=rates.THEOREM, form=RatesData, data=_data, constants=rates.derived_constants
)

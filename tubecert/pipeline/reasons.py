"""Why a verdict about gains is what it is: what binds, by how much, what would relax it.

In: the results of the three searches, and what halving a constant does to the least Gamma.
Out: the `Reason`s of a certificate.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import inf

from tubecert.claims import (
    ConditionHolds,
    GainsSuffice,
    HalveConstant,
    RaiseBudget,
    Reason,
    Relax,
    ShrinkTube,
)
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Interval
from tubecert.search.results import (
    Conditions26,
    DistancePair,
    DistanceResult,
    RatePair,
    SampledPair,
    SampledResult,
)

_OF_PREDICTOR = ("26c", "distance", "sampled")  # conditions that another predictor may satisfy
_NOTABLE = 0.995  # a factor above it is not worth a word

UNBOUNDED_RELAX: tuple[Relax, ...] = (RaiseBudget(), ShrinkTube())


def reasons_26(result: Conditions26, halved: Mapping[str, float]) -> list[Reason]:
    """Reasons of certificate A."""
    if result.verdict is not Verdict.CERTIFIED or result.pair is None:
        return _short("conditions_26", result.verdict, result.shortfalls, _gain_of(result.pair))
    claim = GainsSuffice(
        section="conditions_26",
        margins={condition: float(margin.lo) for condition, margin in result.pair.margins.items()},
        binds=result.binds,
        below_twice_rate=result.below_twice_rate,
    )
    return [_certified(claim, halved)]


def reasons_distance(result: DistanceResult, halved: Mapping[str, float]) -> list[Reason]:
    """Reasons of certificate B."""
    pair = result.decisive
    if result.verdict is not Verdict.CERTIFIED or pair is None:
        return _short("distance", result.verdict, result.shortfalls, _gain_of(pair))
    claim = GainsSuffice(section="distance", margins={"distance": float(pair.margin.lo)})
    return [_certified(claim, halved)]


def reasons_sampled(result: SampledResult) -> list[Reason]:
    """Reasons of certificate C."""
    if result.verdict is not Verdict.CERTIFIED or result.pair is None:
        return _short("sampled", result.verdict, result.shortfalls, _gain_of(result.pair))
    claim = GainsSuffice(
        section="sampled",
        margins={"sampled": float(result.pair.margin.lo)},
        predictor_gain=result.pair.recipe.predictor_gain,
    )
    return [_certified(claim, {})]


def _gain_of(pair: RatePair | DistancePair | SampledPair | None) -> Fraction | None:
    """The predictor that a claim about gains is made with, where it is -g I."""
    return None if pair is None else pair.recipe.predictor_gain


def _certified(claim: GainsSuffice, halved: Mapping[str, float]) -> Reason:
    relax = tuple(
        HalveConstant(constant=name, factor=factor) for name, factor in halved.items() if factor < _NOTABLE
    )
    return Reason(claim=claim, verdict=Verdict.CERTIFIED, relax=relax)


def _short(
    section: str, verdict: Verdict, shortfalls: tuple[Shortfall, ...], gain: Fraction | None
) -> list[Reason]:
    """Conditions that are not proven; those that depend on the predictor name it, since another one may serve."""
    no_rate = any(item.claim == "26b" and item.margin.hi <= 0 for item in shortfalls)
    reasons = []
    for item in shortfalls:
        beyond = float(item.margin.hi) == -inf
        claim = ConditionHolds(
            section=section,
            condition=item.claim,
            constant=item.constant,
            margin=_known(item.margin),
            needed=item.needed,
            allowed=item.allowed,
            beyond=beyond,
            # (26c) divides by what (26b) leaves
            blocked_by="26b" if beyond and no_rate and item.claim == "26c" else None,
            predictor_gain=gain if item.claim in _OF_PREDICTOR else None,
        )
        relax = UNBOUNDED_RELAX if item.claim == "bounded" else ()
        reasons.append(Reason(claim=claim, verdict=verdict, relax=relax))
    return reasons or [Reason(claim=ConditionHolds(section=section, condition="any_gains"), verdict=verdict)]


def _known(margin: Interval) -> Constant | None:
    """A margin of which at least one side is known."""
    low, high = float(margin.lo), float(margin.hi)
    return None if high == -inf or (low, high) == (-inf, inf) else Constant(below=low, above=high)

"""Why a verdict about gains is what it is: what binds, by how much, what would relax it.

In: the section of a kind, and what halving a constant does to the least Gamma.
Out: the `Reason`s of a certificate.
"""

from __future__ import annotations

from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from tubecert.certificate.result import ClearanceData, InputData
from tubecert.claims.advice import (
    HalveConstant,
    LeavePlanRoom,
    RaiseBudget,
    ReduceRadii,
    ShrinkTube,
)
from tubecert.claims.family import Reason, Relax
from tubecert.claims.statements import ConditionHolds, InputWithinLimits, ObstacleCleared
from tubecert.conditions.inputs import InputBound, LimitedInput
from tubecert.conditions.problem import Shortfall
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.interval import Interval
from tubecert.kinds.kind import Section
from tubecert.search.proposers import Explained
from tubecert.stages.bounded import Bounded
from tubecert.stages.judged import Judged
from tubecert.verdict import Verdict

_OF_PREDICTOR = ("26c", "distance")  # conditions that another predictor may satisfy
_NOTABLE = 0.995  # a factor above it is not worth a word

UNBOUNDED_RELAX: tuple[Relax, ...] = (RaiseBudget(), ShrinkTube())


def reasons(section: Section[Any], explained: Explained) -> list[Reason]:
    """Reasons of one kind: what its gains leave, or what is missing."""
    if section.verdict is Verdict.CERTIFIED:
        return [_certified(section, explained)]
    return _short(section.name.key, section.verdict, section.shortfalls, section.predictor_gain)


def obstacle_reasons(bounded: Bounded) -> list[Reason]:
    """Obstacles that the tube is asked to keep away from, and is not proven to."""
    asked = zip(bounded.question.spec.obstacles, bounded.clearances, strict=True)
    return [
        Reason(
            claim=ObstacleCleared(obstacle=number, clearance=each.clearance),
            verdict=each.verdict,
            at=_witness(bounded, obstacle.states, each),
            relax=(ReduceRadii(),),
        )
        for number, (obstacle, each) in enumerate(asked, start=1)
        if each.decides and each.verdict is not Verdict.CERTIFIED
    ]


def _witness(bounded: Bounded, plane: tuple[str, str], cleared: ClearanceData) -> Witness:
    """The plan where it is nearest, moved to the point of the obstacle that was found."""
    t, states = cleared.t or 0.0, bounded.question.spec.states
    centre, _ = bounded.enclosed.tube.plan.enclose(np.array([t]), np.array([t]))
    x = [float(value) for value in centre.mid[0]]
    if cleared.inside is not None:
        for name, value in zip(plane, cleared.inside, strict=True):
            x[states.index(name)] = value
    return Witness(t=t, x=tuple(x))


def input_reasons(judged: Judged) -> list[Reason]:
    """Inputs that are not proven to stay within their limits, where the gains are proven; and plans that do not."""
    certified = all(judged.sections[key].verdict is Verdict.CERTIFIED for key in judged.deciding)
    return [
        _beyond(own, each, judged.deciding)
        for own, each in zip(judged.bounded.inputs, judged.inputs, strict=True)
        if each.verdict is Verdict.REFUTED or (certified and each.verdict is not Verdict.CERTIFIED)
    ]


def _beyond(own: LimitedInput, judged: InputData, deciding: tuple[str, ...]) -> Reason:
    """By which limit an input misses most, and what takes it there."""
    low, high = own.limits
    if own.leaves is not None:
        upper = own.greatest.below > high
        claim = InputWithinLimits(
            input=own.name,
            side="upper" if upper else "lower",
            limit=high if upper else low,
            plan=own.greatest.below if upper else own.least.above,
        )
        return Reason(claim=claim, verdict=judged.verdict, at=own.leaves, relax=(LeavePlanRoom(),))
    failing = {key: judged.bounds[key] for key in deciding if key in judged.bounds}
    if not failing:
        claim = InputWithinLimits(input=own.name, side="upper", limit=high, plan=None)
        return Reason(claim=claim, verdict=judged.verdict, relax=UNBOUNDED_RELAX)
    section, bound = max(failing.items(), key=lambda item: _excess(own, item[1]))
    upper = Fraction(bound.greatest) - high > low - Fraction(bound.least)
    claim = InputWithinLimits(
        input=own.name,
        side="upper" if upper else "lower",
        limit=high if upper else low,
        plan=own.greatest.above if upper else own.least.below,
        section=section,
        reaches=bound.greatest if upper else bound.least,
        feedback=bound.feedback,
        adaptation=bound.adaptation,
    )
    # without any feedback it would be less by that
    helps = _excess(own, bound) < Fraction(bound.feedback)
    relax = (ShrinkTube(), LeavePlanRoom()) if helps else (LeavePlanRoom(),)
    return Reason(claim=claim, verdict=judged.verdict, relax=relax)


def _excess(own: LimitedInput, bound: InputBound) -> Fraction:
    """By how much a bound exceeds a limit."""
    low, high = own.limits
    return max(low - Fraction(bound.least), Fraction(bound.greatest) - high)


def _certified(section: Section[Any], explained: Explained) -> Reason:
    helps = [HalveConstant(constant=name, factor=x) for name, x in explained.halved.items() if x < _NOTABLE]
    return Reason(claim=section.claim(), verdict=section.verdict, relax=tuple(helps))


def _short(
    section: str, verdict: Verdict, shortfalls: tuple[Shortfall, ...], gain: Fraction | None
) -> list[Reason]:
    """Conditions that are not proven; those that depend on the predictor name it, since another one may serve."""
    no_rate = any(item.claim == "26b" and item.margin.hi <= 0 for item in shortfalls)
    found = []
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
        found.append(Reason(claim=claim, verdict=verdict, relax=relax))
    return found or [Reason(claim=ConditionHolds(section=section, condition="any_gains"), verdict=verdict)]


def _known(margin: Interval) -> Constant | None:
    """A margin of which at least one side is known."""
    low, high = float(margin.lo), float(margin.hi)
    return None if high == -inf or (low, high) == (-inf, inf) else Constant(below=low, above=high)

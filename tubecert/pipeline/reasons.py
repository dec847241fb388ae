"""Why a verdict about gains is what it is: what binds, by how much, what would relax it.

In: the section of a kind, and what halving a constant does to the least Gamma.
Out: the `Reason`s of a certificate.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from math import inf
from typing import Any

import numpy as np

from tubecert.claims import (
    ConditionHolds,
    HalveConstant,
    ObstacleCleared,
    RaiseBudget,
    Reason,
    ReduceRadii,
    Relax,
    ShrinkTube,
)
from tubecert.conditions.verdict import Shortfall, Verdict
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.interval import Interval
from tubecert.kinds.kind import Section
from tubecert.stages.bounded import Bounded, Cleared

_OF_PREDICTOR = ("26c", "distance", "sampled")  # conditions that another predictor may satisfy
_NOTABLE = 0.995  # a factor above it is not worth a word

UNBOUNDED_RELAX: tuple[Relax, ...] = (RaiseBudget(), ShrinkTube())


def reasons(section: Section[Any], halved: Mapping[str, float]) -> list[Reason]:
    """Reasons of one kind: what its gains leave, or what is missing."""
    if section.verdict is Verdict.CERTIFIED:
        return [_certified(section, halved)]
    return _short(section.name.key, section.verdict, section.shortfalls, section.predictor_gain)


def obstacle_reasons(bounded: Bounded) -> list[Reason]:
    """Obstacles that the tube is asked to keep away from, and is not proven to."""
    return [
        Reason(
            claim=ObstacleCleared(obstacle=number, clearance=each.clearance),
            verdict=each.verdict,
            at=_witness(bounded, each),
            relax=(ReduceRadii(),),
        )
        for number, each in enumerate(bounded.clearances, start=1)
        if each.obstacle.decides and each.verdict is not Verdict.CERTIFIED
    ]


def _witness(bounded: Bounded, cleared: Cleared) -> Witness:
    """The plan where it is nearest, moved to the point of the obstacle that was found."""
    t, states = cleared.found.t, bounded.question.spec.states
    centre, _ = bounded.enclosed.tube.plan.enclose(np.array([t]), np.array([t]))
    x = [float(value) for value in centre.mid[0]]
    if cleared.found.inside is not None:
        for name, value in zip(cleared.obstacle.states, cleared.found.inside, strict=True):
            x[states.index(name)] = value
    return Witness(t=t, x=tuple(x))


def _certified(section: Section[Any], halved: Mapping[str, float]) -> Reason:
    relax = tuple(
        HalveConstant(constant=name, factor=factor) for name, factor in halved.items() if factor < _NOTABLE
    )
    return Reason(claim=section.claim(), verdict=section.verdict, relax=relax)


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

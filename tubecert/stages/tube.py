"""The plan, and the radius of the tube around it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from math import isfinite

import numpy as np

from tubecert.bounds.compute import Radius, least_radius
from tubecert.bounds.constants import Witness
from tubecert.bounds.level import Proposed, greatest_level, least_level
from tubecert.bounds.suprema import Suprema
from tubecert.certificate.sections import declared_metric
from tubecert.claims.advice import (
    DeclareMetricBound,
    EnlargeSafeSet,
    FitTube,
    RaiseBudget,
    ReduceInitialError,
)
from tubecert.claims.family import Claim, Relax, Side
from tubecert.claims.statements import PlanBounded, PlanInSafeSet, StartInTube, TubeInSafeSet, TubeRadius
from tubecert.coordinates import Coordinates
from tubecert.enclosure.constant import Constant, printable_below
from tubecert.enclosure.interval import Interval, sqrt
from tubecert.expression import number_text
from tubecert.records import Json
from tubecert.spec import Knots
from tubecert.stages.metric import ProvenMetric
from tubecert.stages.question import Question, Stopped, stopped
from tubecert.trajectory import Plan
from tubecert.trajectory.make import Room, plan_of
from tubecert.tube import Containment
from tubecert.verdict import Verdict


@dataclass(frozen=True, kw_only=True)
class Planned:
    """The plan that the tube is to surround: it begins, ends and moves as the specification asks."""

    metric: ProvenMetric
    plan: Plan

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.metric.question

    @cached_property
    def ground(self) -> Json:
        """Everything that the tube and the constants over it follow from, as data."""
        knots = self.plan.knots
        texts = [] if knots is None else [*map(number_text, knots.t), *_texts((*knots.x, *knots.u))]
        return self.question.ground | {"knots": texts}


@dataclass(frozen=True, kw_only=True)
class TubeFound:
    """The tube lies in the safe set, and rho >= sqrt(A/a)|x*(0) - x(0)| + epsilon + rho_a with a, A over the tube.

    With `coordinates` S, the tube is |S (x - x*)| <= rho, |x_i - x*_i| <= sides_i, and a curve from x* that leaves it
    is at least sqrt(a) rho long; the radii are lengths in z = S x. Where half-widths are asked for, no side exceeds
    them, and the radii are what the start leaves of rho.
    """

    planned: Planned
    rho: Fraction
    lower: Constant
    upper: Constant
    contained: Containment
    radii: tuple[Fraction, Fraction]
    coordinates: Coordinates | None = None
    sides: tuple[Fraction, ...] | None = None

    def __post_init__(self) -> None:
        if self.contained.verdict is not Verdict.CERTIFIED:
            raise ValueError("the tube is not proven to lie in the safe set")
        if (self.coordinates is None) != (self.sides is None):
            raise ValueError("coordinates and half-widths come together")

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.planned.question

    @property
    def plan(self) -> Plan:
        """The plan in its middle."""
        return self.planned.plan

    @cached_property
    def ground(self) -> Json:
        """Everything that the constants over the tube follow from, as data."""
        return self.planned.ground | {"shape": _shape(self.coordinates, self.rho, self.sides or ())}


def radii(question: Question) -> tuple[Fraction, Fraction]:
    """(epsilon, rho_a) as they are asked for."""
    tube = question.spec.tube
    if tube.epsilon is None or tube.rho_a is None:
        raise ValueError("epsilon and rho_a are needed")
    return tube.epsilon, tube.rho_a


def asked_half_widths(question: Question) -> tuple[Fraction | None, ...] | None:
    """The half-widths that are asked for, by state and output; None where the radii are given instead."""
    asked = dict(question.spec.tube.half_widths)
    return tuple(map(asked.get, question.spec.lengths)) if asked else None


def room_of(metric: ProvenMetric) -> Room:
    """What a plan's defect is measured against: the least tube that there can be, or about that."""
    question = metric.question
    widths = [width for _, width in question.spec.tube.half_widths]
    # a state that is off by r, the least of what is asked for, is sqrt(a) r away in the metric at least
    rho = min(widths) if widths else sum(radii(question), Fraction(0))
    return Room(rho=rho, lower=metric.lower.below, effort=question.effort)


def lay(metric: ProvenMetric, proposed: Knots | None = None) -> Planned:
    """The plan, through the knots of a planner where one is asked for; raises `SpecError` if they are not that plan."""
    question = metric.question
    return Planned(metric=metric, plan=plan_of(question.spec, question.model, proposed))


def find_tube(planned: Planned, proposed: tuple[Coordinates, Proposed] | None = None) -> TubeFound | Stopped:
    """The least tube, or the widest that was asked for, proven, or why there is none.

    Coordinates of its own are proposed; they are needed where the specification asks for them.
    """
    question = planned.question
    if question.spec.tube.auto != (proposed is not None):
        raise ValueError("coordinates are proposed where the specification asks for them, and nowhere else")
    if (outside := _start_outside(planned)) is not None:
        return outside
    coordinates = None if proposed is None else proposed[0]
    suprema = replace(question.suprema(planned.plan), coordinates=coordinates)
    wanted = None if proposed is None else proposed[1]
    shape = None if wanted is None else _shape(coordinates, wanted.rho, wanted.sides)
    radius = question.memory.recall(
        "radius", planned.ground | {"proposed": shape}, lambda: _radius(question, suprema, wanted)
    )
    if radius.obstacle is not None:
        return stopped(
            planned,
            TubeRadius(obstacle=radius.obstacle, radius=radius.rho),
            Verdict.UNDECIDED,
            relax=(ReduceInitialError(), DeclareMetricBound(), RaiseBudget()),
        )
    contained = radius.contained
    if contained.verdict is not Verdict.CERTIFIED or radius.lower is None or radius.upper is None:
        return _leaving(planned, radius)
    return TubeFound(
        planned=planned,
        rho=radius.rho,
        lower=radius.lower,
        upper=radius.upper,
        contained=contained,
        radii=_radii(question, suprema, radius, (radius.lower, radius.upper)),
        coordinates=coordinates,
        sides=radius.sides,
    )


def _shape(coordinates: Coordinates | None, rho: Fraction, sides: tuple[Fraction, ...]) -> Json:
    rows = None if coordinates is None else _texts(coordinates.rows)
    return [rows, number_text(rho), *map(number_text, sides)]


def _texts(rows: Iterable[Iterable[Fraction]]) -> list[str]:
    return [", ".join(map(number_text, row)) for row in rows]


def _radius(question: Question, suprema: Suprema, proposed: Proposed | None) -> Radius:
    safe_set, asked = question.spec.safe_set, asked_half_widths(question)
    if proposed is not None and asked is not None:
        return greatest_level(suprema, safe_set, asked, proposed)
    offset, width = question.start.offset(suprema), sum(radii(question), Fraction(0))
    if proposed is not None:
        return least_level(suprema, safe_set, offset, width, proposed)
    return least_radius(suprema, safe_set, offset, width, declared_metric(question.spec))


def _radii(
    question: Question, suprema: Suprema, radius: Radius, metric: tuple[Constant, Constant]
) -> tuple[Fraction, Fraction]:
    """(epsilon, rho_a): as given, or, within half-widths, the two halves of what the start leaves of rho.

    Theorems use rho_r + rho_a <= rho only. Where the start leaves nothing, no kind holds, whatever the split.
    """
    if asked_half_widths(question) is None:
        return radii(question)
    start = question.start.distance(suprema.with_radius(radius.rho, radius.sides), metric)
    used = float((Interval.exact(start.above) / sqrt(Interval.exact(metric[0].below))).hi)
    left = radius.rho - Fraction(used) if isfinite(used) and used < radius.rho else radius.rho
    rho_a = question.spec.tube.rho_a
    if rho_a is None or rho_a >= left:
        rho_a = Fraction(repr(printable_below(left / 2)))
    return Fraction(repr(printable_below(left - rho_a))), rho_a


def _leaving(planned: Planned, radius: Radius) -> Stopped:
    """What is claimed of a tube that is not proven to lie in the safe set, and what would fit."""
    contained = radius.contained
    # half-widths bound what a tube reaches, one of many; of a plan that is not known there are others, too
    refutes = planned.question.spec.trajectory.known and (radius.sides is None or contained.outside)
    return stopped(
        planned,
        _claim(radius),
        contained.verdict if refutes else Verdict.UNDECIDED,
        where=Witness(t=contained.t, x=contained.x),
        relax=(*_fitting(planned.question, radius), EnlargeSafeSet()),
        partial=radius,
    )


def _fitting(question: Question, radius: Radius) -> tuple[Relax, ...]:
    """The radii that would fit where the plan has room; half-widths are made to fit."""
    contained = radius.contained
    if not contained.state or contained.outside or contained.room <= 0 or question.spec.tube.half_widths:
        return ()
    side = radius.rho if radius.sides is None else radius.sides[question.spec.states.index(contained.state)]
    return (FitTube(most=float(contained.room) * float(radius.rho / side)),)


def _claim(radius: Radius) -> Claim:
    contained = radius.contained
    if not contained.state:
        return PlanBounded()
    side: Side = "upper" if contained.side == "upper" else "lower"
    excess = float(contained.excess)
    if contained.outside:
        return PlanInSafeSet(state=contained.state, side=side, excess=excess)
    return TubeInSafeSet(radius=radius.rho, state=contained.state, side=side, excess=excess)


def _start_outside(planned: Planned) -> Stopped | None:
    """A start that is farther from the plan's than a half-width that is asked for, in the state where it is most."""
    question = planned.question
    spec, asked = question.spec, dict(question.spec.tube.half_widths)
    ends = spec.start_box or tuple((value, value) for value in spec.x0)
    centre, _ = planned.plan.enclose(np.zeros(1), np.zeros(1))
    worst: tuple[Fraction, str, Witness] | None = None
    for i, name in enumerate(spec.states):
        if name not in asked or not np.isfinite([centre.lo[0, i], centre.hi[0, i]]).all():
            continue
        low, high = Fraction(float(centre.lo[0, i])), Fraction(float(centre.hi[0, i]))
        for apart, end in ((ends[i][1] - high, 1), (low - ends[i][0], 0)):
            off = apart if spec.within is None else spec.within
            at = Witness(t=0.0, x=tuple(float(pair[end]) for pair in ends) if spec.within is None else ())
            if off > asked[name] and (worst is None or off / asked[name] > worst[0] / asked[worst[1]]):
                worst = off, name, at
    if worst is None:
        return None
    off, name, at = worst
    claim = StartInTube(state=name, off=float(off), half_width=asked[name])
    verdict = Verdict.REFUTED if spec.within is not None or spec.trajectory.known else Verdict.UNDECIDED
    return stopped(planned, claim, verdict, where=at, relax=(ReduceInitialError(),))

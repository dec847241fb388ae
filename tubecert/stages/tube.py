"""The plan, and the radius of the tube around it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.bounds.compute import Radius, least_radius
from tubecert.bounds.constants import Witness
from tubecert.claims import (
    Claim,
    DeclareMetricBound,
    EnlargeSafeSet,
    PlanBounded,
    RaiseBudget,
    ReduceInitialError,
    ReduceRadii,
    Side,
    TubeInSafeSet,
    TubeRadius,
)
from tubecert.enclosure.constant import Constant
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


@dataclass(frozen=True, kw_only=True)
class TubeFound:
    """O(rho) lies in the safe set, and rho >= sqrt(A/a)|x*(0) - x(0)| + epsilon + rho_a with a, A over O(rho)."""

    planned: Planned
    rho: Fraction
    lower: Constant
    upper: Constant
    contained: Containment

    def __post_init__(self) -> None:
        if self.contained.verdict is not Verdict.CERTIFIED:
            raise ValueError("the tube is not proven to lie in the safe set")

    @property
    def question(self) -> Question:
        """What is asked."""
        return self.planned.question

    @property
    def plan(self) -> Plan:
        """The plan in its middle."""
        return self.planned.plan


def radii(question: Question) -> tuple[Fraction, Fraction]:
    """(epsilon, rho_a)."""
    tube = question.spec.tube
    if tube.epsilon is None or tube.rho_a is None:
        raise ValueError("epsilon and rho_a are needed")
    return tube.epsilon, tube.rho_a


def room_of(metric: ProvenMetric) -> Room:
    """What a plan's defect is measured against: the least tube that there can be."""
    epsilon, rho_a = radii(metric.question)
    return Room(rho=epsilon + rho_a, lower=metric.lower.below, effort=metric.question.effort)


def lay(metric: ProvenMetric, proposed: Knots | None = None) -> Planned:
    """The plan, through the knots of a planner where one is asked for; raises `SpecError` if they are not that plan."""
    question = metric.question
    return Planned(metric=metric, plan=plan_of(question.spec, question.model, proposed))


def find_tube(planned: Planned) -> TubeFound | Stopped:
    """The least radius, proven, or why there is none."""
    question = planned.question
    suprema = question.suprema(planned.plan)
    width = sum(radii(question), Fraction(0))
    offset = question.start.offset(suprema)
    radius = least_radius(suprema, question.spec.safe_set, offset, width, question.declared_metric)
    if radius.obstacle is not None:
        return stopped(
            planned,
            TubeRadius(obstacle=radius.obstacle, radius=radius.rho),
            Verdict.UNDECIDED,
            relax=(ReduceInitialError(), DeclareMetricBound(), RaiseBudget()),
        )
    contained = radius.contained
    if contained.verdict is not Verdict.CERTIFIED or radius.lower is None or radius.upper is None:
        return stopped(
            planned,
            _claim(radius),
            contained.verdict,
            where=Witness(t=contained.t, x=contained.x),
            relax=(ReduceRadii(), EnlargeSafeSet()),
            partial=radius,
        )
    return TubeFound(
        planned=planned, rho=radius.rho, lower=radius.lower, upper=radius.upper, contained=contained
    )


def _claim(radius: Radius) -> Claim:
    """What is claimed of a tube that is not proven to lie in the safe set."""
    contained = radius.contained
    if not contained.state:
        return PlanBounded()
    side: Side = "upper" if contained.side == "upper" else "lower"
    return TubeInSafeSet(radius=radius.rho, state=contained.state, side=side, excess=contained.excess)

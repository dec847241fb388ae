"""How a certification ended as the `Result` of a certificate: what its last stage holds, and those before it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction

from tubecert.bounds.compute import Radius
from tubecert.certificate.effective import Effective
from tubecert.certificate.file import digest
from tubecert.certificate.result import (
    Bound,
    Geodesics,
    MetricData,
    Overrides,
    PlanData,
    Recipes,
    Result,
    Source,
    TubeData,
    Work,
)
from tubecert.certificate.sections import (
    assumptions,
    claim_data,
    constant_data,
    declared_data,
    metric_data,
    plan_data,
)
from tubecert.claims.family import Reason
from tubecert.conditions.theorem import Recipe
from tubecert.expression import number_text
from tubecert.letters import ALL, name_of
from tubecert.metric.verify import MetricProof
from tubecert.printable import visible
from tubecert.spec import Spec, canonical
from tubecert.stages.bounded import Bounded, Enclosed
from tubecert.stages.judged import Judged
from tubecert.stages.metric import ProvenMetric
from tubecert.stages.question import Options, Question, Stopped, period_of
from tubecert.stages.tube import Planned, TubeFound, asked_half_widths, radii

Stage = Question | ProvenMetric | Planned | TubeFound | Enclosed | Bounded | Judged


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """What explains a verdict on gains, in numbers that no claim rests on: reasons, and elasticities by kind."""

    reasons: Sequence[Reason] = ()
    elasticities: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reached:
    """The stages that were reached, and what was found on the way to the one that failed."""

    question: Question
    metric: ProvenMetric | None = None
    planned: Planned | None = None
    enclosed: Enclosed | None = None
    bounded: Bounded | None = None
    judged: Judged | None = None
    partial: object = None


def result_of(end: Stage | Stopped, why: Explanation) -> Result:
    """The `Result` for the end of a certification: a verdict on gains, or the claim that ended it before.

    Raises `TypeError` for a stage that is not the last.
    """
    if isinstance(end, Stopped):
        reached = replace(_reached(end.at), partial=end.partial)
        verdict, reasons = end.reason.verdict, [end.reason]
    elif isinstance(end, Judged):
        reached, verdict, reasons = _reached(end), end.verdict, list(why.reasons)
    else:
        raise TypeError("a certification ends in a verdict")
    question, judged, bounded = reached.question, reached.judged, reached.bounded
    spec, options = question.spec, question.options
    return Result(
        verdict=verdict,
        spec=_source(spec),
        claim=claim_data(spec, period_of(spec)),
        overrides=_overrides(spec, options),
        effort=Work(
            gap=options.gap,
            budget=options.budget,
            gaps=_gaps(reached),
        ),
        plan=_plan(reached),
        safe_set=dict(zip(spec.states, spec.safe_set, strict=True)),
        assumptions=assumptions(spec, question.model, None if bounded is None else bounded.geodesics),
        declared=declared_data(spec),
        reasons=tuple(reasons),
        proof=Recipes(of=_recipes(judged)),
        synthesis=question.synthesis,
        metric=_metric(reached),
        tube=_tube(reached),
        clearance=() if bounded is None else bounded.clearances,
        inputs=() if judged is None else judged.inputs,
        constants=_constants(reached),
        sections={} if judged is None else {key: each.data() for key, each in judged.sections.items()},
        elasticities=None if judged is None else why.elasticities,
        decided_by=() if judged is None else judged.deciding,
    )


def _reached(stage: Stage) -> _Reached:
    match stage:
        case Question():
            return _Reached(question=stage)
        case ProvenMetric():
            return replace(_reached(stage.question), metric=stage)
        case Planned():
            return replace(_reached(stage.metric), planned=stage)
        case TubeFound():
            return _reached(stage.planned)
        case Enclosed():
            return replace(_reached(stage.tube), enclosed=stage)
        case Bounded():
            return replace(_reached(stage.enclosed), bounded=stage)
        case Judged():
            return replace(_reached(stage.bounded), judged=stage)


def _source(spec: Spec) -> Source:
    effective = canonical(spec)
    return Source(
        effective=Effective.of(effective),
        effective_hash=digest(effective),
        file_hash="sha256:" + hashlib.sha256(spec.source.encode()).hexdigest(),
    )


def _overrides(spec: Spec, options: Options) -> Overrides:
    return Overrides(
        rho_a=options.rho_a,
        epsilon=options.epsilon,
        bandwidth=options.bandwidth,
        adaptation_rate=options.adaptation_rate,
        conditions=_decides_instead(spec, options),
        metric=None if options.metric is None else visible(options.metric.name),
        settings=dict(spec.settings),
    )


def _decides_instead(spec: Spec, options: Options) -> str | None:
    """The letter of the kind that was asked for in place of the one that the specification names."""
    if options.conditions is None or spec.decides is None:
        return None
    return ALL if options.conditions == ALL else name_of(options.conditions).letter


def _plan(reached: _Reached) -> PlanData:
    spec, planned = reached.question.spec, reached.planned
    return PlanData(kind=spec.trajectory.kind) if planned is None else plan_data(spec, planned.plan)


def _metric(reached: _Reached) -> MetricData | None:
    """C1-C3 as far as they were decided, then the bounds over the tube, then the test of its geodesics."""
    proof = reached.partial if reached.metric is None else reached.metric.proof
    if not isinstance(proof, MetricProof):
        return None
    data = metric_data(reached.question.spec, proof)
    if reached.enclosed is None:
        return data
    constants, bounded = reached.enclosed.constants, reached.bounded
    return replace(
        data,
        lower=constants.lower,
        upper=constants.upper,
        unique_geodesics=None
        if bounded is None
        else Geodesics(value=bounded.geodesics.value.printable(), holds=bounded.geodesics.holds),
    )


def _tube(reached: _Reached) -> TubeData | None:
    """The radii, once the tube is bounded; before that the radius that failed, if one did."""
    bounded, failed = reached.bounded, reached.partial
    if isinstance(failed, Radius):
        if asked_half_widths(reached.question) is not None:  # there are no radii yet
            return None
        epsilon, rho_a = radii(reached.question)
        return TubeData(epsilon=epsilon, rho_a=rho_a, rho=failed.rho)
    if bounded is None:
        return None
    tube = bounded.enclosed.tube
    epsilon, rho_a = tube.radii
    rows = None if tube.coordinates is None else tube.coordinates.rows
    return TubeData(
        epsilon=epsilon,
        rho_a=rho_a,
        rho=tube.rho,
        rho_r=tube.rho - rho_a,
        half_widths=dict(bounded.half_widths),
        coordinates=None if rows is None else tuple(tuple(map(number_text, row)) for row in rows),
    )


def _gaps(reached: _Reached) -> dict[str, Fraction]:
    """Those of the constants that the certificate has."""
    own = {} if reached.enclosed is None else reached.enclosed.gaps
    return {name: own[name] for name in _constants(reached) if name in own}


def _constants(reached: _Reached) -> dict[str, Bound]:
    """Those over the tube, and those at the gains found."""
    enclosed, judged = reached.enclosed, reached.judged
    if enclosed is None:
        return {}
    all_of_tube = [*enclosed.constants.items(), *enclosed.problem.beside()]
    own = {name: constant_data(value, meaning) for name, value, meaning in all_of_tube}
    derived = {} if judged is None else judged.derived()
    return own | {name: constant_data(value, meaning) for name, (value, meaning) in derived.items()}


def _recipes(judged: Judged | None) -> dict[str, Recipe]:
    """What proves the gains of each kind that is certified."""
    sections = {} if judged is None else judged.sections
    return {key: each.proof.recipe for key, each in sections.items() if each.proof is not None}

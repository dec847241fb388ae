"""Any stage as `result` of a certificate: what it holds, and what the stages before it hold."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from tubecert.bounds.compute import Radius
from tubecert.certificate.file import digest
from tubecert.certificate.sections import (
    assumptions,
    claim_data,
    constant_data,
    decimal_data,
    declared_data,
    metric_data,
    pair_data,
    plan_data,
    safe_set_data,
)
from tubecert.claims import Reason
from tubecert.metric.verify import MetricProof
from tubecert.records import to_json
from tubecert.spec import canonical
from tubecert.stages.bounded import Bounded, Enclosed
from tubecert.stages.judged import Judged
from tubecert.stages.metric import ProvenMetric
from tubecert.stages.options import overrides_data
from tubecert.stages.question import Question, Stopped
from tubecert.stages.time import period_of
from tubecert.stages.tube import Planned, TubeFound, radii

Result = dict[str, Any]
Stage = Question | ProvenMetric | Planned | TubeFound | Enclosed | Bounded | Judged


@dataclass(frozen=True, slots=True, kw_only=True)
class Explanation:
    """What explains a verdict on gains, in numbers that no claim rests on: reasons, and elasticities by kind."""

    reasons: Sequence[Reason] = ()
    elasticities: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def result_of(end: Stage | Stopped, why: Explanation) -> Result:
    """The `result` for the last stage that was reached, with the claim that ended it, if one did."""
    if not isinstance(end, Stopped):
        return _stage(end) | {"reasons": to_json(list(why.reasons)), "elasticities": dict(why.elasticities)}
    data = _stage(end.at) | {"reasons": [to_json(end.reason)], "verdict": str(end.reason.verdict)}
    if isinstance(end.partial, MetricProof):
        return data | {"metric": metric_data(end.question.spec, end.partial)}
    if isinstance(end.partial, Radius):
        return data | {"tube": _radii(end.question) | {"rho": decimal_data(end.partial.rho)}}
    return data


def _stage(stage: Stage) -> Result:
    """What a stage adds, to what those before it hold."""
    match stage:
        case Question():
            return _question(stage)
        case ProvenMetric():
            metric = metric_data(stage.question.spec, stage.proof)
            return _stage(stage.question) | {"metric": metric}
        case Planned():
            return _stage(stage.metric) | {"plan": plan_data(stage.question.spec, stage.plan)}
        case TubeFound():
            return _stage(stage.planned)
        case Enclosed():
            return _enclosed(stage)
        case Bounded():
            return _bounded(stage)
        case Judged():
            return _judged(stage)


def _question(question: Question) -> Result:
    spec, options = question.spec, question.options
    text = canonical(spec)
    data = {
        "formulas": options.formulas,
        "spec": {
            "effective": text,
            "effective_hash": digest(text),
            "file_hash": "sha256:" + hashlib.sha256(spec.source.encode()).hexdigest(),
        },
        "claim": claim_data(spec, period_of(spec)),
        "overrides": overrides_data(options),
        "effort": {"gap": decimal_data(options.gap), "budget": options.budget},
        "plan": {"kind": spec.trajectory.kind},
        "safe_set": safe_set_data(spec),
        "assumptions": to_json(assumptions(spec, question.model)),
        "declared": declared_data(spec),
        "proof": {},
    }
    return data if question.synthesis is None else data | {"synthesis": dict(question.synthesis)}


def _enclosed(stage: Enclosed) -> Result:
    data, constants = _stage(stage.tube), stage.constants
    bounds = {"lower": pair_data(constants.lower), "upper": pair_data(constants.upper)}
    return data | {
        "metric": data["metric"] | bounds,
        "constants": {name: constant_data(value, meaning) for name, value, meaning in constants.items()},
    }


def _bounded(stage: Bounded) -> Result:
    data, rho = _stage(stage.enclosed), stage.enclosed.tube.rho
    _, rho_a = radii(stage.question)
    unique = {"value": pair_data(stage.geodesics.value.printable()), "holds": stage.geodesics.holds}
    return data | {
        "tube": _radii(stage.question)
        | {
            "rho_r": decimal_data(rho - rho_a),
            "rho": decimal_data(rho),
            "half_widths": dict(stage.half_widths),
        },
        "metric": data["metric"] | {"unique_geodesics": unique},
        "assumptions": to_json(assumptions(stage.question.spec, stage.question.model, stage.geodesics)),
    }


def _judged(stage: Judged) -> Result:
    data, sections = _stage(stage.bounded), stage.sections
    derived = {name: constant_data(value, meaning) for name, (value, meaning) in stage.derived().items()}
    return data | {
        **{key: to_json(section.data()) for key, section in sections.items()},
        "constants": data["constants"] | derived,
        "proof": {
            key: to_json(section.proof.recipe)
            for key, section in sections.items()
            if section.proof is not None
        },
        "decided_by": list(stage.deciding),
        "verdict": str(stage.verdict),
    }


def _radii(question: Question) -> Result:
    epsilon, rho_a = radii(question)
    return {"epsilon": decimal_data(epsilon), "rho_a": decimal_data(rho_a)}

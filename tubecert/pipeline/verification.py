"""A metric alone: whether C1-C3 hold on the safe set, up to which rate, and how ill-conditioned it is.

In: a specification with a metric; plan, uncertainty, tube and loop do not matter. Out: what is proven of the metric.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import isfinite

from tubecert.certificate.result import MetricFile, SolverData, metric_file
from tubecert.certificate.sections import metric_data
from tubecert.claims.family import Reason
from tubecert.claims.statements import MetricContraction, RankOfB
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Constant, Witness
from tubecert.expression import free_symbols
from tubecert.metric.verify import MetricProof, supported_rate, verify_metric
from tubecert.model import build, rank_decision
from tubecert.progress import Phase, Progress
from tubecert.spec import Spec
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Verified:
    """What is known of a metric on a safe set.

    `reason` is the claim that fails, None if C1-C3 hold at `rate`. `largest_rate`: the supremum of the rates for which
    C2 holds, which says nothing about C3; `lower` I <= M <= `upper` I. What is None was not reached.
    """

    name: str
    states: tuple[str, ...]
    safe_set: Mapping[str, tuple[Fraction, Fraction]]
    rate: Fraction
    verdict: Verdict
    reason: Reason | None = None
    largest_rate: Constant | None = None
    condition_number: Constant | None = None
    lower: Constant | None = None
    upper: Constant | None = None
    file: MetricFile | None = field(default=None, repr=False)


def verify(spec: Spec, effort: Effort, progress: Progress | None = None) -> Verified:
    """Decide the metric of a specification; raises `ValueError` if it has none."""
    metric = spec.metric
    if metric is None:
        raise ValueError("there is no metric")
    model = build(spec)
    known = Verified(
        name=spec.name,
        states=spec.states,
        safe_set=dict(zip(spec.states, spec.safe_set, strict=True)),
        rate=metric.rate,
        verdict=Verdict.UNDECIDED,
    )
    rank = rank_decision(model, spec.safe_set, effort)
    if rank.verdict is not Verdict.CERTIFIED:
        at = Witness(x=tuple(rank.at.get(name, 0.0) for name in spec.states))
        return replace(
            known, verdict=rank.verdict, reason=Reason(claim=RankOfB(), verdict=rank.verdict, at=at)
        )
    proof = verify_metric(model, spec.safe_set, _told(effort, "C1-C3", progress), closely=True)
    if proof.lower_on_set is None or proof.upper_on_set is None:
        return replace(known, verdict=proof.verdict, reason=_reason(proof, proof.largest_rate))
    lower, upper = proof.lower_on_set, proof.upper_on_set
    largest = proof.largest_rate
    if largest is None or largest.gap > effort.gap:
        found = supported_rate(model, spec.safe_set, _told(effort, "largest rate", progress))
        largest = found if largest is None else _both(largest, found)
    return replace(
        known,
        verdict=proof.verdict,
        reason=_reason(proof, largest),
        largest_rate=largest.printable() if isfinite(largest.below) else largest,
        condition_number=proof.condition_number().printable(),
        lower=lower.printable(),
        upper=upper.printable(),
        file=_file(spec, proof),
    )


def _both(one: Constant, other: Constant) -> Constant:
    """Two enclosures of one number, together."""
    return Constant(
        below=max(one.below, other.below), above=min(one.above, other.above), at=other.at or one.at
    )


def _reason(proof: MetricProof, largest: Constant | None) -> Reason | None:
    claim = proof.failed
    if claim is None:
        return None
    if isinstance(claim, MetricContraction) and largest is not None:
        claim = MetricContraction(rate=claim.rate, largest_rate=largest)
    return Reason(claim=claim, verdict=proof.verdict, at=proof.at)


def _told(effort: Effort, name: str, progress: Progress | None) -> Effort:
    if progress is None:
        return effort
    show = progress
    return replace(effort, progress=lambda step: show(replace(step, phase=Phase.VERIFICATION, name=name)))


def _file(spec: Spec, proof: MetricProof) -> MetricFile | None:
    """The metric as a file, if it is proven."""
    if proof.failed is not None:
        return None
    entries = free_symbols(e for row in proof.model.W for e in row)
    variables = tuple(name for name in spec.states if name in entries)
    given = SolverData(route="given", degree=1 if variables else 0, variables=variables, digits=17)
    return metric_file(dict(zip(spec.states, spec.safe_set, strict=True)), metric_data(spec, proof), given)

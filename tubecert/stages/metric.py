"""The metric: B has full rank, C1-C3 hold on the whole safe set, and so do the bounds that were declared."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from operator import gt, lt

from tubecert.claims.advice import DeclareMetricBound, LowerRate, OtherMetric, RaiseBudget
from tubecert.claims.family import Relax, Side
from tubecert.claims.statements import MetricBound, MetricContraction, MetricKilling, RankOfB
from tubecert.enclosure.constant import Constant, Witness
from tubecert.metric.verify import MetricProof
from tubecert.model import rank_decision
from tubecert.records import Json
from tubecert.spec import canonical
from tubecert.stages.question import Question, Stopped, stopped
from tubecert.verdict import Verdict


@dataclass(frozen=True, kw_only=True)
class ProvenMetric:
    """C1, C2 and C3 hold on the whole safe set, and M >= lower I there."""

    question: Question
    proof: MetricProof
    lower: Constant

    def __post_init__(self) -> None:
        question = self.question
        about = self.proof.is_about(question.model, question.spec.safe_set)
        if self.proof.failed is not None or self.proof.lower_on_set is None or not about:
            raise ValueError("the metric is not proven")


def prove_metric(question: Question) -> ProvenMetric | Stopped:
    """The metric of the specification, proven; depends on system, safe set and metric alone."""
    spec, model = question.spec, question.model
    rank = question.memory.recall(
        "rank", _on(question), lambda: rank_decision(model, spec.safe_set, question.effort)
    )
    if rank.verdict is not Verdict.CERTIFIED:
        x = tuple(rank.at.get(name, 0.0) for name in model.states)
        return stopped(question, RankOfB(), rank.verdict, where=Witness(x=x))
    proof = question.memory.recall(
        "metric",
        _on(question),
        lambda: question.memory.proofs.of(model, spec.safe_set, question.effort_of("metric")),
    )
    if proof.failed is not None:
        at = proof.at if proof.verdict is Verdict.REFUTED else None
        return stopped(question, proof.failed, proof.verdict, where=at, relax=_relax(proof), partial=proof)
    if proof.lower_on_set is None or proof.upper_on_set is None:
        raise ValueError("a proven metric has bounds")
    broken = _declared(question, proof, proof.lower_on_set, proof.upper_on_set)
    return broken or ProvenMetric(question=question, proof=proof, lower=proof.lower_on_set)


def _on(question: Question) -> Json:
    """Everything that a claim on the safe set follows from."""
    whole = canonical(question.spec)
    parts = {key: whole.get(key) for key in ("system", "safe_set", "metric", "owed")}
    if question.model.time is not None:
        parts["horizon"] = str(question.model.time[1])
    return parts | {"gap": str(question.options.gap), "budget": question.options.budget}


def _relax(proof: MetricProof) -> tuple[Relax, ...]:
    if proof.verdict is Verdict.UNDECIDED and not isinstance(proof.failed, MetricKilling):
        return (RaiseBudget(), LowerRate())
    if proof.largest_rate is None or not isinstance(proof.failed, MetricContraction):
        return (OtherMetric(),)
    return (LowerRate(to=proof.largest_rate.below), OtherMetric())


def _declared(question: Question, proof: MetricProof, least: Constant, most: Constant) -> Stopped | None:
    """The bounds a, A that a specification may declare must hold on the safe set."""
    metric = question.spec.metric
    if metric is None:
        raise ValueError("there is no metric")
    sides: tuple[tuple[Side, Fraction | None, Constant, float, float], ...] = (
        ("lower", metric.lower, least, least.below, least.above),
        ("upper", metric.upper, most, most.above, most.below),
    )
    for side, declared, value, proven, reaches in sides:
        beyond = lt if side == "lower" else gt
        if declared is not None and beyond(proven, declared):
            return stopped(
                question,
                MetricBound(side=side, declared=declared, reaches=finite(reaches)),
                Verdict.REFUTED if beyond(reaches, declared) else Verdict.UNDECIDED,
                where=value.at,
                relax=(DeclareMetricBound(side=side, value=finite(proven)),),
                partial=proof,
            )
    return None


def finite(value: float) -> float | None:
    """A number, None where there is no bound."""
    return value if isfinite(value) else None

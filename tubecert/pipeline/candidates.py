"""What a metric comes to in the end: a certification with it, as far as it is needed to compare metrics.

In: a specification with a proven metric in it. Out: the gains that the deciding theorems certify, or the claim that
fails. What only explains or describes a certificate is left out; what is certified here is the kernel's word.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, isfinite, sqrt
from typing import Any

from tubecert.claims.advice import MendPlan
from tubecert.claims.family import Claim
from tubecert.conditions.problem import TubeProblem
from tubecert.conditions.theorem import Asked
from tubecert.kernel import overall
from tubecert.kinds import ALONE, DISTANCE
from tubecert.kinds.kind import Pair, Section, SectionData
from tubecert.kinds.table import kind_of
from tubecert.pipeline.certification import defect_share, mending, plan, tube
from tubecert.pipeline.reasons import reasons
from tubecert.pipeline.synthesised import Row
from tubecert.pipeline.width import Measure
from tubecert.search.proposers import LEAST, PROPOSERS, Explained
from tubecert.stages.bounded import Enclosed, enclose, half_widths, unmet
from tubecert.stages.judged import deciding
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.stages.question import Question, Stopped
from tubecert.synthesis.rounding import VerifiedMetric
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """How a certification ends: with the constants of the tube and the sections of kinds, or at a claim that fails."""

    enclosed: Enclosed | None = None
    sections: tuple[Section[Any], ...] = ()
    claim: Claim | None = None
    verdict: Verdict


def ending(question: Question, metric: VerifiedMetric) -> Ending:
    """The end of the question, whose metric is the one given."""
    proven = _proven(question, metric)
    if isinstance(proven, Stopped):
        return _stopped(proven)
    found = tube(plan(proven))
    if isinstance(found, Stopped):
        return _stopped(found)
    enclosed = enclose(found)
    if (broken := unmet(enclosed)) is not None:
        return _stopped(broken)
    return _judged(question, enclosed)


def judged_row(row: Row, question: Question, outputs: Measure | None = None) -> Row:
    """The row with what its metric comes to, by the width of the tube in `outputs` where those count."""
    end = ending(question, row.metric)
    row = replace(row, verdict=end.verdict, claim=end.claim)
    if end.enclosed is None:
        return row
    problem, by_key = end.enclosed.problem, {section.name.key: section for section in end.sections}
    gain, lower = problem.constants.metric_input_gain.above, problem.constants.lower.below
    distance = by_key[DISTANCE.key]
    least = distance.at(LEAST)
    decisive = next((found for section in end.sections if (found := _pair(question, section.data()))), None)
    return replace(
        row,
        alone=by_key[ALONE.key].verdict is Verdict.CERTIFIED,
        mend=_mend(end.enclosed) if end.verdict is not Verdict.CERTIFIED else None,
        input_gain=gain / sqrt(lower) if isfinite(gain) else None,
        rho=float(problem.rho),
        width=None if outputs is None else outputs.of(half_widths(end.enclosed)),
        ultimate_radius=distance.ultimate_radius,
        adaptation_rate=None if least is None else float(least.recipe.adaptation_rate),
        bandwidth=None if decisive is None or decisive.bandwidth is None else float(decisive.bandwidth),
        demand=_demand(decisive, problem),
    )


def _mend(enclosed: Enclosed) -> MendPlan | None:
    """What the plan lacks, where its defect alone takes the whole tube."""
    allowed = enclosed.tube.plan.allowance is not None  # then it is nobody's
    return None if allowed or defect_share(enclosed.problem) < 1 else mending(enclosed)


def _proven(question: Question, metric: VerifiedMetric) -> ProvenMetric | Stopped:
    """The proof that the ladder made, where the text of the metric reads back as the same expressions."""
    proof = metric.proof
    if proof.lower_on_set is None or not proof.is_about(question.model, question.spec.safe_set):
        return prove_metric(question)
    return ProvenMetric(question=question, proof=proof, lower=proof.lower_on_set)


def _stopped(end: Stopped) -> Ending:
    return Ending(claim=end.reason.claim, verdict=end.reason.verdict)


def _judged(question: Question, enclosed: Enclosed) -> Ending:
    options = question.options
    asked = Asked(bandwidth=options.bandwidth, adaptation_rate=options.adaptation_rate, curve=False)
    keys = deciding(question)
    problem = enclosed.problem
    sections = {
        key: kind_of(key).section(problem, PROPOSERS[kind_of(key).theorem.recipe].propose(problem, asked))
        for key in dict.fromkeys([*keys, DISTANCE.key, ALONE.key])
    }
    verdict = overall([sections[key].verdict for key in keys])
    short = next((s for key in keys if (s := sections[key]).verdict is not Verdict.CERTIFIED), None)
    claim = None if short is None else reasons(short, Explained())[0].claim
    return Ending(enclosed=enclosed, sections=tuple(sections.values()), claim=claim, verdict=verdict)


def _pair(question: Question, section: SectionData) -> Pair | None:
    """The gains of a kind that a metric is judged by: those of least adaptation rate where it has one."""
    options = question.options
    fixed = options.bandwidth is not None or options.adaptation_rate is not None
    pairs = section.pairs(asked=fixed)
    return next((pair for pair in pairs if pair.role == LEAST), pairs[0] if pairs else None)


def _demand(pair: Pair | None, problem: TubeProblem) -> float:
    """What a kind asks of the computer that adapts: Gamma |B|^2; else the tube.

    In a tube of its own coordinates Gamma is of these, and they are of the metric: |B|^2 in them makes it comparable.
    """
    if pair is None:
        return inf
    if pair.adaptation_rate is not None:
        return float(pair.adaptation_rate) * problem.constants.B.above**2
    return float(problem.rho)

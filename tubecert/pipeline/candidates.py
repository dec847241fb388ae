"""What a metric comes to in the end: a certification with it, as far as it is needed to compare metrics.

In: a specification with a proven metric in it. Out: the gains that the deciding theorems certify, or the claim that
fails. What only explains or describes a certificate is left out; what is certified here is the kernel's word.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf, isfinite, sqrt

from tubecert.claims.advice import MendPlan
from tubecert.conditions.problem import TubeProblem
from tubecert.kernel import overall
from tubecert.kinds import ALONE, DISTANCE
from tubecert.kinds.kind import Pair, SectionData
from tubecert.kinds.table import kind_of
from tubecert.pipeline.certification import defect_share, mending, plan, tube
from tubecert.pipeline.reasons import reasons
from tubecert.pipeline.synthesised import Row
from tubecert.search.gains import LEAST
from tubecert.search.proposers import PROPOSERS, Explained
from tubecert.spec import Spec
from tubecert.stages.bounded import Enclosed, enclose, half_widths, unmet
from tubecert.stages.judged import deciding
from tubecert.stages.metric import ProvenMetric, prove_metric
from tubecert.stages.question import Question, Stopped
from tubecert.synthesis.rounding import VerifiedMetric
from tubecert.verdict import Verdict


def judged_row(row: Row, question: Question, outputs: Mapping[str, float] | None = None) -> Row:
    """The row with what its metric comes to, by the width of the tube in `outputs` where those count.

    These are states and outputs, each with the unit that its half-width is compared in.
    """
    end = _enclosed(question, row.metric)
    if isinstance(end, Stopped):
        return replace(row, verdict=end.reason.verdict, claim=end.reason.claim)
    problem, asked, keys = end.problem, question.options.asked(curve=False), deciding(question)
    sections = {
        key: kind_of(key).section(problem, PROPOSERS[kind_of(key).theorem.recipe].propose(problem, asked))
        for key in dict.fromkeys([*keys, DISTANCE.key, ALONE.key])
    }
    verdict = overall([sections[key].verdict for key in keys])
    short = next((s for key in keys if (s := sections[key]).verdict is not Verdict.CERTIFIED), None)
    gain, lower = problem.constants.metric_input_gain.above, problem.constants.lower.below
    pairs = (_pair(question, section.data()) for section in sections.values())
    decisive = next(filter(None, pairs), None)  # of the kind that decides, else of B
    return replace(
        row,
        verdict=verdict,
        claim=None if short is None else reasons(short, Explained())[0].claim,
        alone=sections[ALONE.key].verdict is Verdict.CERTIFIED,
        mend=_mend(end) if verdict is not Verdict.CERTIFIED else None,
        input_gain=gain / sqrt(lower) if isfinite(gain) else None,
        rho=float(problem.rho),
        width=None if outputs is None else _width(half_widths(end), outputs),
        ultimate_radius=sections[DISTANCE.key].ultimate_radius,
        adaptation_rate=None if decisive is None else _float(decisive.adaptation_rate),
        bandwidth=None if decisive is None else _float(decisive.bandwidth),
        demand=_demand(decisive, problem),
    )


def measured_in(spec: Spec, outputs: Sequence[str]) -> Mapping[str, float] | None:
    """What was named, each in its own unit or that of its half-width; None where nothing was."""
    asked = dict(spec.tube.half_widths)
    return {name: float(asked.get(name, 1)) for name in outputs} or None


def _width(found: Mapping[str, float], units: Mapping[str, float]) -> float:
    """The largest of the half-widths that count, each in its unit; inf where nothing is known."""
    return max(found.get(name, inf) / unit for name, unit in units.items())


def _mend(enclosed: Enclosed) -> MendPlan | None:
    """What the plan lacks, where its defect alone takes the whole tube."""
    allowed = enclosed.tube.plan.allowance is not None  # then it is nobody's
    return None if allowed or defect_share(enclosed.problem) < 1 else mending(enclosed)


def _enclosed(question: Question, metric: VerifiedMetric) -> Enclosed | Stopped:
    """The constants over the tube of the metric, or the claim that fails before."""
    proven = _proven(question, metric)
    found = proven if isinstance(proven, Stopped) else tube(plan(proven))
    enclosed = found if isinstance(found, Stopped) else enclose(found)
    return enclosed if isinstance(enclosed, Stopped) else unmet(enclosed) or enclosed


def _proven(question: Question, metric: VerifiedMetric) -> ProvenMetric | Stopped:
    """The proof that the ladder made, where the text of the metric reads back as the same expressions."""
    proof = metric.proof
    if proof.lower_on_set is None or not proof.is_about(question.model, question.spec.safe_set):
        return prove_metric(question)
    return ProvenMetric(question=question, proof=proof, lower=proof.lower_on_set)


def _pair(question: Question, section: SectionData) -> Pair | None:
    """The gains of a kind that a metric is judged by: those of least adaptation rate where it has one."""
    options = question.options
    fixed = options.bandwidth is not None or options.adaptation_rate is not None
    pairs = section.pairs(asked=fixed)
    return next((pair for pair in pairs if pair.role == LEAST), pairs[0] if pairs else None)


def _float(number: Fraction | None) -> float | None:
    return None if number is None else float(number)


def _demand(pair: Pair | None, problem: TubeProblem) -> float | None:
    """What a kind asks of the computer that adapts: Gamma |B|^2, its estimator's speed squared.

    In a tube of its own coordinates Gamma is of these, and they are of the metric: |B|^2 in them makes it comparable.
    """
    if pair is None or pair.adaptation_rate is None:
        return None
    return float(pair.adaptation_rate) * problem.constants.B.above**2

"""Float coefficients -> the shortest decimals that are still a proven metric.

What is returned has passed C1-C3 on the whole safe set with its own, rounded coefficients; nothing that fails is
returned. The proof is `tubecert.metric.verify`'s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import floor, isfinite, log10

import numpy as np

from tubecert.claims.outcomes import ConditionUnbounded, NoProposal, NotProven, Outcome, WrongShape
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Array, Interval
from tubecert.expression.matrix import Matrix
from tubecert.metric.verify import MetricProof, Proofs
from tubecert.model import ControlAffineModel
from tubecert.synthesis.attack import Attack, Attacker
from tubecert.synthesis.coordinates import Choice
from tubecert.synthesis.family import MetricFamily
from tubecert.synthesis.forms import FormsTape
from tubecert.synthesis.problem import Floor, Proposal, SynthesisProblem
from tubecert.verdict import Verdict

_DIGITS = (2, 3, 4, 5, 6, 7, 9, 12)
_WORTH, _SHARP = 1.005, 1.0002  # a shorter metric may have a condition number larger by this factor

Coefficients = tuple[tuple[tuple[Fraction, ...], ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifiedMetric:
    """A metric that was proven: W at `rate` on the safe set, its proof, and how it was found.

    `condition_number` encloses sup lmax(W)/inf lmin(W) on the safe set, `digits` are those of the coefficients.
    """

    rate: Fraction
    floor: Floor
    coordinates: Choice
    dual_metric: Matrix = field(repr=False)
    proof: MetricProof = field(repr=False)
    condition_number: Constant
    digits: int
    family: MetricFamily = field(repr=False)
    proposal: Proposal = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejected:
    """Why no rounding of a proposal is a metric: what failed with the most digits.

    `undecided`: it may be one, but the proof ran out of boxes.
    """

    outcome: Outcome
    undecided: bool = False


def shortest_proven(
    problem: SynthesisProblem,
    proposal: Proposal,
    rate: Fraction,
    effort: Effort,
    proofs: Proofs | None = None,
) -> VerifiedMetric | Rejected:
    """The proposal with few digits, proven at `rate`, of nearly the same condition number; or why it is not proven."""
    values = proposal.coefficients
    if values is None or not np.all(np.isfinite(values)) or not np.any(values):
        return Rejected(outcome=NoProposal(route=proposal.route, status=proposal.status))
    n = len(problem.model.states)
    if values.shape != (len(problem.family.functions), n, n):
        return Rejected(outcome=WrongShape(route=proposal.route))
    first, *rest = _worth_proving(problem, values, rate)
    known = proofs or Proofs()

    def prove(dual: Matrix) -> MetricProof:
        return known.of(with_metric(problem.model, dual, rate), problem.safe_set, effort)

    outcome = _proven(problem, proposal, first, rate, prove)
    for digits in rest:
        if isinstance(outcome, VerifiedMetric):
            break
        outcome = _proven(problem, proposal, digits, rate, prove)
    return outcome


def _worth_proving(problem: SynthesisProblem, values: Array, rate: Fraction) -> list[int]:
    """Numbers of digits in the order in which a proof is tried: the fewest that look as good as all, then all.

    As good: by sampling in floats, rounding costs next to nothing of kappa, and at most half of what C2 has to spare.
    """
    forms = FormsTape(problem.model, problem.family, problem.scaled)
    scaled = problem.scaled
    nothing = np.ones((1, len(problem.model.states)))
    attacker = Attacker.of(replace(problem, rate=float(rate)), forms, nothing, np.random.default_rng(5))

    def sampled(digits: int) -> Attack:
        short = np.array(rounded(values, digits, scaled.entries), dtype=float)
        return attacker.attack(forms.inner(short), np.inf)

    most = _DIGITS[-1]
    worth = _SHARP if problem.sharp else _WORTH
    with np.errstate(all="ignore"):
        full = sampled(most)
        for digits in _DIGITS[:-1]:
            found = sampled(digits)
            if found.kappa <= worth * full.kappa and found.shortfall <= 0.5 * min(full.shortfall, 0.0):
                return [digits, most]
    return [most]


def rounded(values: Array, digits: int, sizes: Array | None = None) -> Coefficients:
    """Symmetric rational matrices with `digits` digits for the largest entry.

    Every entry is a multiple of one power of ten; with `sizes` (n, n), of what entries are measured in, of its own.
    """
    symmetric = 0.5 * (values + np.swapaxes(values, -1, -2))
    scale = np.ones(symmetric.shape[1:]) if sizes is None else sizes
    largest = float(np.abs(symmetric / scale).max())
    units = [
        [Fraction(10) ** (floor(log10(largest * s)) - digits + 1) for s in row] for row in scale.tolist()
    ]
    return tuple(
        tuple(
            tuple(round(Fraction(float(v)) / unit) * unit for v, unit in zip(row, own, strict=True))
            for row, own in zip(block, units, strict=True)
        )
        for block in symmetric
    )


def _proven(
    problem: SynthesisProblem,
    proposal: Proposal,
    digits: int,
    rate: Fraction,
    prove: Callable[[Matrix], MetricProof],
) -> VerifiedMetric | Rejected:
    assert proposal.coefficients is not None
    dual = problem.family.dual_metric(rounded(proposal.coefficients, digits, problem.scaled.entries))
    proof = prove(dual)
    if proof.failed is not None:
        failed = NotProven(route=proposal.route, condition=proof.failed, verdict=Verdict(proof.verdict))
        return Rejected(outcome=failed, undecided=failed.verdict is Verdict.UNDECIDED)
    condition = condition_number(proof)
    if not isfinite(condition.above):
        return Rejected(outcome=ConditionUnbounded(route=proposal.route))
    return VerifiedMetric(
        rate=rate,
        floor=problem.floor,
        coordinates=problem.coordinates,
        dual_metric=dual,
        proof=proof,
        condition_number=condition,
        digits=digits,
        family=problem.family,
        proposal=proposal,
    )


def with_metric(model: ControlAffineModel, dual: Matrix, rate: Fraction) -> ControlAffineModel:
    """The model with another metric."""
    return replace(model, W=dual, rate=rate)


def condition_number(proof: MetricProof) -> Constant:
    """sup lmax(M)/inf lmin(M) = sup lmax(W)/inf lmin(W) on the safe set, enclosed."""
    assert proof.lower_on_set is not None
    assert proof.upper_on_set is not None
    low, high = proof.lower_on_set, proof.upper_on_set
    ratio = Interval(high.below, high.above) / Interval(low.below, low.above)
    return Constant(below=float(ratio.lo), above=float(ratio.hi))

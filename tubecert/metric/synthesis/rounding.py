"""Float coefficients -> the shortest decimals that are still a proven metric.

What is returned has passed C1-C3 on the whole safe set with its own, rounded coefficients; nothing that fails is
returned. The proof is `tubecert.metric.verify`'s.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import floor, isfinite, log10

import numpy as np

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Array, Interval
from tubecert.expression.matrix import Matrix
from tubecert.metric.synthesis.family import MetricFamily
from tubecert.metric.synthesis.problem import Floor, Proposal, SynthesisProblem
from tubecert.metric.verify import MetricProof, verify_metric
from tubecert.model import ControlAffineModel

_DIGITS = (2, 3, 4, 5, 6, 7, 9, 12)
_WORTH = 1.005  # a shorter metric may have a condition number larger by this factor

Coefficients = tuple[tuple[tuple[Fraction, ...], ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifiedMetric:
    """A metric that was proven: W at `rate` on the safe set, its proof, and how it was found.

    `condition_number` encloses sup lmax(W)/inf lmin(W) on the safe set, `digits` are those of the coefficients.
    """

    rate: Fraction
    floor: Floor
    dual_metric: Matrix = field(repr=False)
    proof: MetricProof = field(repr=False)
    condition_number: Constant
    digits: int
    family: MetricFamily = field(repr=False)
    proposal: Proposal = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejected:
    """Why no rounding of a proposal is a metric: what failed with the most digits."""

    reason: str


def shortest_proven(
    problem: SynthesisProblem, proposal: Proposal, rate: Fraction, effort: Effort
) -> VerifiedMetric | Rejected:
    """The proposal with the fewest digits that keep it proven at `rate` and of nearly the same condition number."""
    values = proposal.coefficients
    if values is None or not np.all(np.isfinite(values)) or not np.any(values):
        return Rejected(reason=f"{proposal.route}: {proposal.status}")
    n = len(problem.model.states)
    if values.shape != (len(problem.family.functions), n, n):
        return Rejected(reason=f"{proposal.route} gave coefficients of a wrong shape")
    sharpest = _proven(problem, proposal, _DIGITS[-1], rate, effort)
    if isinstance(sharpest, Rejected):
        return sharpest
    best = sharpest
    low, high = 0, len(_DIGITS) - 1  # _DIGITS[high] digits are proven to be enough
    while low < high:
        middle = (low + high) // 2
        digits = _DIGITS[middle]
        found = _proven(problem, proposal, digits, rate, effort)
        if isinstance(found, VerifiedMetric) and _as_good(found, sharpest):
            best, high = found, middle
        else:
            low = middle + 1
    return best


def _as_good(found: VerifiedMetric, sharpest: VerifiedMetric) -> bool:
    """Whether rounding has cost next to nothing of the condition number, and at most half of the margin."""
    if found.condition_number.above > _WORTH * sharpest.condition_number.above:
        return False
    if found.proof.margin is None or sharpest.proof.margin is None:
        return True  # C2 is void
    return found.proof.margin.below >= 0.5 * sharpest.proof.margin.below


def rounded(values: Array, digits: int) -> Coefficients:
    """Symmetric rational matrices: every entry a multiple of one power of ten, `digits` digits for the largest."""
    symmetric = 0.5 * (values + np.swapaxes(values, -1, -2))
    exponent = digits - 1 - floor(log10(float(np.abs(symmetric).max())))
    unit = Fraction(10) ** -exponent
    return tuple(
        tuple(tuple(round(Fraction(float(v)) / unit) * unit for v in row) for row in block)
        for block in symmetric
    )


def _proven(
    problem: SynthesisProblem, proposal: Proposal, digits: int, rate: Fraction, effort: Effort
) -> VerifiedMetric | Rejected:
    assert proposal.coefficients is not None
    dual = problem.family.dual_metric(rounded(proposal.coefficients, digits))
    proof = verify_metric(with_metric(problem.model, dual, rate), problem.safe_set, effort)
    if proof.verdict != "certified":
        return Rejected(reason=f"{proposal.route}: {proof.reason}")
    condition = condition_number(proof)
    if not isfinite(condition.above):
        return Rejected(reason=f"{proposal.route}: the condition number could not be bounded")
    return VerifiedMetric(
        rate=rate,
        floor=problem.floor,
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

"""Float coefficients -> the shortest decimals that are still a proven metric.

What is returned has passed C1-C3 on the whole safe set with its own, rounded coefficients; nothing that fails is
returned. The proof is `tubecert.metric.verify`'s.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from fractions import Fraction
from math import floor, inf, isfinite, log10

import numpy as np

from tubecert.claims.failures import ConditionUnbounded, NoProposal, NotProven, Outcome, WrongShape
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import whitening
from tubecert.expression.matrix import Matrix
from tubecert.metric.verify import MetricProof, Proofs
from tubecert.synthesis.attack import Attack, Attacker
from tubecert.synthesis.family import Choice, MetricFamily, functions_at
from tubecert.synthesis.forms import FormsTape
from tubecert.synthesis.problem import Floor, Proposal, SynthesisProblem

_DIGITS = (2, 3, 4, 5, 6, 7, 9, 12)
_WORTH, _SHARP = 1.005, 1.0002  # a shorter metric may have a condition number larger by this factor
_ALIKE = 2e-3  # and differs by this share in any direction

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


def shortest_proven(
    problem: SynthesisProblem,
    proposal: Proposal,
    rate: Fraction,
    effort: Effort,
    proofs: Proofs | None = None,
) -> VerifiedMetric | Outcome:
    """The proposal with few digits, proven at `rate`, of nearly the same condition number.

    Or why no rounding of it is: what failed with the most digits.
    """
    values = proposal.coefficients
    if values is None or not np.all(np.isfinite(values)) or not np.any(values):
        return NoProposal(route=proposal.route, status=proposal.status)
    n = len(problem.model.states)
    if values.shape != (len(problem.family.functions), n, n):
        return WrongShape(route=proposal.route)
    functions = functions_at(problem.family, problem.safe_set)
    first, *rest = _worth_proving(problem, values, rate, functions)
    known = proofs or Proofs()

    def proven(digits: int) -> VerifiedMetric | Outcome:
        dual = problem.family.dual_metric(rounded(values, digits, functions))
        proof = known.of(replace(problem.model, W=dual, rate=rate), problem.safe_set, effort)
        return _failure(proposal, proof) or VerifiedMetric(
            rate=rate,
            floor=problem.floor,
            coordinates=problem.coordinates,
            dual_metric=dual,
            proof=proof,
            condition_number=proof.condition_number(),
            digits=digits,
            family=problem.family,
            proposal=proposal,
        )

    outcome = proven(first)
    for digits in rest:
        if isinstance(outcome, VerifiedMetric):
            break
        outcome = proven(digits)
    return outcome


def _worth_proving(problem: SynthesisProblem, values: Array, rate: Fraction, functions: Array) -> list[int]:
    """Numbers of digits in the order in which a proof is tried: the fewest that look as good as all, then all.

    As good: by sampling in floats, W is the same to a share in every direction, which does not depend on units, and
    rounding costs next to nothing of kappa, and at most half of what C2 has to spare.
    """
    forms = FormsTape(problem.model, problem.family, problem.scaled)
    nothing = np.ones((1, len(problem.model.states)))
    attacker = Attacker.of(replace(problem, rate=float(rate)), forms, nothing, np.random.default_rng(5))

    def sampled(short: Array) -> Attack:
        return attacker.attack(forms.inner(short), np.inf)

    most = _DIGITS[-1]
    worth = _SHARP if problem.sharp else _WORTH
    with np.errstate(all="ignore"):
        full = sampled(np.array(rounded(values, most, functions), dtype=float))
        for digits in _DIGITS[:-1]:
            short = np.array(rounded(values, digits, functions), dtype=float)
            if not distance(values, short, functions) <= _ALIKE:
                continue
            found = sampled(short)
            if found.kappa <= worth * full.kappa and found.shortfall <= 0.5 * min(full.shortfall, 0.0):
                return [digits, most]
    return [most]


def distance(values: Array, other: Array, functions: Array) -> float:
    """max |v'(W - W')v|/(v'Wv) over directions v, at points where the g_k are `functions` (P, K); inf if W is not > 0.

    `values`, `other`: V_k (K, n, n). The frame drops out, and so do all units.
    """
    here, there = (np.einsum("pk,kij->pij", functions, v) for v in (values, other))
    size = np.sqrt(np.abs(np.einsum("pii->pi", here)).max(axis=0))
    here, there = here / np.outer(size, size), there / np.outer(size, size)
    if not (np.isfinite(here).all() and np.linalg.eigvalsh(here).min() > 0):
        return inf
    t = whitening(here)
    return float(np.abs(np.linalg.eigvalsh(t @ (there - here) @ np.swapaxes(t, -1, -2))).max())


def rounded(values: Array, digits: int, functions: Array | None = None) -> Coefficients:
    """Symmetric rational matrices; entry i, j is rounded to `digits` digits of sqrt(W_ii W_jj), in any units.

    `functions` (P, K) are values of the g_k, by the largest of which a coefficient counts; without any g_k is 1. Every
    entry is a multiple of a power of ten of its own.
    """
    symmetric = 0.5 * (values + np.swapaxes(values, -1, -2))
    known = np.ones((1, len(symmetric))) if functions is None or not len(functions) else functions
    own = np.einsum("kii->ki", symmetric)
    square = np.abs(known @ own).max(axis=0)
    size = np.sqrt(np.where(square > 0, square, np.abs(symmetric).max()))
    spans = np.abs(known).max(axis=0)
    spans = np.where(spans > 0, spans, 1.0)
    scales = size[:, None] * size / spans[:, None, None]
    return tuple(
        tuple(
            tuple(_decimal(float(v), float(s), digits) for v, s in zip(row, own, strict=True))
            for row, own in zip(block, sizes, strict=True)
        )
        for block, sizes in zip(symmetric, scales, strict=True)
    )


def _decimal(value: float, scale: float, digits: int) -> Fraction:
    unit = Fraction(10) ** (floor(log10(scale)) - digits + 1)
    return round(Fraction(value) / unit) * unit


def _failure(proposal: Proposal, proof: MetricProof) -> Outcome | None:
    """Why a metric is not proven, or of no use; None if it is."""
    if proof.failed is not None:
        return NotProven(route=proposal.route, condition=proof.failed, verdict=proof.verdict)
    known = isfinite(proof.condition_number().above)
    return None if known else ConditionUnbounded(route=proposal.route)

"""Conditions C1, C2, C3 on the safe set: certified with a margin, refuted at a point, or undecided.

C1: 0 < W, with a and A on the set. C3 exactly, on the expressions. C2 as a largest rate:
B_perp'(F_0 + 2 r W)B_perp <= 0 holds for all rates r up to -1/2 sup lmax(B_perp' F_0 B_perp, B_perp' W B_perp),
F_0 = -d_f W + f_x W + W f_x'.
Implements: (CCM_1), (CCM_2) and (CCM_3) in dual form. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from math import isfinite

import numpy as np

from tubecert.claims.statements import MetricContraction, MetricDefinite, MetricKilling
from tubecert.enclosure.branch_and_bound import Effort, Supremum, decide, supremum
from tubecert.enclosure.constant import Constant, Witness
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.objective import Objective
from tubecert.enclosure.pencil import Definite, Pencil, ProjectedPencil, scalar
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, is_zero
from tubecert.expression.matrix import Matrix, determinant, identity, multiply, transpose
from tubecert.model import TIME, ControlAffineModel
from tubecert.verdict import Verdict

Box = Sequence[tuple[Fraction, Fraction]]
_SHARP, _FINEST = 1e-2, 1e-10  # relative to the rate
_HALF = 0.5
_KEPT = 64  # proofs


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricProof:
    """The outcome of C1-C3.

    `largest_rate` encloses the supremum of the rates that C2 supports; `margin` is it minus the rate asked for, in 1/s.
    `failed` is the condition that is not proven (C1, C2 or C3), `at` a point where it is refuted. It is about the
    metric of `model` on `safe_set` and nothing else: see `is_about`.
    """

    model: ControlAffineModel
    safe_set: Box
    verdict: Verdict
    failed: MetricDefinite | MetricContraction | MetricKilling | None = None
    at: Witness | None = None
    lower_on_set: Constant | None = None
    upper_on_set: Constant | None = None
    largest_rate: Constant | None = None
    margin: Constant | None = None

    def is_about(self, model: ControlAffineModel, safe_set: Box) -> bool:
        """Whether this is what `verify_metric` found for that metric there; equal expressions are the same nodes."""
        own, other = ((m.states, m.inputs, m.f, m.time, m.B, m.W, m.rate) for m in (self.model, model))
        return own == other and self.safe_set == safe_set

    def condition_number(self) -> Constant:
        """sup lmax(M)/inf lmin(M) = sup lmax(W)/inf lmin(W) on the safe set, enclosed, where C1 is proven."""
        low, high = self.lower_on_set, self.upper_on_set
        assert low is not None
        assert high is not None
        ratio = Interval(high.below, high.above) / Interval(low.below, low.above)
        return Constant(below=float(ratio.lo), above=float(ratio.hi))


def verify_metric(
    model: ControlAffineModel, safe_set: Box, effort: Effort, *, closely: bool = False
) -> MetricProof:
    """Decide C1, C3 and C2, in this order, on the whole safe set; `closely`: the largest rate is asked for, too."""
    domain = _everywhere(model, safe_set)
    eye = identity(len(model.states))

    def place(at: dict[str, float]) -> Witness:
        middle = [float((lo + hi) / 2) for lo, hi in safe_set]
        x = tuple(at.get(name, m) for name, m in zip(model.states, middle, strict=True))
        return Witness(t=at.get(TIME), x=x)

    positive = decide(Definite(model.W), domain, 0.0, effort)
    if positive.verdict is not Verdict.CERTIFIED:
        return MetricProof(
            model=model,
            safe_set=safe_set,
            verdict=positive.verdict,
            failed=MetricDefinite(),
            at=place(positive.at),
        )
    fine = Effort(gap=min(effort.gap, 1e-4), budget=effort.budget, progress=effort.progress)
    largest = supremum(Pencil(model.W, eye), domain, fine)
    upper = supremum(Pencil(eye, model.W), domain, fine)
    inverse = (Interval.exact(1.0) / Interval(largest.below, largest.above)).sanitised()
    proof = MetricProof(
        model=model,
        safe_set=safe_set,
        verdict=Verdict.CERTIFIED,
        lower_on_set=Constant(below=float(inverse.lo), above=float(inverse.hi), at=place(largest.at)),
        upper_on_set=Constant(below=upper.below, above=upper.above, at=place(upper.at)),
    )
    if (failed := _killing(model, domain)) is not None:
        verdict, claim, at = failed
        return replace(proof, verdict=verdict, failed=claim, at=place(at))
    if len(model.inputs) == len(model.states):
        return proof  # as many inputs as states: C2 is void
    found = _largest_rate(model, domain, effort, closely)
    below, above = -found.above / 2, -found.below / 2
    margin = Interval(below, above) - Interval.of(model.rate)
    proof = replace(
        proof,
        largest_rate=Constant(below=below, above=above, at=place(found.at)),
        margin=Constant(below=float(margin.lo), above=float(margin.hi), at=place(found.at)),
    )
    if isfinite(below) and Fraction(below) > model.rate:
        return proof
    slow = MetricContraction(rate=model.rate, largest_rate=Constant(below=below, above=above))
    if isfinite(above) and Fraction(above) < model.rate:
        return replace(proof, verdict=Verdict.REFUTED, failed=slow, at=place(found.at))
    return replace(proof, verdict=Verdict.UNDECIDED, failed=slow)


class Proofs:
    """Metrics that `verify_metric` has decided: what was asked in the same words gets the same answer at once."""

    def __init__(self) -> None:
        self._kept: list[tuple[tuple[float, float, int, int], MetricProof]] = []

    def of(self, model: ControlAffineModel, safe_set: Box, effort: Effort) -> MetricProof:
        """What `verify_metric` finds, with an effort of this size."""
        size = effort.gap, effort.absolute, effort.budget, effort.cheap
        for own, proof in self._kept:
            if own == size and proof.is_about(model, safe_set):
                return proof
        proof = verify_metric(model, safe_set, effort)
        self._kept = [*self._kept[1 - _KEPT :], (size, proof)]
        return proof


def supported_rate(model: ControlAffineModel, safe_set: Box, effort: Effort) -> Constant:
    """The supremum of the rates for which C2 holds on the safe set, enclosed to the gap of the effort.

    For a W that is positive definite there; whether it satisfies C3 is another question. Infinite where C2 is void. The
    rate of the model is not used.
    """
    if len(model.inputs) == len(model.states):
        return Constant(below=np.inf, above=np.inf)
    domain = _everywhere(model, safe_set)
    found = supremum(_rates(model, domain, effort), domain, effort)
    middle = zip(model.states, safe_set, strict=True)
    at = Witness(x=tuple(found.at.get(name, float((lo + hi) / 2)) for name, (lo, hi) in middle))
    return Constant(below=-found.above / 2, above=-found.below / 2, at=at)


def _everywhere(model: ControlAffineModel, safe_set: Box) -> BoxDomain:
    """The safe set, at all times where f depends on them."""
    states = dict(zip(model.states, safe_set, strict=True))
    return BoxDomain(states if model.time is None else {**states, TIME: model.time})


def _largest_rate(model: ControlAffineModel, domain: BoxDomain, effort: Effort, closely: bool) -> Supremum:
    """sup lmax(B_perp' F_0 B_perp, B_perp' W B_perp), refined until the sign of the margin is known.

    Where C2 holds nothing but that is used, and a hundredth of the rate is close enough: metrics of least condition
    number nearly attain C2 in many places, and each further digit would be paid for in all of them. Where it fails, or
    the rate is asked for `closely`, the margin is known to the gap, or to its half where that is costly.
    """
    objective = _rates(model, domain, effort)
    rate = float(model.rate)
    # a first look, to see how sharp the next must be
    precision, budget = _SHARP, min(effort.cheap, effort.budget)
    while True:
        sharp = Effort(gap=0.0, absolute=precision * rate, budget=budget, progress=effort.progress)
        found = supremum(objective, domain, sharp)
        margin = -found.above / 2 - rate, -found.below / 2 - rate
        holds, fails, dear = margin[0] > 0, margin[1] < 0, found.boxes >= effort.cheap
        known = margin[1] - margin[0] <= (_HALF if dear else effort.gap) * max(map(abs, margin))
        exhausted = not found.reached and budget == effort.budget
        enough = (holds or fails) and (known or (holds and found.reached and not closely))
        if enough or precision <= _FINEST or exhausted:
            return found
        if (holds or fails) and not dear:
            precision /= 100
        else:
            if closely or not holds:  # the sign is known once the margin is known to its size
                finer = precision / 10 if found.reached or budget == effort.budget else precision
                precision = min(finer, abs(margin[1]) / rate)
            budget = effort.budget
        precision = max(precision, _FINEST)


def _rates(model: ControlAffineModel, domain: BoxDomain, effort: Effort) -> Objective:
    """-2 times the largest rate that C2 supports at a point."""
    basis = model.annihilator if model.constant_input else _moving_annihilator(model, domain, effort)
    if basis is not None:
        return Pencil(_restrict(model.drift_form, basis), _restrict(model.W, basis))
    return ProjectedPencil(model.drift_form, model.W, model.BBt, model.projector, inputs=len(model.inputs))


def _moving_annihilator(model: ControlAffineModel, domain: BoxDomain, effort: Effort) -> Matrix | None:
    """B_perp(x) by m pivot rows of B that are proven independent on the whole set, if there are such rows."""
    for rows in model.pivots[0]:
        pivot = determinant([model.B[i] for i in rows])
        if not any(
            decide(scalar(sign * pivot), domain, 0.0, replace(effort, budget=2_000)).verdict
            is Verdict.CERTIFIED
            for sign in (1, -1)
        ):
            continue
        return model.annihilator_by(rows)
    return None


def _restrict(a: Matrix, basis: Matrix) -> Matrix:
    return multiply(transpose(basis), multiply(a, basis))


def _killing(
    model: ControlAffineModel, domain: BoxDomain
) -> tuple[Verdict, MetricKilling, dict[str, float]] | None:
    """None if C3 is proven exactly, else (verdict, what fails, point)."""
    for j, name in enumerate(model.inputs):
        defect = model.killing_defect(j)
        entries = [e for row in defect for e in row if e is not ZERO]
        doubtful = [e for e in entries if is_zero(e) is not True]
        if not doubtful:
            continue
        for e in doubtful:
            function = MatrixFunction([[[e]]])
            lo, hi = domain.boxes(function.variables)
            corners = [lo + w * (hi - lo) for w in (0.5, 0.31, 0.77, 0.123)]
            points, _ = domain.inside(function.variables, np.concatenate(corners))
            with np.errstate(all="ignore"):
                value = function.at(points, points)[0][:, 0, 0]
            wrong = np.flatnonzero((value.lo > 0) | (value.hi < 0))
            if len(wrong):
                at = dict(zip(function.variables, points[wrong[0]].tolist(), strict=True))
                return Verdict.REFUTED, MetricKilling(input=name, residual=float(value.mid[wrong[0]])), at
        return Verdict.UNDECIDED, MetricKilling(input=name), {}
    return None

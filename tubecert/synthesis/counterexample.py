"""Branch and bound as the last attacker: a point where rounded coefficients fail, or none on the whole safe set.

Only decisions at a threshold are asked for, which is much cheaper than the suprema that `verify` reports. It saves
rounds and proofs that would fail; the proof that counts is made by the caller.
Implements: (CCM_1), (CCM_2). Untrusted use of trusted parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Literal

import numpy as np

from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Array
from tubecert.enclosure.objective import Objective
from tubecert.enclosure.pencil import Definite, Pencil
from tubecert.enclosure.projected import ProjectedPencil
from tubecert.expression.matrix import multiply, transpose
from tubecert.model import ControlAffineModel
from tubecert.synthesis.problem import SynthesisProblem
from tubecert.verdict import Verdict

_DIGITS = 12
_EFFORT = Effort(budget=3_000)
Box = Sequence[tuple[Fraction, Fraction]]
_ALLOWED = 2.5e-4  # of the rate: less than any back-off, and much easier to decide than the rate itself


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """Whether C1 and C2 hold; if not, which of them failed and the point (n,) at which it was seen to."""

    verdict: Verdict
    condition: Literal["", "C1", "C2"] = ""
    at: Array | None = None


def counterexample(
    problem: SynthesisProblem, coefficients: Array, symmetries: Array, order: Sequence[int]
) -> Judgement:
    """Decide C1 and C2, at a rate that is smaller by a hair, for the coefficients V_k (K, n, n) in decimals.

    Only one of the mirror images under the `symmetries` (S, n) is looked at: the box is halved along states, those
    that come first in `order` before others.
    """
    W = problem.family.dual_metric(_decimals(coefficients))
    model = replace(problem.model, W=W, rate=Fraction(problem.rate))
    domain = BoxDomain(dict(zip(model.states, _one_image(problem.safe_set, symmetries, order), strict=True)))
    found = decide(Definite(W), domain, 0.0, _EFFORT)
    if found.verdict is not Verdict.CERTIFIED:
        return _failed("C1", found, problem)
    if len(model.inputs) == len(model.states):
        return Judgement(verdict=found.verdict)
    found = decide(_contraction(model), domain, -2 * problem.rate * (1 - _ALLOWED), _EFFORT)
    return (
        Judgement(verdict=found.verdict)
        if found.verdict is Verdict.CERTIFIED
        else _failed("C2", found, problem)
    )


def _contraction(model: ControlAffineModel) -> Objective:
    """Its supremum is minus twice the largest rate that C2 supports."""
    if not model.constant_input:
        return ProjectedPencil(
            model.drift_form, model.W, model.BBt, model.projector, inputs=len(model.inputs)
        )
    N = model.annihilator
    drift, weight = (multiply(transpose(N), multiply(a, N)) for a in (model.drift_form, model.W))
    return Pencil(drift, weight)


def _failed(condition: Literal["C1", "C2"], found: Decision, problem: SynthesisProblem) -> Judgement:
    middle = [float((lo + hi) / 2) for lo, hi in problem.safe_set]
    at = np.array([found.at.get(v, m) for v, m in zip(problem.model.states, middle, strict=True)])
    return Judgement(verdict=found.verdict, condition=condition, at=at)


def _one_image(safe_set: Box, symmetries: Array, order: Sequence[int]) -> list[tuple[Fraction, Fraction]]:
    """A part of the box that has a mirror image of every point."""
    box, signs = list(safe_set), symmetries
    for i in order:
        if (signs[:, i] < 0).any():
            box[i] = (Fraction(0), box[i][1])
            signs = signs[signs[:, i] > 0]
    return box


def _decimals(coefficients: Array) -> list[list[list[Fraction]]]:
    symmetric = 0.5 * (coefficients + np.swapaxes(coefficients, 1, 2))
    return [[[Fraction(f"{x:.{_DIGITS}g}") for x in row] for row in v] for v in symmetric.tolist()]

"""Attacks on given coefficients by sampling: points at which the conditions fail, and what holds on the samples.

Untrusted: floats, and what is missed is found by branch and bound.

Branch and bound as the last attacker: a point where rounded coefficients fail, or none on the whole safe set.

Only decisions at a threshold are asked for, which is much cheaper than the suprema that `verify` reports. It saves
rounds and proofs that would fail; the proof that counts is made by the caller.
Implements: (CCM_1), (CCM_2). Untrusted use of trusted parts.

Points of a box where a score is large: random points and corners, then climbing by random steps.

Floats only: what is missed here is found by branch and bound. Untrusted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Literal

import numpy as np

from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import finite, whitening
from tubecert.enclosure.objective import Objective
from tubecert.enclosure.pencil import Definite, Pencil, ProjectedPencil
from tubecert.expression.matrix import multiply, transpose
from tubecert.model import ControlAffineModel
from tubecert.synthesis.forms import FormsTape, canonical
from tubecert.synthesis.problem import Floor, SynthesisProblem
from tubecert.verdict import Verdict

Score = Callable[[Array], Array]
_CLIMBS = 24
_TRIES = 6  # random steps per climber and round


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """The part of a box that matters: `variables` vary, those `at_ends` only between their ends, others stay put."""

    lo: Array
    hi: Array
    variables: tuple[int, ...]
    at_ends: tuple[int, ...] = ()
    symmetries: Array = field(repr=False)

    @property
    def inner(self) -> tuple[int, ...]:
        """The variables that vary freely."""
        return tuple(i for i in self.variables if i not in self.at_ends)

    @property
    def order(self) -> tuple[int, ...]:
        """All states, those first that vary freely, then those at ends."""
        rest = (i for i in range(len(self.lo)) if i not in self.variables)
        return (*self.inner, *self.at_ends, *rest)

    def random(self, count: int, generator: np.random.Generator) -> Array:
        """Points (count, n): uniform, a third of them pushed to the boundary of the free variables."""
        points = np.tile(0.5 * (self.lo + self.hi), (count, 1))
        inner, ends = list(self.inner), list(self.at_ends)
        t = generator.uniform(-0.25, 1.25, (count, len(inner)))  # a sixth beyond either end
        points[:, inner] = self.lo[inner] + np.clip(t, 0.0, 1.0) * (self.hi - self.lo)[inner]
        chosen = generator.integers(0, 2, (count, len(ends)))
        points[:, ends] = np.where(chosen == 1, self.hi[ends], self.lo[ends])
        return points

    def corners(self, most: int, generator: np.random.Generator) -> Array:
        """The corners, or some of them if there are more than `most`."""
        chosen = list(self.variables)
        if 2 ** len(chosen) > most:
            picks = generator.integers(0, 2, (most, len(chosen)))
        else:
            picks = np.arange(2 ** len(chosen))[:, None] >> np.arange(len(chosen)) & 1
        points = np.tile(0.5 * (self.lo + self.hi), (len(picks), 1))
        points[:, chosen] = np.where(picks == 1, self.hi[chosen], self.lo[chosen])
        return points

    def step(self, points: Array, size: float, generator: np.random.Generator) -> Array:
        """The points moved at random by up to `size` of the box, and kept inside."""
        inner = list(self.inner)
        moved = points.copy()
        width = size * (self.hi - self.lo)[inner]
        which = generator.integers(0, 2, (len(points), len(inner)))
        which[np.arange(len(points)), generator.integers(0, max(len(inner), 1), len(points))] = 1
        moved[:, inner] += generator.normal(size=(len(points), len(inner))) * width * which
        return np.clip(moved, self.lo, self.hi)


def worst(
    score: Score, region: Region, generator: np.random.Generator, *, samples: int, climbers: int, keep: int
) -> tuple[Array, Array]:
    """Up to `keep` points (P, n), far apart, at which the score is large, and their scores, the largest first.

    Scores that are no numbers count as +inf: a point where nothing can be computed is no point to be proud of.
    """
    points = np.concatenate([region.corners(samples // 4, generator), region.random(samples, generator)])
    values = _known(score(points))
    start = _spread(points, values, region, climbers, 0.15)
    points, values = points[start], values[start]
    size = 0.1
    for _ in range(_CLIMBS if region.inner else 0):
        tried = region.step(np.repeat(points, _TRIES, axis=0), size, generator)
        found = _known(score(tried)).reshape(len(points), _TRIES)
        best = found.argmax(axis=1)
        rows = np.arange(len(points))
        better = found[rows, best] > values
        points = np.where(better[:, None], tried.reshape(len(points), _TRIES, -1)[rows, best], points)
        values = np.where(better, found[rows, best], values)
        size *= 0.8
    points = canonical(points, region.symmetries)
    chosen = _spread(points, values, region, keep, 0.03)
    return points[chosen], values[chosen]


def floats(safe_set: Sequence[tuple[Fraction, Fraction]]) -> tuple[Array, Array]:
    """Lower and upper ends (n,), nearest floats."""
    ends = np.array([[float(lo), float(hi)] for lo, hi in safe_set]).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def _known(values: Array) -> Array:
    return np.where(np.isnan(values), np.inf, values)


def _spread(points: Array, values: Array, region: Region, count: int, distance: float) -> list[int]:
    """Indices of the best points that keep a distance (in widths of the box, over all variables) from better ones."""
    width = np.where(region.hi > region.lo, region.hi - region.lo, 1.0)
    order = np.argsort(-values, kind="stable")[: 20 * count]
    scaled = (points / width)[order]
    chosen: list[int] = []
    apart = np.ones(len(order), dtype=bool)
    while len(chosen) < count and apart.any():
        i = int(apart.argmax())
        chosen.append(int(order[i]))
        apart &= np.abs(scaled - scaled[i]).max(axis=1) > distance
        apart[i] = False
    return chosen


_SAMPLES = 800  # for every variable that varies freely
_KEPT = 16  # points of C2; of C1 fewer


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """What was found about given coefficients.

    Points (N, n) at which they fail, by condition; by how much the rate falls short; kappa and the scale that makes W
    exceed the floor.
    """

    low: Array
    high: Array
    contraction: Array
    shortfall: float
    kappa: float
    scale: float

    @property
    def failed(self) -> bool:
        """Whether the rate is missed, or W is not positive."""
        return not (self.shortfall <= 0 and np.isfinite(self.kappa))


@dataclass(frozen=True, slots=True, kw_only=True)
class Attacker:
    """Where conditions are asked: C1 on `bounded`, C2 on `contracting`."""

    forms: FormsTape = field(repr=False)
    rate: float
    floor: Floor
    bounded: Region
    contracting: Region
    generator: np.random.Generator = field(repr=False)

    @staticmethod
    def of(
        problem: SynthesisProblem, forms: FormsTape, symmetries: Array, generator: np.random.Generator
    ) -> Attacker:
        """For a problem with sign symmetries (S, n)."""
        lo, hi = floats(problem.safe_set)
        own = set(forms.metric_variables)
        own |= set(forms.input_variables) if problem.floor == "input" else set()
        bounded = Region(lo=lo, hi=hi, variables=tuple(sorted(own)), symmetries=symmetries)
        contracting = replace(bounded, variables=forms.variables, at_ends=forms.affine_variables(lo, hi))
        return Attacker(
            forms=forms,
            rate=problem.rate,
            floor=problem.floor,
            bounded=bounded,
            contracting=contracting,
            generator=generator,
        )

    def attack(self, coefficients: Array, ceiling: float) -> Attack:
        """The worst points for these coefficients (of the changed functions); W <= `ceiling` is asked for."""
        c2, short = self._worst(self.contracting, lambda x: self.rate - self.rates(coefficients, x), _KEPT)
        low, least = self._worst(self.bounded, lambda x: -self.floors(coefficients, x), _KEPT // 3)
        high, most = self._worst(self.bounded, lambda x: self.tops(coefficients, x), _KEPT // 3)
        floor, top = -float(least[0]), float(most[0])
        return Attack(
            low=low[least > -1],
            high=high[most > ceiling],
            contraction=c2[short > 0],
            shortfall=float(short[0]),
            kappa=top / floor if floor > 0 else np.inf,
            scale=1 / floor if floor > 0 else 1.0,
        )

    def rates(self, coefficients: Array, points: Array) -> Array:
        """The largest rate that C2 permits at each point (N,); -inf where W is not positive, inf where C2 is void."""
        F, W = self.forms(points).contraction(coefficients)
        if not F.shape[-1]:
            return np.full(len(points), np.inf)
        t = whitening(W)
        rate = -0.5 * largest(t @ F @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, rate, -np.inf)

    def floors(self, coefficients: Array, points: Array) -> Array:
        """The largest multiple of the floor below W at each point; negative where W is not positive."""
        here = self.forms(points)
        W = here.metric(coefficients)
        if self.floor == "identity":
            return -largest(-W)
        t = whitening(W)
        reached = largest(t @ here.input @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, 1 / reached, -1.0)

    def tops(self, coefficients: Array, points: Array) -> Array:
        """The largest eigenvalue of W at each point."""
        return largest(self.forms(points).metric(coefficients))

    def _worst(self, region: Region, score: Callable[[Array], Array], keep: int) -> tuple[Array, Array]:
        samples = _SAMPLES * (1 + len(region.inner))
        return worst(score, region, self.generator, samples=samples, climbers=2 * keep, keep=keep)


def largest(matrices: Array) -> Array:
    """The largest eigenvalues of symmetric matrices; inf where they are not finite."""
    known = finite(matrices)
    safe = np.where(known[:, None, None], matrices, 0.0)
    return np.where(known, np.linalg.eigvalsh(safe)[:, -1], np.inf)


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

"""Synthesis by counterexamples: conditions at points, then branch and bound, whose witness is the next point.

Works for every expression that a specification allows. Each round solves the conditions at points (`program`): the
least kappa there bounds the family's from below; a metric from the middle of what is feasible slightly above it is
attacked by sampling (`sampling`) and, once sampling finds nothing, by `verify` on the rounded coefficients.
Untrusted: what it proposes is rounded and proven by its caller again.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import finite as finite_matrices
from tubecert.enclosure.linalg import whitening
from tubecert.metric.synthesis.conic import ConicSolution
from tubecert.metric.synthesis.counterexample import Judgement, counterexample
from tubecert.metric.synthesis.forms import FormsTape, Unknowns
from tubecert.metric.synthesis.parity import canonical, invariant_entries
from tubecert.metric.synthesis.problem import Proposal, SynthesisProblem
from tubecert.metric.synthesis.program import (
    PointProgram,
    Points,
    contraction_points,
    finite,
    metric_points,
)
from tubecert.metric.synthesis.sampling import Region, floats, worst

ROUTE = "cegis"
_ROUNDS = 60
_GAP = 0.01  # between kappa and its bound
_FINE = 1e-3  # the same, where it is cheap
_CHEAP = 40  # unknowns
_HOPELESS = 1e7  # a larger kappa is no metric
_SAMPLES = 4000
_LOOSE = 0.5  # conditions that hold by so much, relatively, are dropped


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """What sampling found about given coefficients.

    Points (N, n) at which they fail, by condition; by how much the rate falls short; kappa and the scale that makes W
    exceed the floor.
    """

    low: Array
    high: Array
    contraction: Array
    shortfall: float
    kappa: float
    scale: float


def propose(problem: SynthesisProblem) -> Proposal:
    """The member of the family with nearly the least kappa at the rate asked for, or why there is none."""
    with np.errstate(all="ignore"):
        return _Synthesis(problem).run()


class _Synthesis:
    """The state of one run: the points, the bound, and the clock."""

    def __init__(self, problem: SynthesisProblem) -> None:
        self.began = time.perf_counter()
        self.problem, self.rate = problem, problem.rate
        self.forms = FormsTape(problem.model, problem.family)
        lo, hi = floats(problem.safe_set)
        symmetries, free = invariant_entries(
            problem.model, problem.family, np.stack([lo, hi], axis=1), self.forms
        )
        self.unknowns = Unknowns(free)
        self.generator = np.random.default_rng(11)
        some = self.generator.uniform(lo, hi, (20 * len(problem.family.functions) + 20, len(lo)))
        self.forms.orthonormalise(np.concatenate([some, *(some * signs for signs in symmetries)]))
        own = set(self.forms.metric_variables)
        own |= set(self.forms.input_variables) if problem.floor == "input" else set()
        self.bounded = Region(lo=lo, hi=hi, variables=tuple(sorted(own)), symmetries=symmetries)
        self.contracting = replace(
            self.bounded, variables=self.forms.variables, at_ends=self.forms.affine_variables(lo, hi)
        )
        self.gap = _FINE if self.unknowns.count <= _CHEAP else _GAP
        self.bound, self.solver_seconds, self.rounds = 0.0, 0.0, 0
        self.program = self._start()

    def run(self) -> Proposal:
        """Rounds of solving and attacking until the metric holds within the gap."""
        best: tuple[float, Array] | None = None
        limit = min(self.problem.limit or _HOPELESS, _HOPELESS)
        extreme: Array | None = None  # the unknowns of least kappa
        for self.rounds in range(1, _ROUNDS + 1):
            central = None
            if extreme is not None:
                central = self._central(extreme)
            if central is None:
                least = self._count(self.program.least_kappa())
                if least.values is None or not least.feasible:
                    return self._answer(best, least.feasible, least.status)
                kappa = float(least.values[-1])
                if not 0 < kappa < np.inf:
                    return self._answer(best, None, "the solver's kappa is no positive number")
                self.bound = max(self.bound, min(kappa, least.bound))
                if self.bound > limit:
                    return self._answer(best, False, f"kappa is at least {self.bound:.4g}, above the limit")
                extreme = least.values[:-1]
                central = self._central(extreme)
            y = extreme if central is None else central
            coefficients = self.unknowns.matrices(y)
            attack = self._attack(coefficients)
            self._tell(attack)
            if attack.shortfall <= 0 and np.isfinite(attack.kappa):
                found = attack.kappa, self.forms.coefficients(coefficients) * attack.scale
                best = min(best or found, found, key=lambda pair: pair[0])
                if attack.kappa <= self.bound * (1 + 1.1 * self.gap):
                    judged = counterexample(
                        self.problem, found[1], self.bounded.symmetries, self.contracting.order
                    )
                    if judged.verdict != "refuted":
                        words = "no counterexample" if judged.verdict == "proven" else "no counterexample found"
                        return self._answer(found, True, words)
                    attack, best = self._with_witness(attack, judged), None
            if not self._add(attack, y):
                return self._answer(best, None, "no further points to add")
        return self._answer(best, None, f"gave up after {_ROUNDS} rounds")

    def _central(self, reference: Array) -> Array | None:
        """The unknowns in the middle of what is feasible slightly above the bound; None if nothing is."""
        kappa = self.bound * (1 + self.gap)
        found = self._count(self.program.central(kappa, self.gap / 4, reference))
        if found.values is None or not found.feasible or not found.values[-1] > 0:
            return None
        return found.values[:-1]

    # -- points ------------------------------------------------------------------------------------------------

    def _start(self) -> PointProgram:
        """A few points to begin with: corners and random ones."""
        c1, c2 = (
            np.concatenate([region.corners(64, self.generator), region.random(count, self.generator)])
            for region, count in (
                (self.bounded, 10 * len(self.bounded.variables) + 1),
                (self.contracting, 20 * len(self.contracting.inner) + 10),
            )
        )
        c1, c2 = (np.unique(canonical(points, self.bounded.symmetries), axis=0) for points in (c1, c2))
        metric = self._metric_points(c1)
        return PointProgram(
            unknowns=self.unknowns,
            low=metric,
            high=metric,
            contraction=self._contraction_points(c2),
            floor=self.problem.floor,
            solver=self.problem.solver,
        )

    def _metric_points(self, at: Array) -> Points:
        return finite(metric_points(self.forms, self.unknowns, at, self.problem.floor))

    def _contraction_points(self, at: Array) -> Points:
        return finite(contraction_points(self.forms, self.unknowns, at, self.rate))

    def _add(self, attack: Attack, y: Array) -> bool:
        """Take new points into the program; False if there are none."""
        program = self._without_loose(y)
        fresh = (
            _new(self._metric_points(attack.low), program.low),
            _new(self._metric_points(attack.high), program.high),
            _new(self._contraction_points(attack.contraction), program.contraction),
        )
        old = (program.low, program.high, program.contraction)
        low, high, contraction = (a.joined(b) for a, b in zip(old, fresh, strict=True))
        self.program = replace(program, low=low, high=high, contraction=contraction)
        return any(len(points.at) for points in fresh)

    def _without_loose(self, y: Array) -> PointProgram:
        """The program without conditions that hold by far at the unknowns y: they come back if they are needed."""
        program, V = self.program, self.unknowns.matrices(y)
        rates = supported_rate(self.forms, V, program.contraction.at)
        top = largest(self.forms(program.high.at).metric(V))
        return replace(
            program,
            low=program.low.kept(self._floor_margin(V, program.low.at) < 1 + _LOOSE),
            high=program.high.kept(top > (1 - _LOOSE) * self.bound),
            contraction=program.contraction.kept(rates < (1 + _LOOSE) * self.rate),
        )

    def _attack(self, coefficients: Array) -> Attack:
        """The worst points for these coefficients, by sampling."""
        c2, short = self._worst(
            self.contracting, lambda x: self.rate - supported_rate(self.forms, coefficients, x), 16
        )
        low, least = self._worst(self.bounded, lambda x: -self._floor_margin(coefficients, x), 6)
        high, most = self._worst(self.bounded, lambda x: largest(self.forms(x).metric(coefficients)), 6)
        floor, ceiling = -float(least[0]), float(most[0])
        return Attack(
            low=low[least > -1],
            high=high[most > self.bound * (1 + self.gap)],
            contraction=c2[short > 0],
            shortfall=float(short[0]),
            kappa=ceiling / floor if floor > 0 else np.inf,
            scale=1 / floor if floor > 0 else 1.0,
        )

    def _worst(self, region: Region, score: Callable[[Array], Array], keep: int) -> tuple[Array, Array]:
        samples = 800 * (1 + len(region.inner))
        return worst(score, region, self.generator, samples=samples, climbers=2 * keep, keep=keep)

    def _floor_margin(self, coefficients: Array, points: Array) -> Array:
        """The largest multiple of the floor below W."""
        here = self.forms(points)
        W = here.metric(coefficients)
        if self.problem.floor == "identity":
            return -largest(-W)
        t = whitening(W)
        reached = largest(t @ here.input @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, 1 / reached, -1.0)

    def _tell(self, attack: Attack) -> None:
        if self.problem.progress:
            self.problem.progress(
                f"round {self.rounds}: kappa >= {self.bound:.5g}; this metric {attack.kappa:.5g}, short of the rate "
                f"by {attack.shortfall:.2g}; {self.program.size} conditions"
            )

    # -- answer ------------------------------------------------------------------------------------------------

    def _with_witness(self, attack: Attack, found: Judgement) -> Attack:
        if found.at is None:
            return attack
        at = canonical(found.at[None], self.bounded.symmetries)
        if found.condition == "C1":
            return replace(attack, low=np.concatenate([attack.low, at]))
        return replace(attack, contraction=np.concatenate([attack.contraction, at]))

    def _count(self, solution: ConicSolution) -> ConicSolution:
        self.solver_seconds += solution.seconds
        return solution

    def _answer(self, best: tuple[float, Array] | None, feasible: bool | None, status: str) -> Proposal:
        return Proposal(
            route=ROUTE,
            coefficients=best[1] if best else None,
            kappa=best[0] if best else np.inf,
            bound=self.bound,
            feasible=feasible,
            status=status,
            rounds=self.rounds,
            seconds=time.perf_counter() - self.began,
            solver_seconds=self.solver_seconds,
        )


def supported_rate(forms: FormsTape, coefficients: Array, points: Array) -> Array:
    """The largest rate that C2 permits at each point; -inf where W is not positive."""
    F, W = forms(points).contraction(coefficients)
    if not F.shape[-1]:
        return np.full(len(points), np.inf)
    t = whitening(W)
    rate = -0.5 * largest(t @ F @ np.swapaxes(t, -1, -2))
    return np.where(largest(-W) < 0, rate, -np.inf)


def largest(matrices: Array) -> Array:
    """The largest eigenvalues of symmetric matrices; inf where they are not finite."""
    known = finite_matrices(matrices)
    safe = np.where(known[:, None, None], matrices, 0.0)
    return np.where(known, np.linalg.eigvalsh(safe)[:, -1], np.inf)


def _new(points: Points, old: Points) -> Points:
    """The points that are not there yet."""
    known = np.array([bool((np.abs(old.at - x).max(axis=1) > 1e-7).all()) for x in points.at], dtype=bool)
    return points.kept(known)

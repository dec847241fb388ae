"""Synthesis by counterexamples: conditions at points, then branch and bound, whose witness is the next point.

Works for every expression that a specification allows. Each round solves the conditions at points (`program`): the
least kappa there bounds the family's from below; a metric from the middle of what is feasible slightly above it is
attacked by sampling (`sampling`) and, once sampling finds nothing, by `verify` on the rounded coefficients.
Untrusted: what it proposes is rounded and proven by its caller again.
"""

from __future__ import annotations

import time
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
from tubecert.metric.synthesis.program import PointProgram, contraction_points, finite, metric_points
from tubecert.metric.synthesis.sampling import Region, floats, worst

ROUTE = "cegis"
_ROUNDS = 40
_GAP = 0.01  # between kappa and its bound
_HOPELESS = 1e7  # a larger kappa is no metric
_SAMPLES = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class Attack:
    """What sampling found about given coefficients: the worst points, the rate that holds there, kappa."""

    metric: Array
    contraction: Array
    shortfall: float
    kappa: float
    scale: float


def propose(problem: SynthesisProblem) -> Proposal:
    """The member of the family with nearly the least kappa at the rate asked for, or why there is none."""
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
        some = np.random.default_rng(13).uniform(lo, hi, (20 * len(problem.family.functions) + 20, len(lo)))
        self.forms.orthonormalise(np.concatenate([some, *(some * signs for signs in symmetries)]))
        affine = self.forms.affine_variables(lo, hi)
        self.contracting = Region(
            lo=lo, hi=hi, variables=self.forms.variables, at_ends=affine, symmetries=symmetries
        )
        own = self.forms.metric_variables
        if problem.floor == "input":
            own = tuple(sorted({*own, *self.forms.input_variables}))
        self.bounded = Region(lo=lo, hi=hi, variables=own, symmetries=symmetries)
        self.generator = np.random.default_rng(11)
        self.bound, self.solver_seconds, self.rounds = 0.0, 0.0, 0
        self.program = self._start()

    def run(self) -> Proposal:
        """Rounds of solving and attacking until the metric holds within the gap."""
        best: tuple[float, Array] | None = None
        limit = min(self.problem.limit or _HOPELESS, _HOPELESS)
        for self.rounds in range(1, _ROUNDS + 1):
            least = self._count(self.program.least_kappa())
            if least.values is None or least.feasible is False:
                return self._answer(best, least.feasible, least.status)
            kappa = float(least.values[-1])
            if not np.isfinite(kappa) or kappa <= 0:
                return self._answer(best, None, "the solver's kappa is no positive number")
            if least.feasible and np.isfinite(least.bound):
                self.bound = max(self.bound, min(kappa, least.bound))
            if self.bound > limit:
                return self._answer(best, False, f"kappa is at least {self.bound:.4g}, above the limit")
            central = self._count(self.program.central(kappa * (1 + _GAP), _GAP / 4, least.values[:-1]))
            y = least.values if central.values is None else central.values
            coefficients = self.unknowns.matrices(y[:-1])
            attack = self._attack(coefficients, kappa)
            if self.problem.progress:
                self.problem.progress(
                    f"round {self.rounds}: kappa >= {self.bound:.5g}, this metric {attack.kappa:.5g}, "
                    f"rate short by {attack.shortfall:.3g} at {len(attack.contraction)} points; "
                    f"{least.status} {least.iterations}, {central.status} {central.iterations}"
                    f"{len(self.program.metric.at)} + {len(self.program.contraction.at)} conditions"
                )
            if attack.shortfall <= 0 and np.isfinite(attack.kappa):
                if best is None or attack.kappa < best[0]:
                    best = attack.kappa, self.forms.coefficients(coefficients) * attack.scale
                if attack.kappa <= self.bound * (1 + 1.1 * _GAP):
                    found = counterexample(self.problem, best[1])
                    if found.proven:
                        return self._answer(best, True, "no counterexample, by branch and bound")
                    attack = self._with_witness(attack, found)
                    best = None
            if not self._add(attack):
                return self._answer(best, None, "no further points to add")
        return self._answer(best, None, f"gave up after {_ROUNDS} rounds")

    # -- points ------------------------------------------------------------------------------------------------

    def _start(self) -> PointProgram:
        inner = len(self.contracting.inner)
        c2 = [
            self.contracting.corners(64, self.generator),
            self.contracting.random(12 * (1 + inner), self.generator),
        ]
        c1 = [
            self.bounded.corners(32, self.generator),
            self.bounded.random(8 * len(self.bounded.variables) + 1, self.generator),
        ]
        metric, contraction = (
            np.unique(canonical(np.concatenate(points), self.bounded.symmetries), axis=0)
            for points in (c1, c2)
        )
        return PointProgram(
            unknowns=self.unknowns,
            metric=finite(metric_points(self.forms, self.unknowns, metric, self.problem.floor)),
            contraction=finite(contraction_points(self.forms, self.unknowns, contraction, self.rate)),
            floor=self.problem.floor,
            solver=self.problem.solver,
        )

    def _add(self, attack: Attack) -> bool:
        """Take new points into the program; False if there are none."""
        program = self.program
        c1 = metric_points(self.forms, self.unknowns, attack.metric, self.problem.floor)
        c2 = contraction_points(self.forms, self.unknowns, attack.contraction, self.rate)
        c1, c2 = (
            _new(finite(points), old) for points, old in ((c1, program.metric), (c2, program.contraction))
        )
        self.program = replace(
            program, metric=program.metric.joined(c1), contraction=program.contraction.joined(c2)
        )
        return bool(len(c1.at) or len(c2.at))

    def _attack(self, coefficients: Array, kappa: float) -> Attack:
        """The worst points for these coefficients, by sampling."""
        c2, short = worst(
            lambda x: self.rate - supported_rate(self.forms, coefficients, x),
            self.contracting,
            self.generator,
            samples=_SAMPLES,
            climbers=24,
            keep=12,
        )
        low, least = worst(
            lambda x: -self._floor_margin(coefficients, x),
            self.bounded,
            self.generator,
            samples=_SAMPLES // 4,
            climbers=12,
            keep=4,
        )
        high, most = worst(
            lambda x: largest(self.forms(x).metric(coefficients)),
            self.bounded,
            self.generator,
            samples=_SAMPLES // 4,
            climbers=12,
            keep=4,
        )
        floor, ceiling = -float(least[0]), float(most[0])
        ratio = ceiling / floor if floor > 0 else np.inf
        return Attack(
            metric=np.concatenate([low[least > -1], high[most > kappa]]),
            contraction=c2[short > 0],
            shortfall=float(short[0]) if len(short) else -np.inf,
            kappa=ratio,
            scale=1 / floor if floor > 0 else 1.0,
        )

    def _floor_margin(self, coefficients: Array, points: Array) -> Array:
        """The largest multiple of the floor below W."""
        here = self.forms(points)
        W = here.metric(coefficients)
        if self.problem.floor == "identity":
            return -largest(-W)
        t = whitening(W)
        reached = largest(t @ here.input @ np.swapaxes(t, -1, -2))
        return np.where(largest(-W) < 0, 1 / reached, -1.0)

    # -- proof and answer --------------------------------------------------------------------------------------

    def _with_witness(self, attack: Attack, found: Judgement) -> Attack:
        if found.at is None:
            return attack
        at = canonical(found.at[None], self.bounded.symmetries)
        if found.condition == "C1":
            return replace(attack, metric=np.concatenate([attack.metric, at]))
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


def _new(points, old):
    """The points that are not there yet."""
    known = np.array([bool((np.abs(old.at - x).max(axis=1) > 1e-7).all()) for x in points.at], dtype=bool)
    return points.kept(known)

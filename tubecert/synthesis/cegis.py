"""Synthesis by counterexamples: conditions at points, then attacks, whose worst points are the next conditions.

Works for every expression that a specification allows. Each round solves the conditions at points (`program`): the
least kappa there bounds the family's from below; a metric from the middle of what is feasible slightly above it is
attacked by sampling (`attack`) and, once that finds nothing, by branch and bound (`counterexample`).
Untrusted: what it proposes is rounded and proven by its caller.

The conditions at finitely many points as a semidefinite program in the coefficients and kappa.

At the `low` points floor <= W, at the `high` ones W <= kappa I, at the `contraction` points
-N'(F_0 + 2 rate W)N >= 0. Fewer points
are fewer conditions: the least kappa is a bound from below for every member of the family, as far as the solver may be
trusted. The blocks of a point are made once and kept.
Untrusted. Implements: (CCM_1), (CCM_2) at points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.enclosure.interval import Array
from tubecert.progress import Phase, Step
from tubecert.synthesis.attack import Attack, Attacker, Judgement, counterexample, floats
from tubecert.synthesis.conic import Affine, ConicProgram, ConicSolution, Semidefinite, solve
from tubecert.synthesis.forms import FormsTape, Unknowns, canonical, invariant_entries, upper
from tubecert.synthesis.problem import Floor, Proposal, SynthesisProblem
from tubecert.verdict import Verdict

_TOLERANCE, _ROUGH = 1e-7, 1e-5
_LEAST = 1e-4  # of kappa: keeps W definite where the floor is B B'
_SMALL = 0.01  # of the rate, for a W of mean eigenvalue kappa: of metrics alike, the smaller one


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points (N, n) and their rows on the unknowns, (N, s, U); `floor` (N, s): what W has to exceed there, or empty."""

    at: Array
    rows: Array
    floor: Array

    def kept(self, chosen: NDArray[np.bool_]) -> Points:
        """Those with a True in `chosen` (N,)."""
        return Points(at=self.at[chosen], rows=self.rows[chosen], floor=self.floor[chosen])

    def joined(self, other: Points) -> Points:
        """These and the others."""
        pairs = ((self.at, other.at), (self.rows, other.rows), (self.floor, other.floor))
        at, rows, floor = (np.concatenate(pair) for pair in pairs)
        return Points(at=at, rows=rows, floor=floor)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointProgram:
    """The conditions at `low` and `high` points (C1) and `contraction` points (C2); `rate` in the unit of the rows."""

    unknowns: Unknowns
    low: Points
    high: Points
    contraction: Points
    floor: Floor
    rate: float
    solver: str

    def least_kappa(self) -> ConicSolution:
        """Minimise kappa; the unknowns come first, kappa last."""
        width = self.unknowns.count
        cost = np.zeros(width + 1)
        cost[-1] = 1.0
        blocks = [*self._between(0.0, None), *self._contracting(None)]
        return solve(ConicProgram(cost=cost, semidefinite=blocks), self.solver, tolerance=_TOLERANCE)

    def central(self, kappa: float, slack: float, reference: Array) -> ConicSolution:
        """With kappa given, the greatest extra rate mu (the last unknown), W kept inside by a relative `slack`.

        -N'(F_0 + 2 rate W)N >= 2 mu N'W_r N with W_r given by `reference`, the unknowns found before (U,); mu is in the
        unit of the rows. Under the floor B B' parts of W may be anything between the floor and kappa I; so that no last
        digit of a solver decides, a little is paid for the trace of W.
        """
        cost = np.zeros(self.unknowns.count + 1)
        cost[-1] = -1.0
        if self.floor == "input":
            diagonal = upper(np.eye(self.unknowns.mask.shape[1])) > 0
            trace = self.low.rows[:, diagonal].sum(axis=1).mean(axis=0)
            cost[:-1] = _SMALL * self.rate / (kappa * diagonal.sum()) * trace
        blocks = [*self._between(slack, kappa), *self._contracting(reference)]
        return solve(ConicProgram(cost=cost, semidefinite=blocks), self.solver, tolerance=_ROUGH)

    @property
    def size(self) -> int:
        """The number of conditions."""
        return len(self.low.at) + len(self.high.at) + len(self.contraction.at)

    def _between(self, slack: float, kappa: float | None) -> list[Semidefinite]:
        """W - floor >= 0 at the low, kappa I - W >= 0 at the high points; kappa may be the last unknown."""
        n = self.unknowns.mask.shape[1]
        eye = upper(np.eye(n))
        unknown, known = (eye, 0.0 * eye) if kappa is None else (0.0 * eye, kappa * eye)
        blocks = [_block(n, (1 - slack) * known, -rows, unknown) for rows in self.high.rows]
        for rows, floor in zip(self.low.rows, self.low.floor, strict=True):
            blocks.append(_block(n, -(1 + slack) * floor, rows, 0.0 * eye))
            if self.floor == "input":
                blocks.append(_block(n, -_LEAST * known, rows, -_LEAST * unknown))
        return blocks

    def _contracting(self, reference: Array | None) -> list[Semidefinite]:
        """The C2 blocks; with a reference, less 2 mu N'W_r N."""
        blocks: list[Semidefinite] = []
        if not self.contraction.rows.shape[1]:
            return blocks  # as many inputs as states: C2 is void
        for rows, weight in zip(self.contraction.rows, self.contraction.floor, strict=True):
            order = round((np.sqrt(8 * len(rows) + 1) - 1) / 2)
            last = np.zeros(len(rows)) if reference is None else -2 * weight.reshape(rows.shape) @ reference
            blocks.append(_block(order, np.zeros(len(rows)), rows, last))
        return blocks


def _block(order: int, constant: Array, rows: Array, last: Array) -> Semidefinite:
    slopes = np.concatenate([rows, last[:, None]], axis=1)
    return Semidefinite(orders=(order,), entries=Affine(constant=constant, slopes=sparse.csr_array(slopes)))


def metric_points(forms: FormsTape, unknowns: Unknowns, at: Array, floor: Floor) -> Points:
    """Points for C1."""
    here = forms(at)
    n = at.shape[1]
    below = here.input if floor == "input" else np.broadcast_to(np.eye(n), (len(at), n, n))
    return Points(at=at, rows=here.metric_rows(unknowns), floor=upper(below))


def contraction_points(forms: FormsTape, unknowns: Unknowns, at: Array, rate: float) -> Points:
    """Points for C2; `floor` holds the rows of N'W N."""
    here = forms(at)
    weight = here.projected_rows(unknowns)
    floor = weight.reshape(len(at), weight.shape[1] * weight.shape[2])
    return Points(at=at, rows=here.contraction_rows(unknowns, rate), floor=floor)


def finite(points: Points) -> Points:
    """Without those at which something is not finite."""
    known = np.isfinite(points.rows).all(axis=(1, 2)) & np.isfinite(points.floor).all(axis=1)
    return points.kept(np.asarray(known))


ROUTE = "cegis"
_ROUNDS = 60
_GAP = 3e-3  # between kappa and its bound
_FINE, _CHEAP = 1e-3, 40  # the same, for so few unknowns
_SHARP = 3e-4  # the same, where .1 % is wanted
_WIDER, _WIDEST = 3.0, 0.1  # where the solver's accuracy leaves no room
_HOPELESS = 1e7  # a larger kappa is no metric
_LOOSE = 0.2  # conditions that hold by so much, relatively, are dropped


def propose(problem: SynthesisProblem) -> Proposal:
    """The member of the family with nearly the least kappa at the rate asked for, or why there is none."""
    with np.errstate(all="ignore"):
        synthesis = _Synthesis(problem)
        try:
            return synthesis.run()
        except _EndedError as end:
            return synthesis.answer(end.feasible, end.status)


class _EndedError(Exception):
    """There is nothing more to be done: the solver's opinion, and why."""

    def __init__(self, feasible: bool | None, status: str) -> None:
        super().__init__(status)
        self.feasible, self.status = feasible, status


class _Synthesis:
    """The state of one run: the conditions, the bound, and the best metric so far."""

    def __init__(self, problem: SynthesisProblem) -> None:
        self.problem = problem
        self.forms = FormsTape(problem.model, problem.family, problem.scaled)
        lo, hi = floats(problem.safe_set)
        self.symmetries, free = invariant_entries(
            problem.model, problem.family, np.stack([lo, hi], axis=1), self.forms
        )
        self.unknowns = Unknowns(free)
        self.width = hi - lo
        self.generator = np.random.default_rng(11)
        some = self.generator.uniform(lo, hi, (20 * len(problem.family.functions) + 20, len(lo)))
        self.forms.orthonormalise(np.concatenate([some, *(some * signs for signs in self.symmetries)]))
        self.attacker = Attacker.of(problem, self.forms, self.symmetries, self.generator)
        self.gap = _FINE if self.unknowns.count <= _CHEAP else _GAP
        self.gap = min(self.gap, _SHARP) if problem.sharp else self.gap
        self.limit = min(problem.limit or _HOPELESS, _HOPELESS)
        self.bound, self.rounds = 0.0, 0
        self.extreme: Array | None = None  # the unknowns of least kappa
        self.best: tuple[float, Array] | None = None  # kappa and V_k
        self.program = self._start()

    def run(self) -> Proposal:
        """Rounds of solving and attacking until the metric holds within the gap."""
        most = _ROUNDS if self.problem.rounds is None else min(_ROUNDS, self.problem.rounds)
        for self.rounds in range(1, most + 1):
            y = self._candidate()
            inner = self.unknowns.matrices(y)
            attack = self.attacker.attack(inner, self.bound * (1 + self.gap))
            self._tell(attack)
            if not attack.failed:
                found = attack.kappa, self.forms.coefficients(inner) * attack.scale
                self.best = min(self.best or found, found, key=lambda pair: pair[0])
                if attack.kappa <= self.bound * (1 + 1.1 * self.gap):
                    order = self.attacker.contracting.order
                    judged = counterexample(self.problem, found[1], self.symmetries, order)
                    if judged.verdict is not Verdict.REFUTED:
                        self.best = found
                        return self.answer(True, _words(judged))
                    attack, self.best = self._with_witness(attack, judged), None
            self._add(attack, y)
        return self.answer(None, f"gave up after {most} rounds")

    def answer(self, feasible: bool | None, status: str) -> Proposal:
        """What there is now."""
        return Proposal(
            route=ROUTE,
            coefficients=self.best[1] if self.best else None,
            kappa=self.best[0] if self.best else np.inf,
            bound=self.bound,
            feasible=feasible,
            status=status,
            rounds=self.rounds,
        )

    # -- solving -----------------------------------------------------------------------------------------------

    def _candidate(self) -> Array:
        """The unknowns of a central metric; the least kappa is asked for only when its last value became too small."""
        central = None if self.extreme is None else self._central(self.extreme)
        if self.extreme is None or central is None:
            self.extreme = self._least()
            central = self._central(self.extreme)
        return self.extreme if central is None else central

    def _least(self) -> Array:
        """The unknowns of least kappa; raises the bound, or `_EndedError` if there is none."""
        least = self.program.least_kappa()
        if least.values is None or not least.feasible:
            raise _EndedError(least.feasible, least.status)
        kappa = float(least.values[-1])
        if not 0 < kappa < np.inf:
            raise _EndedError(None, "the solver's kappa is no positive number")
        self.bound = max(self.bound, min(kappa, least.bound))
        if self.bound > self.limit:
            raise _EndedError(False, f"kappa is at least {self.bound:.4g}, above the limit")
        return least.values[:-1]

    def _central(self, reference: Array) -> Array | None:
        """The unknowns in the middle of what is feasible slightly above the bound; None if nothing is."""
        found = self.program.central(self.bound * (1 + self.gap), self.gap / 4, reference)
        if found.values is None or not found.feasible or not found.values[-1] > 0:
            return None
        return found.values[:-1]

    # -- conditions --------------------------------------------------------------------------------------------

    def _start(self) -> PointProgram:
        """A few points to begin with: corners and random ones."""
        bounded, contracting = self.attacker.bounded, self.attacker.contracting
        c1, c2 = (
            np.concatenate([region.corners(64, self.generator), region.random(count, self.generator)])
            for region, count in (
                (bounded, 10 * len(bounded.variables) + 1),
                (contracting, 20 * len(contracting.inner) + 10),
            )
        )
        metric, contraction = self._points(c1, c2)
        return PointProgram(
            unknowns=self.unknowns,
            low=metric,
            high=metric,
            contraction=contraction,
            floor=self.problem.floor,
            rate=self.problem.rate / self.problem.scaled.rate,
            solver=self.problem.solver,
        )

    def _points(self, c1: Array, c2: Array) -> tuple[Points, Points]:
        c1, c2 = (np.unique(canonical(at, self.symmetries), axis=0) for at in (c1, c2))
        return (
            finite(metric_points(self.forms, self.unknowns, c1, self.problem.floor)),
            finite(contraction_points(self.forms, self.unknowns, c2, self.problem.rate)),
        )

    def _add(self, attack: Attack, y: Array) -> None:
        """Take new points into the program; if there are none, a wider gap leaves more room inside."""
        program = self._without_loose(y)
        low, contraction = self._points(attack.low, attack.contraction)
        high, _ = self._points(attack.high, attack.contraction[:0])
        fresh = [
            _new(points, old, self.width)
            for points, old in ((low, program.low), (high, program.high), (contraction, program.contraction))
        ]
        if not any(len(points.at) for points in fresh):
            self.gap *= _WIDER
            if self.gap > _WIDEST:
                raise _EndedError(None, "attacks find no further points")
        self.program = replace(
            program,
            low=program.low.joined(fresh[0]),
            high=program.high.joined(fresh[1]),
            contraction=program.contraction.joined(fresh[2]),
        )

    def _without_loose(self, y: Array) -> PointProgram:
        """The program without conditions that hold by far at the unknowns y: they come back if they are needed."""
        program, attacker, V = self.program, self.attacker, self.unknowns.matrices(y)
        most = (1 + _LOOSE) * self.problem.rate
        return replace(
            program,
            low=program.low.kept(attacker.floors(V, program.low.at) < 1 + _LOOSE),
            high=program.high.kept(attacker.tops(V, program.high.at) > (1 - _LOOSE) * self.bound),
            contraction=program.contraction.kept(attacker.rates(V, program.contraction.at) < most),
        )

    def _with_witness(self, attack: Attack, found: Judgement) -> Attack:
        if found.at is None:
            return attack
        at = found.at[None]
        if found.condition == "C1":
            return replace(attack, low=np.concatenate([attack.low, at]))
        return replace(attack, contraction=np.concatenate([attack.contraction, at]))

    def _tell(self, attack: Attack) -> None:
        if self.problem.progress:
            words = (
                f"round {self.rounds}: kappa >= {self.bound:.5g}; this metric {attack.kappa:.5g}, short of the rate "
                f"by {attack.shortfall:.2g}; {self.program.size} conditions"
            )
            self.problem.progress(Step(phase=Phase.SYNTHESIS, name=words))


def _new(points: Points, old: Points, width: Array) -> Points:
    """The points that are not there yet, in a box of a `width` (n,)."""
    known = [bool((np.abs((old.at - x) / width).max(axis=1) > 1e-7).all()) for x in points.at]
    return points.kept(np.array(known, dtype=bool))


def _words(judged: Judgement) -> str:
    if judged.verdict is Verdict.CERTIFIED:
        return "no counterexample, by branch and bound"
    return "no counterexample found within the budget"

"""What a ladder is asked, and each proposal of it with what became of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from fractions import Fraction

from tubecert.claims.failures import Outcome, Proven
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.metric.verify import Proofs
from tubecert.model import ControlAffineModel
from tubecert.progress import Progress
from tubecert.synthesis.family import Choice
from tubecert.synthesis.problem import Floor, Proposal, SynthesisProblem
from tubecert.synthesis.rounding import Rejected, VerifiedMetric

Route = Callable[[SynthesisProblem], Proposal]
Box = tuple[tuple[Fraction, Fraction], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What is wanted: a metric of `model` on `safe_set`.

    `degree` None: raised as long as it pays; `variables` None: chosen; `routes` in the order in which they are tried
    for constant W, backwards where W moves; `limit` of the condition number. Unless
    `thorough`, only the first route and back-off are tried; `rounds`: of all proposals together. `pace`: where the
    search for the largest rate begins, in 1/s.
    """

    model: ControlAffineModel = field(repr=False)
    safe_set: Box
    routes: tuple[tuple[str, Route], ...]
    degree: int | None = None
    variables: tuple[str, ...] | None = None
    limit: float | None = None
    solver: str = "clarabel"
    coordinates: Choice = "identity"
    half_widths: tuple[Fraction, ...] = ()
    thorough: bool = True
    rounds: int | None = None
    effort: Effort = field(default_factory=Effort)
    proofs: Proofs = field(default_factory=Proofs)
    pace: Fraction = Fraction(1)
    progress: Progress | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """One proposal and what became of it; `condition_number` is proven, None if nothing was.

    `undecided`: its proof ran out of boxes.
    """

    rate: float
    degree: int
    floor: Floor
    route: str
    outcome: Outcome
    condition_number: float | None = None
    undecided: bool = False
    seconds: float
    solver_seconds: float


def attempted(
    problem: SynthesisProblem,
    rate: Fraction,
    proposal: Proposal,
    outcome: VerifiedMetric | Rejected,
    seconds: float,
) -> Attempt:
    """What became of a proposal, to be told."""
    proven = outcome if isinstance(outcome, VerifiedMetric) else None
    return Attempt(
        rate=float(rate),
        degree=problem.family.degree,
        floor=problem.floor,
        route=proposal.route,
        outcome=outcome.outcome if isinstance(outcome, Rejected) else Proven(),
        condition_number=None if proven is None else proven.condition_number.above,
        undecided=isinstance(outcome, Rejected) and outcome.undecided,
        seconds=seconds,
        solver_seconds=proposal.solver_seconds,
    )


def kappa(metric: VerifiedMetric) -> float:
    """What a problem minimises, as it came out."""
    plain = metric.floor == "identity" and metric.coordinates == "identity"
    return metric.condition_number.above if plain else metric.proposal.kappa


def guarded(name: str, route: Route, problem: SynthesisProblem) -> Proposal:
    """What a route proposes; a solver that breaks down has proposed nothing."""
    started = time.perf_counter()
    try:
        return route(problem)
    except (ArithmeticError, ValueError, RuntimeError) as error:
        what = " ".join(str(error).split())[:120] or type(error).__name__
        return Proposal(
            route=name,
            coefficients=None,
            kappa=float("inf"),
            feasible=None,
            status=f"broke down ({what})",
            seconds=time.perf_counter() - started,
            solver_seconds=0.0,
        )


def routes(choice: str) -> tuple[tuple[str, Route], ...]:
    """The route that was chosen; for `auto` both: counterexamples for constant W, sums of squares first where it moves.

    Counterexamples treat every expression, sums of squares only polynomials, sines and cosines.
    """
    from tubecert.synthesis import cegis, sos

    known: dict[str, Route] = {"cegis": cegis.propose, "sos": sos.propose_sos}
    names = ("cegis", "sos") if choice == "auto" else (choice,)
    return tuple((name, known[name]) for name in names)

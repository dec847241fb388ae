"""Why no metric was found, and what would change that: what the attempts lack, and a degree, rate or box that works."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from math import inf

from tubecert.claims.advice import (
    AskForRateUpTo,
    HigherDegree,
    LowerRate,
    NoKnobAlone,
    RaiseBudget,
    ShrinkSafeSet,
    TurnKnob,
)
from tubecert.claims.failures import (
    NoneCertified,
    NothingFound,
)
from tubecert.claims.family import Relax
from tubecert.claims.gains import ConditionHolds
from tubecert.pipeline.advice import Ask, Ledger, advised
from tubecert.pipeline.certification import answer, explain, result
from tubecert.pipeline.deadline import OutOfTime
from tubecert.pipeline.synthesised import Row
from tubecert.progress import Progress
from tubecert.spec import Spec
from tubecert.stages.judged import Judged
from tubecert.stages.question import Question
from tubecert.synthesis.attempts import Attempt
from tubecert.synthesis.family import suggested
from tubecert.synthesis.ladder import Ladder
from tubecert.verdict import Verdict


def none_certified(rows: Sequence[Row]) -> NoneCertified | None:
    """That metrics were found, and what each of them lacks; None if none was found."""
    failed = [
        (row, row.claim)
        for row in rows
        if row.claim is not None and row.verdict is not None and row.floor == "identity"
    ]
    if not failed:
        return None
    (slow, slow_claim), (fast, fast_claim) = failed[0], failed[-1]
    return NoneCertified(
        compared=len(failed),
        slowest=slow.rate,
        fastest=fast.rate,
        slow=slow_claim,
        slow_verdict=slow.verdict or Verdict.UNDECIDED,
        fast=fast_claim,
        fast_verdict=fast.verdict or Verdict.UNDECIDED,
    )


def nearest(rows: Iterable[Row]) -> Row | None:
    """The metric with which a machine's loop comes nearest to a proof; None where certificate H does not decide."""
    return min((row for row in rows if row.by_machine), key=lambda row: row.demand, default=None)


def lacking(question: Question) -> tuple[Relax, ...]:
    """What fills the level of a loop, and machines that would serve with its metric; nothing if time is up."""
    try:
        end = answer(question)
    except OutOfTime:
        return ()
    return explain(end).reasons[0].relax if isinstance(end, Judged) else ()


def closest(rows: Iterable[Row]) -> Row | None:
    """The metric whose condition is missed by least; None where none says by how much."""
    return max((row for row in rows if _margin(row) > -inf), key=_margin, default=None)


def _margin(row: Row) -> float:
    """What is left of the condition that fails, a share of what is allowed."""
    claim = row.claim
    if row.floor != "identity" or not isinstance(claim, ConditionHolds) or claim.margin is None:
        return -inf
    return -inf if claim.margin.below is None else claim.margin.below


def serving(questioned: Callable[[Progress], Question], ask: Ask, told: Progress) -> tuple[Relax, ...]:
    """What would certify with a metric, in numbers; nothing if time is up. Other rates have been tried."""
    ledger = Ledger(told)
    try:
        end = answer(questioned(ledger))
        found = advised(result(end), end, ledger, ask)
    except OutOfTime:
        return ()
    relax = () if found.reason is None else found.reason.relax
    return tuple(
        each
        for each in relax
        if isinstance(each, NoKnobAlone) or (isinstance(each, TurnKnob) and each.knob != "rate")
    )


def tried(attempts: Sequence[Attempt]) -> NothingFound:
    """That no proposal was a metric, and which there were."""
    return NothingFound(
        attempts=len(attempts),
        routes=tuple(sorted({a.route for a in attempts})),
        degrees=tuple(sorted({a.degree for a in attempts})),
        last=attempts[-1].outcome if attempts else None,
    )


def remedies(
    ladder: Ladder, rate: Fraction | None, degree: int | None, say: Callable[[str], None]
) -> list[Relax]:
    """What to change where nothing was found: a degree, a rate or a box that works, by few quick attempts."""
    if any(attempt.undecided for attempt in ladder.attempts):
        return [RaiseBudget(proof=True)]
    found: list[Relax] = []
    if degree is not None and suggested(ladder.request.model):
        found.append(HigherDegree(degree=degree))
    if rate is not None:
        say("looking for a rate that works")
        cheap = ladder.cheap()
        lower = cheap.lower_rate(rate)
        if lower is not None:
            found.append(AskForRateUpTo(rate=lower))
        say("looking for a box that works")
        box = cheap.smaller_box(rate)
        if box is not None:
            found.append(ShrinkSafeSet(factor=float(box), rate=rate))
    return found or [LowerRate(), ShrinkSafeSet()]


def equilibria(spec: Spec) -> list[tuple[Fraction, ...]]:
    """Rational points that may be equilibria: the plan's, its target, the centre of the box, the origin."""
    points: list[tuple[Fraction, ...]] = []
    if spec.trajectory.kind == "equilibrium" and all(t.expression.is_constant for t in spec.trajectory.x):
        points.append(tuple(t.expression.fraction for t in spec.trajectory.x))
    if spec.trajectory.task is not None:
        points.append(spec.trajectory.task.target)
    points.append(tuple((low + high) / 2 for low, high in spec.safe_set))
    points.append((Fraction(0),) * len(spec.states))
    return [
        p
        for p in dict.fromkeys(points)
        if all(low <= q <= high for q, (low, high) in zip(p, spec.safe_set, strict=True))
    ]

"""Why no metric was found, and what would change that: a degree, a rate, a box, a tube that works."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Final

from tubecert.claims.advice import (
    AskForRateUpTo,
    HigherDegree,
    LowerRate,
    RaiseBudget,
    ShrinkSafeSet,
)
from tubecert.claims.failures import Attempt, NoneCertified, NothingFound
from tubecert.claims.family import Relax
from tubecert.enclosure.constant import round_down
from tubecert.pipeline.synthesised import Row
from tubecert.spec import Spec
from tubecert.synthesis.family import suggested
from tubecert.synthesis.ladder import Ladder
from tubecert.verdict import Verdict

_SHARES: Final = (Fraction(1, 2), Fraction(1, 4))  # of the safe set: widths that are tried
_MANY, _APART = 4, 4  # states, and their ranges, that make radii doubtful


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


def half_widths(spec: Spec) -> tuple[Fraction, ...]:
    """What the states are measured in: the tube's half-widths where all are asked for, else the safe set's."""
    asked = dict(spec.tube.half_widths)
    if all(name in asked for name in spec.states):
        return tuple(asked[name] for name in spec.states)
    return tuple((high - low) / 2 for low, high in spec.safe_set)


def otherwise(spec: Spec) -> Iterator[Spec]:
    """The specification with other tubes, where its radii measure states that differ in unit or scale.

    The same radii in coordinates of the tube, if it is a ball; then half-widths, as shares of the safe set.
    """
    tube, units, sizes = spec.tube, dict(spec.units), half_widths(spec)
    known = {units[name] for name in spec.states if name in units}
    alike = len(spec.states) < _MANY and len(known) < 2 and max(sizes) < _APART * min(sizes)
    if tube.half_widths or alike:
        return
    if not tube.auto:
        yield replace(spec, tube=replace(tube, coordinates="auto"))
    for share in _SHARES:
        widths = tuple(round_down(float(share * size), 2) for size in sizes)
        asked = tuple(zip(spec.states, widths, strict=True))
        yield replace(
            spec, tube=replace(tube, epsilon=None, rho_a=None, coordinates="auto", half_widths=asked)
        )

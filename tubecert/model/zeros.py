"""Zeros of expressions on a box: that there is none, by its sign, or where one is."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction

import numpy as np

from tubecert.enclosure.branch_and_bound import Decision, Effort, decide
from tubecert.enclosure.domain import BoxDomain, Range
from tubecert.enclosure.pencil import scalar
from tubecert.enclosure.tape import Tape
from tubecert.expression import (
    ZERO,
    Expression,
    constant,
    substitute,
)
from tubecert.verdict import Verdict


def nonzero(e: Expression, ranges: dict[str, Range], effort: Effort) -> Decision:
    """Whether e has no zero on a box: proven if it is of one sign, refuted by a point of either sign."""
    domain = BoxDomain(ranges)
    positive = decide(scalar(-e), domain, 0.0, effort)
    if positive.verdict is Verdict.CERTIFIED:
        return positive
    negative = decide(scalar(e), domain, 0.0, effort)
    if negative.verdict is Verdict.CERTIFIED:
        return negative
    if positive.verdict == negative.verdict is Verdict.REFUTED:
        # e <= 0 at one point and e >= 0 at the other, and a box is connected
        at = _between(e, positive.at, negative.at)
        return replace(negative, at=round_zero(e, at, ranges) or at)
    return replace(negative, verdict=Verdict.UNDECIDED)


def _between(e: Expression, low: dict[str, float], high: dict[str, float]) -> dict[str, float]:
    """A point near a zero of `e` on the segment between points where it is <= 0 and >= 0 (floats: only shown)."""
    names = tuple(high)
    tape = Tape([e], names)
    a, b = (np.array([at[name] for name in names]) for at in (low, high))
    for _ in range(60):
        middle = 0.5 * a + 0.5 * b
        value = tape.run_floats([np.array(x) for x in middle], ())[0]
        a, b = (middle, b) if value <= 0 else (a, middle)
    return dict(zip(names, (float(x) for x in b), strict=True))


def round_zero(e: Expression, at: dict[str, float], ranges: Mapping[str, Range]) -> dict[str, float] | None:
    """A decimal of few digits near the point where `e` is exactly zero, if there is one in the box."""
    return next((rounded for rounded in decimals(at, ranges) if vanishes(e, rounded)), None)


def decimals(at: dict[str, float], ranges: Mapping[str, Range]) -> Iterator[dict[str, float]]:
    """Decimals of few digits near a point, in the box."""
    for digits in (1, 3, 6):
        rounded = {name: round(value, digits) for name, value in at.items()}
        if all(ranges[v][0] <= Fraction(repr(value)) <= ranges[v][1] for v, value in rounded.items()):
            yield rounded


def vanishes(e: Expression, at: dict[str, float]) -> bool:
    """Whether `e` is zero, exactly, at the decimals that are shown for a point."""
    exact = {name: constant(Fraction(repr(value))) for name, value in at.items()}
    try:
        return substitute([e], exact)[0] is ZERO
    except ZeroDivisionError:  # a part of it is undefined there
        return False

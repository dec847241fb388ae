"""Theorem BW: certificate B window by window. Trusted. Implements: theory section 4f, (4.15), (4.16), (4.18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic

from tubecert.conditions.arithmetic import T, exp, maximum, number, quiet, sqrt
from tubecert.conditions.derived import prediction_error
from tubecert.conditions.predictor import Predictor
from tubecert.conditions.problem import Numbers
from tubecert.conditions.stretches import (
    Course,
    Gone,
    Stretch,
    through,
)
from tubecert.conditions.wind import felt, is_felt, prediction, taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Generic[T]):
    """The gains of B; `settling`: how long a window waits for the estimator to forget the one before, in s."""

    omega: T
    Gamma: T
    predictor: Predictor[T]
    settling: T


@dataclass(frozen=True, slots=True, kw_only=True)
class InWindow(Generic[T]):
    """A window of B: its course, S without and e with what the estimator's error adds to it, v of the next window."""

    course: Course[T]
    uncertainty: T
    error: T
    left: T


@quiet
def along(
    numbers: Sequence[Numbers[T]], lengths: Sequence[T], speeds: Sequence[T], loop: Loop[T]
) -> tuple[InWindow[T], ...]:
    """Every window, one after another."""
    found: list[InWindow[T]] = []
    for n, length, Y in zip(numbers, lengths, speeds, strict=True):
        found.append(_following(n, length, Y, loop, found[-1]) if found else _first(n, length, Y, loop))
    return tuple(found)


def _first(n: Numbers[T], length: T, Y: T, loop: Loop[T]) -> InWindow[T]:
    """Window 1 of (4.16): one stretch."""
    V = _settled(n, Y, loop)
    stretch = _stretch(n, length, Y, loop, sqrt(V))
    course = through(n, loop.omega, [stretch], Gone(distance=n.d0, memory=n.H0))
    S = _rate(n, Y) / loop.omega
    return InWindow(course=course, uncertainty=S, error=_added(S, [stretch]), left=V)


def _following(n: Numbers[T], length: T, Y: T, loop: Loop[T], before: InWindow[T]) -> InWindow[T]:
    """A later window of (4.16): two stretches, with v of (4.15)."""
    V = _settled(n, Y, loop)
    excess = maximum(number(0, V), before.left - V)
    q = loop.predictor.q / 2 if is_felt(n) else loop.predictor.q
    stretches = [
        _stretch(n, loop.settling, Y, loop, sqrt(V + excess)),
        _stretch(n, length - loop.settling, Y, loop, sqrt(V + excess * exp(-q * loop.settling))),
    ]
    course = through(n, loop.omega, stretches, before.course.end)
    S = _rate(n, Y) / loop.omega
    return InWindow(
        course=course,
        uncertainty=S,
        error=_added(S, stretches),
        left=V + excess * exp(-q * length),
    )


def _added(S: T, stretches: Sequence[Stretch[T]]) -> T:
    """What the estimator's error adds to S at most, (4.16)."""
    error = number(0, S)
    for each in stretches:
        error = maximum(error, each.S - S + each.e)
    return error


def _rate(n: Numbers[T], Y: T) -> T:
    """s = Dht + Dhx Y, (4.15)."""
    return n.Dht + n.Dhx * Y


def _settled(n: Numbers[T], Y: T, loop: Loop[T]) -> T:
    """V: what |xt|^2 + |s~|^2/Gamma falls to, (2.11) or (7.8)."""
    p, s = loop.predictor, _rate(n, Y)
    if is_felt(n):
        return prediction(n, s, p, loop.Gamma, felt(n, p)) ** 2
    return prediction_error(n.Dh + n.R, s, p.q) ** 2 / loop.Gamma


def _stretch(n: Numbers[T], length: T, Y: T, loop: Loop[T], X: T) -> Stretch[T]:
    """(4.16)."""
    turning = n.DBpx * Y + n.DBp * loop.predictor.shifted
    return Stretch(
        length=length,
        S=_rate(n, Y) / loop.omega + turning * X + taken(n),
        e=loop.omega * n.DBp * X,
        jump=number(0, X),
    )

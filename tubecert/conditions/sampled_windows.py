"""Theorem CW: certificate C window by window. Trusted. Implements: theory section 4f, (4.17), (4.18)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic

from tubecert.conditions.arithmetic import T, decay_mean, exp, maximum, minimum, number, quiet
from tubecert.conditions.problem import Numbers
from tubecert.conditions.stretches import Course, Gone, Stretch, through
from tubecert.conditions.wind import beside, is_felt, pushed, taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop(Generic[T]):
    """The gains of C, with the mean age m of an estimate and w = Ts/(1 - e^(-omega Ts))."""

    Ts: T
    omega: T
    m: T
    w: T


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensed(Generic[T]):
    """What an estimate is wrong by depends on: s = Dht + Dhx Y, Y and constants, the largest of where it looks."""

    rate: T
    speed: T
    h: T
    B: T
    B_x: T
    B_pinv: T
    B_pinv_x: T
    taken: T
    beside: T

    def with_before(self, other: Sensed[T]) -> Sensed[T]:
        """The larger of each."""
        return Sensed(
            **{name: maximum(getattr(self, name), getattr(other, name)) for name in Sensed.__slots__}
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class InWindow(Generic[T]):
    """A window of C: its course, and what an estimate that is made in it depends on."""

    course: Course[T]
    sensed: Sensed[T]


@quiet
def along(
    numbers: Sequence[Numbers[T]], lengths: Sequence[T], speeds: Sequence[T], loop: Loop[T]
) -> tuple[InWindow[T], ...]:
    """Every window, one after another."""
    found: list[InWindow[T]] = []
    for n, length, Y in zip(numbers, lengths, speeds, strict=True):
        found.append(_following(n, length, Y, loop, found[-1]) if found else _first(n, length, Y, loop))
    return tuple(found)


def _sensed(n: Numbers[T], Y: T) -> Sensed[T]:
    """What (4.17) takes the larger of, in one window."""
    nothing = number(0, Y)
    other = beside(n)
    return Sensed(
        rate=n.Dht + n.Dhx * Y,
        speed=Y,
        h=n.Dh,
        B=n.DB,
        B_x=n.DBx,
        B_pinv=n.DBp,
        B_pinv_x=n.DBpx,
        taken=taken(n) if is_felt(n) else nothing,
        beside=nothing if other is None else other,
    )


def _first(n: Numbers[T], length: T, Y: T, loop: Loop[T]) -> InWindow[T]:
    """The first sample, in which nothing is known of h; then the filter starts at rest, (4.9), (4.17)."""
    own = _sensed(n, Y)
    H1 = minimum(n.Dh, n.H0 + own.rate * loop.Ts)
    d1 = n.d0 * exp(-n.lam * loop.Ts) + (n.beta * H1 + pushed(n)) * loop.Ts * decay_mean(n.lam * loop.Ts)
    stretches = [_stretch(own, length - loop.Ts, loop, number(0, Y))]
    course = through(n, loop.omega, stretches, Gone(distance=d1, memory=H1))
    highest = maximum(n.d0, course.supremum)
    return InWindow(course=replace(course, supremum=highest), sensed=own)


def _following(n: Numbers[T], length: T, Y: T, loop: Loop[T], before: InWindow[T]) -> InWindow[T]:
    """A later window of (4.17): two stretches."""
    own = _sensed(n, Y)
    both = own.with_before(before.sensed)
    look = 2 * loop.Ts
    # a saw-tooth that grows steeper may be ahead of its mean
    steeper = maximum(number(0, Y), both.rate - before.sensed.rate)
    swing = loop.Ts * (1 - decay_mean(loop.omega * loop.Ts))
    stretches = [
        _stretch(both, look, loop, steeper * swing),
        _stretch(own, length - look, loop, number(0, Y)),
    ]
    return InWindow(course=through(n, loop.omega, stretches, before.course.end), sensed=own)


def _stretch(at: Sensed[T], length: T, loop: Loop[T], jump: T) -> Stretch[T]:
    """S = s w + m (s + b Y) + what (7.6) adds."""
    b = minimum(at.B_pinv * at.B_x, at.B_pinv_x * at.B) * at.h
    turning = b * at.speed + at.B_pinv_x * at.beside * at.speed
    S = at.rate * loop.w + loop.m * (at.rate + turning) + at.taken
    return Stretch(length=length, S=S, e=number(0, S), jump=jump)

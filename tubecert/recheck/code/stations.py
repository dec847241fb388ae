"""Where a plan is looked at: stretches of time that cover it, each in one part."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import Ball, exact
from tubecert.recheck.code.words import UnreadError
from tubecert.recheck.curve import Curve

_STATIONS = 48  # of a plan of one part
_BESIDE = Fraction(1, 100)  # of a sample time, around the pieces of a plan through knots


@dataclass(frozen=True, slots=True, kw_only=True)
class Station:
    """The `own`-th: times from `begin` to `end`; `piece` of a plan through knots.

    `since`: stations up to one sample before, and itself. `beside`: so far a piece is looked at beyond its ends.
    """

    own: int
    begin: Ball
    end: Ball
    piece: int
    since: tuple[int, ...]
    beside: Ball


def stations(curve: Curve, sample_time: Fraction) -> tuple[Station, ...]:
    """Stations that cover the plan."""
    if not curve.moves:
        end = exact(max(curve.horizon or Fraction(0), 2 * sample_time))
        return (Station(own=0, begin=arb(0), end=end, piece=0, since=(0,), beside=arb(0)),)
    if curve.horizon is None:
        raise UnreadError("a plan that moves without end has no bound here: the time itself loses digits")
    if len(curve.parts) == 1 and not curve.parts[0].values:
        step = max(curve.horizon, sample_time) / _STATIONS
        ends = [(exact(k * step), exact((k + 1) * step)) for k in range(_STATIONS)]
        beside = arb(0)
    else:
        beside = exact(sample_time * _BESIDE)
        ends = [(own.start - beside, own.start + own.length + beside) for own in curve.parts]
    Ts = exact(sample_time)
    return tuple(
        Station(
            own=k,
            begin=begin.max(arb(0)),
            end=end,
            piece=k,
            since=tuple(j for j, (_, last) in enumerate(ends[: k + 1]) if not last < begin - Ts),
            beside=beside,
        )
        for k, (begin, end) in enumerate(ends)
    )

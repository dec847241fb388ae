"""What a tube asks of a machine: the cheapest machine for one tube, and for tubes of many sizes.

In: a specification in which one number of the machine is the largest, or the tube has another size. Out: full
certifications, each with a verdict of its own; an optimum is what certificate H says of `largest`. A deadline or an
interruption leaves what was certified by then, at least one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import inf
from typing import Final

from tubecert.certificate.result import Result
from tubecert.claims.advice import HardwarePart
from tubecert.pipeline import Options, certify
from tubecert.pipeline.deadline import Cut, Deadline, OutOfTime, cut_by
from tubecert.pipeline.width import Measure, machine_of, size_of
from tubecert.progress import Progress
from tubecert.spec import Spec
from tubecert.stages.memory import Memory
from tubecert.verdict import Verdict

_STEPS: Final = 4  # sizes in a factor of two
_FARTHEST: Final = 12  # sizes in one direction
_WORSE: Final = 2  # that gain nothing, in a row, end a direction


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer:
    """A machine of which one part is the largest that serves, the others being as they are given."""

    part: HardwarePart
    result: Result

    @property
    def value(self) -> Fraction | None:
        """The largest value; None if none was found."""
        own = machine_of(self.result)
        if own is None or self.result.verdict is not Verdict.CERTIFIED:
            return None
        found: Fraction | None = getattr(own, self.part)
        return found


def cheapest(
    at: Callable[[HardwarePart], Spec],
    parts: Iterable[HardwarePart],
    options: Options,
    progress: Progress | None = None,
    deadline: Deadline | None = None,
) -> Cheapest:
    """The cheapest machine for the tube of a specification, part by part; `at` asks for the largest of one."""
    memory, deadline = Memory(), deadline or Deadline()
    found: list[Offer] = []
    try:
        for part in parts:
            watched = deadline.watched(progress) if found else progress
            found.append(Offer(part=part, result=certify(at(part), options, watched, memory)))
    except (OutOfTime, KeyboardInterrupt) as end:
        if not found:
            raise
        return Cheapest(offers=tuple(found), cut=cut_by(end))
    return Cheapest(offers=tuple(found))


@dataclass(frozen=True, slots=True, kw_only=True)
class Cheapest:
    """What each part may be at most, and what ended the search before its end."""

    offers: tuple[Offer, ...]
    cut: Cut | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A size of the tube that was tried, and what it allows; `size` is what is proven, None if nothing is."""

    scale: Fraction
    offer: Offer
    size: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Front:
    """Every size that was tried, from narrow to wide, and what ended the search before its end."""

    points: tuple[Point, ...]
    cut: Cut | None = None

    @property
    def best(self) -> tuple[Point, ...]:
        """Those that no other beats in both: each tube allows more than all narrower ones."""
        found: list[Point] = []
        proven = [each for each in self.points if each.size is not None]
        for each in sorted(proven, key=lambda each: (each.size or 0.0, -_worth(each))):
            if not found or _worth(each) > _worth(found[-1]):
                found.append(each)
        return tuple(found)


def front(
    at: Callable[[Fraction], Spec],
    part: HardwarePart,
    measure: Measure,
    options: Options,
    progress: Progress | None = None,
    *,
    deadline: Deadline | None = None,
) -> Front:
    """The largest value of a part against the size of the tube; `at` asks for it in a tube so many times as wide.

    Sizes grow and shrink by fourth roots of two from the specification's, until two in a row gain nothing.
    """
    memory, deadline = Memory(), deadline or Deadline()
    points: list[Point] = []

    def point(scale: Fraction) -> Point:
        watched = deadline.watched(progress) if points else progress
        offer = Offer(part=part, result=certify(at(scale), options, watched, memory))
        points.append(Point(scale=scale, offer=offer, size=size_of(offer.result, measure)))
        return points[-1]

    first, cut = point(Fraction(1)), None
    try:
        _onward(point, [_scale(k) for k in range(1, _FARTHEST + 1)], _worth, first)
        _onward(point, [_scale(-k) for k in range(1, _FARTHEST + 1)], _narrowness, first)
    except (OutOfTime, KeyboardInterrupt) as end:
        cut = cut_by(end)
    return Front(points=tuple(sorted(points, key=lambda each: each.scale)), cut=cut)


def _scale(k: int) -> Fraction:
    """2^(k/4), to four digits."""
    return Fraction(round(2.0 ** (k / _STEPS) * 10**4), 10**4)


def _onward(
    point: Callable[[Fraction], Point],
    scales: Sequence[Fraction],
    gain: Callable[[Point], float],
    first: Point,
) -> None:
    """Sizes in one direction, until several in a row gain nothing on the best so far."""
    best, worse = gain(first), 0
    for scale in scales:
        found = point(scale)
        worse = 0 if gain(found) > best else worse + 1
        best = max(best, gain(found))
        if worse == _WORSE or not found.offer.result.sections:
            break


def _worth(point: Point) -> float:
    """What a size allows."""
    value = point.offer.value
    return 0.0 if value is None else float(value)


def _narrowness(point: Point) -> float:
    """How narrow a size is proven to be; it gains nothing where nothing is allowed any more."""
    return -inf if point.size is None or not _worth(point) else -point.size

"""What a tube asks of a machine: the cheapest machine for one tube, and for tubes of many sizes.

In: a specification in which one number of the machine is the largest, or the tube has another size. Out: full
certifications, each with a verdict of its own; an optimum is what certificate H says of `largest`.
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
) -> tuple[Offer, ...]:
    """The cheapest machine for the tube of a specification, part by part; `at` asks for the largest of one."""
    memory = Memory()
    return tuple(Offer(part=part, result=certify(at(part), options, progress, memory)) for part in parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A size of the tube that was tried, and what it allows; `size` is what is proven, None if nothing is."""

    scale: Fraction
    offer: Offer
    size: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Front:
    """Every size that was tried, from narrow to wide."""

    points: tuple[Point, ...]

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
) -> Front:
    """The largest value of a part against the size of the tube; `at` asks for it in a tube so many times as wide.

    Sizes grow and shrink by fourth roots of two from the specification's, until two in a row gain nothing.
    """
    memory = Memory()

    def point(scale: Fraction) -> Point:
        offer = Offer(part=part, result=certify(at(scale), options, progress, memory))
        return Point(scale=scale, offer=offer, size=size_of(offer.result, measure))

    first = point(Fraction(1))
    wider = _onward(point, [_scale(k) for k in range(1, _FARTHEST + 1)], _worth, first)
    narrower = _onward(point, [_scale(-k) for k in range(1, _FARTHEST + 1)], _narrowness, first)
    return Front(points=(*reversed(narrower), first, *wider))


def _scale(k: int) -> Fraction:
    """2^(k/4), to four digits."""
    return Fraction(round(2.0 ** (k / _STEPS) * 10**4), 10**4)


def _onward(
    point: Callable[[Fraction], Point],
    scales: Sequence[Fraction],
    gain: Callable[[Point], float],
    first: Point,
) -> list[Point]:
    """Sizes in one direction, until several in a row gain nothing on the best so far."""
    found: list[Point] = []
    best, worse = gain(first), 0
    for scale in scales:
        found.append(point(scale))
        worse = 0 if gain(found[-1]) > best else worse + 1
        best = max(best, gain(found[-1]))
        if worse == _WORSE or not found[-1].offer.result.sections:
            break
    return found


def _worth(point: Point) -> float:
    """What a size allows."""
    value = point.offer.value
    return 0.0 if value is None else float(value)


def _narrowness(point: Point) -> float:
    """How narrow a size is proven to be; it gains nothing where nothing is allowed any more."""
    return -inf if point.size is None or not _worth(point) else -point.size

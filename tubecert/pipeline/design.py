"""The narrowest tube that a machine can be proven to keep: the tube of a specification scaled up and down.

Whether there are gains for a tube is not monotone in its size: a wide one has large constants, in a narrow one the
start or the machine does not fit. So sizes are tried by factors of two in both directions until one fails, and the best
is then narrowed to what it was proven to need. Where none is proven, but the loop asks for more than one size and the
next is stopped by something else (limits, the safe set, an obstacle), sizes between these two are tried. In: a
specification at every scale. Out: every attempt, each certified as far as it takes to compare them, and the one that is
shown in full. A deadline or an interruption ends the search after its first size: the best of what was tried by then is
what it comes out with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import inf, sqrt
from typing import Final

from tubecert.certificate.result import Result
from tubecert.conditions.decimals import round_up
from tubecert.pipeline import Options, certify
from tubecert.pipeline.deadline import Cut, Deadline, OutOfTime, cut_by
from tubecert.pipeline.width import Measure, machine_of, size_of
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Spec
from tubecert.stages.memory import Memory
from tubecert.verdict import Verdict

_FARTHEST: Final = 6  # factors of two in one direction
_NARROWINGS: Final = 8
_HALVINGS: Final = 4  # of the factor of two between a tube that is too narrow and one that is too wide
_ROOM: Final = Fraction(1001, 1000)  # between what is needed and what is tried next
_SETTLED: Final = Fraction(998, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """The tube at a scale: what came of it, and how wide it was proven to be; None if it was not proven.

    `result` is brief where nobody asked for more; `whole` is the certification that `certify` gives.
    """

    scale: Fraction
    result: Result
    size: float | None
    whole: Callable[[], Result] = field(repr=False, compare=False)

    @property
    def lacks(self) -> float:
        """What certificate H needs of what there is, above 1 where it is not certified; inf where nobody knows."""
        own = machine_of(self.result)
        return inf if own is None or own.margin is None or own.margin.below is None else 1 - own.margin.below


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Every attempt in the order in which they were made, and what ended the search before its end."""

    attempts: tuple[Attempt, ...]
    cut: Cut | None = None

    @property
    def best(self) -> Attempt | None:
        """The narrowest that is proven."""
        found = [each for each in self.attempts if each.size is not None]
        return min(found, key=lambda each: each.size or 0.0, default=None)

    @property
    def shown(self) -> Attempt:
        """The best; where none is proven, what comes nearest to it."""
        return self.best or min(self.attempts, key=lambda each: each.lacks)


def narrowest(
    at: Callable[[Fraction], Spec],
    options: Options,
    measure: Measure,
    progress: Progress | None = None,
    memory: Memory | None = None,
    *,
    deadline: Deadline | None = None,
) -> Design:
    """The narrowest tube by a measure, among those of every size.

    At the `deadline`, and at an interruption, the narrowest of those that were tried; the first is always certified.
    """
    memory = Memory() if memory is None else memory
    deadline = deadline or Deadline()
    attempts: dict[Fraction, Attempt] = {}
    cut: Cut | None = None

    def attempt(scale: Fraction) -> Attempt:
        if scale not in attempts:
            told = None if progress is None else partial(_told, progress, len(attempts))
            spec = at(scale)
            watched = deadline.watched(told) if attempts else told
            result = certify(spec, options, watched, memory, brief=True)
            attempts[scale] = Attempt(
                scale=scale,
                result=result,
                size=size_of(result, measure),
                whole=partial(certify, spec, options, told, memory),
            )
        return attempts[scale]

    first = attempt(Fraction(1))
    try:
        _tried(attempts, attempt, first)
    except (OutOfTime, KeyboardInterrupt) as end:
        cut = cut_by(end)
    shown = Design(attempts=tuple(attempts.values())).shown
    attempts[shown.scale] = replace(shown, result=shown.whole())
    return Design(attempts=tuple(attempts.values()), cut=cut)


def _tried(
    attempts: Mapping[Fraction, Attempt], attempt: Callable[[Fraction], Attempt], first: Attempt
) -> None:
    """Every size, in both directions from the first and then inward from the best."""
    for factor in (Fraction(1, 2), Fraction(2)):
        scale, failed = Fraction(1), 0
        for _ in range(_FARTHEST):
            scale *= factor
            found = attempt(scale)
            failed = 0 if found.size is not None else failed + 1
            if (
                not found.result.sections
                or failed > 1
                or (factor > 1 and _is_wider(found, attempts.values()))
            ):
                break
    best = Design(attempts=tuple(attempts.values())).best or _between(attempts, attempt) or first
    for _ in range(_NARROWINGS):
        needed = needed_of(best.result)
        if best.size is None or needed is None or needed >= _SETTLED:
            break
        best = attempt(round_up(float(best.scale * needed * _ROOM), 5))


def _between(attempts: Mapping[Fraction, Attempt], attempt: Callable[[Fraction], Attempt]) -> Attempt | None:
    """A tube that is proven between one that is too narrow for the loop and the next, where something else stops it."""
    for _ in range(_HALVINGS):
        beside = pairwise(sorted(attempts))
        gap = next(
            (pair for pair in beside if [_lacks_room(attempts[each]) for each in pair] == [True, False]), None
        )
        found = None if gap is None else attempt(round_up(sqrt(gap[0] * gap[1]), 4))
        if found is None or found.size is not None:
            return found
    return None


def _lacks_room(found: Attempt) -> bool:
    """Whether it is the loop that a tube has no room for."""
    own = machine_of(found.result)
    return own is not None and own.verdict is not Verdict.CERTIFIED


def _told(progress: Progress, done: int, step: Step) -> None:
    """A step of one tube of nobody knows how many."""
    progress(replace(step, phase=Phase.DESIGN, done=done, of=None))


def _is_wider(found: Attempt, others: Iterable[Attempt]) -> bool:
    """Whether a wider tube was proven, and is wider than another: a still wider one will not be narrower."""
    sizes = [each.size for each in others if each.size is not None and each is not found]
    return found.size is not None and bool(sizes) and min(sizes) < found.size


def needed_of(result: Result) -> Fraction | None:
    """What share of the tube is needed for what was proven; None where the theorem does not say."""
    own = machine_of(result)
    if own is None or own.level_margin is None:
        return None
    return 1 - Fraction(own.level_margin.below)

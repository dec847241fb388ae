"""What a better machine would make of the narrowest tube: each number of it halved, and taken away, alone.

In: a design, and the specification with another machine at every scale. Out: the narrowest tubes that were proven on
the way. Each is the kernel's word, but no optimum: few sizes are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Final, Literal

from tubecert.conditions.decimals import round_up
from tubecert.errors import SpecError
from tubecert.pipeline import Options, certify
from tubecert.pipeline.deadline import Deadline, OutOfTime
from tubecert.pipeline.design import Design, needed_of
from tubecert.pipeline.width import Measure, size_of
from tubecert.progress import Phase, Progress, Step
from tubecert.spec import Setting, Spec
from tubecert.stages.memory import Memory
from tubecert.verdict import Verdict

Part = Literal["sample_time", "delay", "noise", "wind", "limits"]

_NARROWINGS: Final = 3
_DIGITS: Final = 2  # of a scale: so that machines share the constants of a tube
_SETTLED: Final = Fraction(97, 100)
_ROOM: Final = Fraction(1001, 1000)


@dataclass(frozen=True, slots=True, kw_only=True)
class Better:
    """A machine of which one part is better, as `settings` say it: halved, or `gone`. Limits: doubled, or none."""

    part: Part
    gone: bool
    settings: tuple[Setting, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """The narrowest tube that was proven for a better machine, and its scale; None where none was."""

    better: Better
    size: float | None
    scale: Fraction | None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tried:
    size: float | None
    needed: Fraction | None


def sensitivities(
    found: Design,
    at: Callable[[Fraction, Better], Spec],
    machines: Sequence[Better],
    *,
    options: Options,
    measure: Measure,
    memory: Memory,
    progress: Progress | None = None,
    deadline: Deadline | None = None,
) -> tuple[Sensitivity, ...]:
    """What each machine makes of the tube; left out: those that no specification can have, and those after the end."""
    deadline = deadline or Deadline()
    kept: list[Sensitivity] = []
    for better in machines:
        told = None if progress is None else partial(_told, progress, len(kept), len(machines))

        def attempt(scale: Fraction, better: Better = better, told: Progress | None = told) -> _Tried:
            result = certify(at(scale, better), options, deadline.watched(told), memory, brief=True)
            certified = result.verdict is Verdict.CERTIFIED
            return _Tried(size=size_of(result, measure), needed=needed_of(result) if certified else None)

        try:
            kept.append(_smallest(found, better, attempt))
        except SpecError:  # a delay beyond the sample time, say
            continue
        except (OutOfTime, KeyboardInterrupt):
            break
    return tuple(kept)


def _smallest(found: Design, better: Better, attempt: Callable[[Fraction], _Tried]) -> Sensitivity:
    """From the best tube inward; where that is not proven, among all that were tried."""
    start = found.shown.scale
    others = sorted((each for each in found.attempts if each.result.sections), key=lambda each: each.lacks)
    tried: dict[Fraction, _Tried] = {}
    for scale in dict.fromkeys([start, *(each.scale for each in others)]):
        tried[scale] = attempt(scale)
        if tried[scale].size is not None:
            break
    else:
        return Sensitivity(better=better, size=None, scale=None)
    for _ in range(_NARROWINGS):
        needed = tried[scale].needed
        closer = None if needed is None else round_up(float(scale * needed * _ROOM), _DIGITS)
        if closer is None or closer > _SETTLED * scale:
            break
        scale = closer
        tried[scale] = attempt(scale)
    best = min(
        (each for each in tried if tried[each].size is not None), key=lambda each: tried[each].size or 0.0
    )
    return Sensitivity(better=better, size=tried[best].size, scale=best)


def _told(progress: Progress, done: int, of: int, step: Step) -> None:
    """A step of one machine of several."""
    progress(Step(phase=Phase.DESIGN, name=f"a better machine: {step.name}", done=done, of=of))

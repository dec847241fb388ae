"""The machine of certificate H in words: what it is, what fills its tube, and what its inputs do.

In: a result. Out: lines and rows for the console and for the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from fractions import Fraction

from tubecert.certificate.result import Result
from tubecert.conditions.hardware import Budget
from tubecert.digits import down, exact, percent, up
from tubecert.kinds import HARDWARE
from tubecert.kinds.hardware import HardwareData
from tubecert.report import windows
from tubecert.verdict import Verdict
from tubecert.words.machine import CAUSES

_LEAST = 5e-5  # a smaller share is not told
_NOTABLE = 0.01  # of the level: nearer starts are not told


@dataclass(frozen=True, slots=True, kw_only=True)
class Share:
    """What takes a share of the tube, in words."""

    cause: str
    share: float


def section_of(result: Result) -> HardwareData | None:
    """The section of certificate H, if there is one."""
    found = result.sections.get(HARDWARE.key)
    return found if isinstance(found, HardwareData) else None


def proven(result: Result) -> HardwareData | None:
    """The same, if it is certified."""
    found = section_of(result)
    return found if found is not None and found.verdict is Verdict.CERTIFIED else None


def described(result: Result, own: HardwareData) -> str:
    """The machine in a sentence: `500 Hz (2 ms), 0.5 ms of delay, |n| <= 0.001, |w| <= 0.05`."""
    parts = []
    if own.sample_time is not None:
        parts.append(f"{down(1 / own.sample_time, 5)} Hz ({exact(1000 * own.sample_time)} ms)")
    if own.delay:
        parts.append(f"{exact(1000 * own.delay)} ms of delay")
    if own.feedback_time is not None and own.feedback_time != own.sample_time:
        parts.append(f"feedback every {exact(1000 * own.feedback_time)} ms")
    if own.predict:
        parts.append("feedback from the predicted state")
    if own.noise:
        parts.append(f"noise {_noise(result, own.noise)}")
    if own.wind:
        parts.append(f"wind {exact(own.wind)}")
    return ", ".join(parts)


def _noise(result: Result, length: Fraction) -> str:
    """By state where it is given so: its length is then in no unit that anyone knows."""
    given, units = result.spec.effective.part("hardware").get("noise"), result.spec.effective.system.units
    if not isinstance(given, Mapping):
        return exact(length)
    names = [name for name in result.spec.effective.system.states if name in given]
    return ", ".join(f"{name} {given[name]} {units.get(name, '')}".rstrip() for name in names)


def half_widths(result: Result, own: HardwareData) -> str:
    """What H proves of every state."""
    return windows.half_widths(result, own.half_widths)


def inputs(result: Result, own: HardwareData) -> str:
    """What every input does in the loop, feedforward, feedback and adaptation together."""
    return windows.inputs(result, own.inputs)


def shares(budget: Budget) -> list[Share]:
    """What fills the tube, the largest share first; shares that are nothing are left out."""
    found = [Share(cause=CAUSES[item.name], share=getattr(budget, item.name)) for item in fields(budget)]
    return sorted((each for each in found if each.share > _LEAST), key=lambda each: -each.share)


def lines(result: Result) -> Iterator[str]:
    """What certificate H says, for the console."""
    own = section_of(result)
    if own is None or own.sample_time is None:
        return
    yield described(result, own)
    if own.verdict is not Verdict.CERTIFIED:
        return
    if own.level_margin is not None and own.level_margin.below is not None:
        used = 1 - own.level_margin.below
        yield f"proven tube: {half_widths(result, own)} ({percent(used)} of what the metric was bounded for)"
    if (told := windows.along(own.windows)) is not None:
        yield told
    yield f"inputs: {inputs(result, own)}"
    yield f"filter: {bandwidth(own)}; the estimate is clipped to {clip(result, own)}"
    if (start := start_share(result, own)) is not None:
        yield f"the start alone is at {percent(start)} of the proven tube"
    if own.budget is not None:
        yield "what fills the tube: " + ", ".join(
            f"{each.cause} {percent(each.share)}" for each in shares(own.budget)
        )


def start_share(result: Result, own: HardwareData) -> float | None:
    """How far the start is from the plan, as a share of the level; None where that is next to nothing."""
    d0 = result.constants.get("initial_distance")
    if d0 is None or d0.above is None or not own.level or d0.above < _NOTABLE * float(own.level):
        return None
    return d0.above / float(own.level)


def bandwidth(own: HardwareData) -> str:
    """The filter of the estimate."""
    if own.bandwidth is None:
        return "none: the newest estimate is used as it is"
    return f"{exact(own.bandwidth)} rad/s"


def clip(result: Result, own: HardwareData) -> str:
    """What the filtered estimate is clipped to."""
    if not own.clip:
        return f"a ball of radius {up(own.clip_radius)}"
    names = result.spec.effective.system.inputs
    return ", ".join(f"{n} in [{down(a)}, {up(b)}]" for n, (a, b) in zip(names, own.clip, strict=True))

"""What `design` tried and what it found, in words, and as data for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Final

from rich.text import Text

from tubecert.claims.family import Reason
from tubecert.claims.gains import ConditionHolds
from tubecert.digits import exact, near, percent, up
from tubecert.kinds import HARDWARE
from tubecert.kinds.hardware import HardwareData
from tubecert.pipeline.width import machine_of
from tubecert.report import reach, sections
from tubecert.report.console import verdict_line
from tubecert.report.cut import cut_short
from tubecert.report.gains import deciding
from tubecert.report.layout import plain_table, titled
from tubecert.report.machine import lines
from tubecert.verdict import Verdict
from tubecert.words.claims import sentence
from tubecert.words.machine import PARTS

_GAINS_ALONE: Final = (
    "The specification has no `hardware`: nothing stops a narrower tube but the gains, which grow with every step "
    "and which nothing limits; whether a machine can run them was not asked. Take `tubecert certify` for the tube "
    "that you need, or say what the machine is, as in `hardware: {rate: 500, delay: 0.001, noise: 0.001}` (Hz, s, "
    "length of the error of a measured state): then design finds the narrowest tube that it keeps."
)

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.pipeline.deadline import Cut
    from tubecert.pipeline.design import Attempt, Design
    from tubecert.pipeline.sensitivities import Sensitivity
    from tubecert.spec import Spec


def summary(spec: Spec, found: Design) -> Text:
    """The best tube, or that there is none."""
    del spec
    return verdict_line(found.shown.result)


def report(
    spec: Spec, found: Design, target: str | None, better: Sequence[Sensitivity] = ()
) -> list[RenderableType]:
    """The best, or what stops the one that comes nearest; then every attempt."""
    parts: list[RenderableType] = [summary(spec, found)]
    best = found.best
    if best is not None:
        if machine_of(best.result) is not None:
            parts += titled("Machine", [Text(line) for line in lines(best.result)])
        scale = f"{exact(best.scale)} times as wide as the specification's"
        parts += titled("Tube", [Text(f"{scale}: {reach.extent(best.result)}")])
        if machine_of(best.result) is None:
            parts += titled("No machine", [Text(_GAINS_ALONE)])
    else:
        nearest = f"{exact(found.shown.scale)} times as wide as the specification's comes nearest"
        parts += titled("Not certified", [Text(f"{nearest}:"), *sections.failures(found.shown.result)])
    if better:
        parts += titled("What a better machine would buy", _bought(found, better))
    used = "used" if machine_of(found.shown.result) is not None else "gains"
    table = plain_table(">scale", "verdict", ">proven size", f">{used}", "what stops it", wrapped=4)
    for each in sorted(found.attempts, key=lambda each: each.scale):
        mark = " *" if each is found.shown else ""
        table.add_row(
            f"{exact(each.scale)}{mark}",
            Text(str(each.result.verdict), style=sections.VERDICTS[each.result.verdict]),
            "" if each.size is None else up(each.size),
            _used(each),
            _stops(each),
        )
    parts += titled("Attempts", [table, Text(_covered(found), style="dim")])
    if found.cut is not None:
        parts += cut_short(found.cut)
    if target is not None:
        parts += [Text(), Text(f"certificate {target}")]
    return parts


def _covered(found: Design) -> str:
    """Which sizes were tried."""
    count = len(found.attempts)
    if count == 1:
        return "no other size was tried."
    return (
        f"{count} sizes were tried, by factors of two and then between them; what lies between them was not."
    )


def _bought(found: Design, better: Sequence[Sensitivity]) -> list[RenderableType]:
    """The tube with half of every number, and with none of it."""
    table = plain_table("what", ">half", ">share", ">none", ">share")
    for part in dict.fromkeys(each.better.part for each in better):
        by_kind = {each.better.gone: each for each in better if each.better.part == part}
        cells = [cell for gone in (False, True) for cell in _size(found, by_kind.get(gone))]
        table.add_row(PARTS[part], *cells)
    words = (
        "The proven size of the tube, and its share of the one above, with one number changed alone. Each was "
        "certified on the way, in a few sizes; none is written: design with the settings that --json has does "
        "it. None of the sample time: a hundredth, or the delay; limits are twice, and a thousand times, as wide."
    )
    return [table, Text(words, style="dim")]


def _size(found: Design, each: Sensitivity | None) -> tuple[str, str]:
    """A size, and its share of the best one."""
    if each is None:
        return "", ""
    if each.size is None:
        return "none proven", ""
    own = None if found.best is None else found.best.size
    return up(each.size), "" if not own else near(each.size / own, 3)


def _used(each: Attempt) -> str:
    """The part of the level that is used; of a loop without a machine, what it asks for."""
    if machine_of(each.result) is None:
        return "" if each.size is None else "; ".join(gains.text() for gains in deciding(each.result))
    own = each.result.sections.get(HARDWARE.key)
    known = isinstance(own, HardwareData) and own.level_margin is not None and each.size is not None
    return percent(1 - own.level_margin.below) if known else ""  # type: ignore[union-attr]


def _stops(each: Attempt) -> str:
    """Of several conditions that are not proven, the one that is missed by most."""
    failed = [] if each.size is not None else each.result.failed
    return sentence(min(failed, key=_margin)) if failed else ""


def _margin(reason: Reason) -> float:
    """What is left of a condition, as far as it is known; other claims come first."""
    own = reason.claim.margin if isinstance(reason.claim, ConditionHolds) else None
    return -inf if own is None or own.below is None else own.below


@dataclass(frozen=True, slots=True, kw_only=True)
class AttemptData:
    """A size of the tube that was tried: its factor, and the id of the claim that stopped it."""

    scale: str
    verdict: Verdict
    size: float | None
    reason: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignData:
    """Every attempt, and the factor of the best."""

    best: str | None
    attempts: tuple[AttemptData, ...]
    sensitivities: tuple[SensitivityData, ...] = ()
    cut: Cut | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SensitivityData:
    """The tube with one part of the machine better: halved, or `gone`; the settings that say so."""

    part: str
    gone: bool
    size: float | None
    scale: str | None
    settings: tuple[str, ...]


def as_data(found: Design, better: Sequence[Sensitivity] = ()) -> DesignData:
    """Every attempt, for programs."""
    return DesignData(
        best=None if found.best is None else str(found.best.scale),
        attempts=tuple(map(_attempt, found.attempts)),
        sensitivities=tuple(map(_sensitivity, better)),
        cut=found.cut,
    )


def _sensitivity(each: Sensitivity) -> SensitivityData:
    return SensitivityData(
        part=each.better.part,
        gone=each.better.gone,
        size=each.size,
        scale=None if each.scale is None else str(each.scale),
        settings=tuple(map(str, each.better.settings)),
    )


def _attempt(each: Attempt) -> AttemptData:
    reason = each.result.reason
    return AttemptData(
        scale=str(each.scale),
        verdict=each.result.verdict,
        size=each.size,
        reason=None if reason is None else reason.claim.tag,
    )

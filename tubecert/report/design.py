"""What `design` tried and what it found, in words, and as data for programs."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.claims.family import Reason
from tubecert.claims.gains import ConditionHolds
from tubecert.digits import exact, percent, up
from tubecert.kinds import HARDWARE
from tubecert.kinds.hardware import HardwareData
from tubecert.report import reach, sections
from tubecert.report.console import verdict_line
from tubecert.report.layout import plain_table, titled
from tubecert.report.machine import lines
from tubecert.verdict import Verdict
from tubecert.words.claims import sentence

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.pipeline.design import Attempt, Design
    from tubecert.spec import Spec


def summary(spec: Spec, found: Design) -> Text:
    """The best tube, or that there is none."""
    del spec
    return verdict_line(found.shown.result)


def report(spec: Spec, found: Design, target: str | None) -> list[RenderableType]:
    """The best, or what stops the one that comes nearest; then every attempt."""
    parts: list[RenderableType] = [summary(spec, found)]
    best = found.best
    if best is not None:
        parts += titled("Machine", [Text(line) for line in lines(best.result)])
        scale = f"{exact(best.scale)} times as wide as the specification's"
        parts += titled("Tube", [Text(f"{scale}: {reach.extent(best.result)}")])
    else:
        nearest = f"{exact(found.shown.scale)} times as wide as the specification's comes nearest"
        parts += titled("Not certified", [Text(f"{nearest}:"), *sections.failures(found.shown.result)])
    table = plain_table(">scale", "verdict", ">proven size", ">used", "what stops it", wrapped=4)
    for each in sorted(found.attempts, key=lambda each: each.scale):
        mark = " *" if each is found.shown else ""
        table.add_row(
            f"{exact(each.scale)}{mark}",
            Text(str(each.result.verdict), style=sections.VERDICTS[each.result.verdict]),
            "" if each.size is None else up(each.size),
            _used(each),
            _stops(each),
        )
    covered = f"{len(found.attempts)} sizes were tried, by factors of two and then between them"
    parts += titled("Attempts", [table, Text(f"{covered}; what lies between them was not.", style="dim")])
    if target is not None:
        parts += [Text(), Text(f"certificate {target}")]
    return parts


def _used(each: Attempt) -> str:
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


def as_data(found: Design) -> DesignData:
    """Every attempt, for programs."""
    return DesignData(
        best=None if found.best is None else str(found.best.scale),
        attempts=tuple(map(_attempt, found.attempts)),
    )


def _attempt(each: Attempt) -> AttemptData:
    reason = each.result.reason
    return AttemptData(
        scale=str(each.scale),
        verdict=each.result.verdict,
        size=each.size,
        reason=None if reason is None else reason.claim.tag,
    )

"""The conditions of each certificate at its gains, with what is left of each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isfinite

from tubecert.certificate.result import Result
from tubecert.claims.conditions import SAYS, SHOWN, condition_name, equation
from tubecert.digits import UNKNOWN, down, up
from tubecert.enclosure.constant import Constant
from tubecert.report.gains import NAMES
from tubecert.report.page import Block, Cell, Table, Words

_MARGIN = (
    "A margin is (allowed - needed)/allowed: positive means that the condition holds. Its lower side is proven; the "
    "upper side is what the margin can be at most, whatever the constants are within their enclosures."
)


def conditions(result: Result) -> Iterator[Block]:
    """One row per condition and set of gains, then what is missing where there are no gains."""
    found = tuple(_rows(result))
    if found:
        yield Table(
            columns=("certificate", "condition", "what it says", "proven margin", "at most"),
            rows=found,
            note=_MARGIN,
        )
    for key, title in NAMES.items():
        for item in result.sections[key].shortfalls if key in result.sections else ():
            if item.needed is not None and item.allowed is not None:
                told = f"{up(item.needed)} is needed, {down(item.allowed)} is allowed"
                yield Words(text=f"{title}, {condition_name(item.condition)}: {told}.")


def _rows(result: Result) -> Iterator[tuple[Cell, ...]]:
    """The gains that each certificate stands for, by condition."""
    for key, title in NAMES.items():
        section = result.sections.get(key)
        pair = None if section is None else section.decisive(asked=result.asked)
        for condition, margin in pair.margins.items() if pair is not None else ():
            yield _row(title, condition, margin)


def _row(title: str, condition: str, margin: Constant) -> tuple[Cell, ...]:
    low, high = margin.below, margin.above
    return (
        Cell(text=title),
        Cell(text=SHOWN.get(condition, equation(condition))),
        Cell(text=SAYS[condition]),
        Cell(text=_percent(low, down), kind="number", share=min(low, 1.0) if low > 0 else None),
        Cell(text=_percent(high, up), kind="number"),
    )


def _percent(share: float, shown: Callable[[float, int], str]) -> str:
    return f"{shown(100 * share, 3)} %" if isfinite(share) else UNKNOWN

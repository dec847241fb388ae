"""The conditions of each certificate at its gains, with what is left of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tubecert.report.gains import NAMES, rows
from tubecert.report.numbers import UNKNOWN, down, up
from tubecert.report.page import Block, Cell, Table, Words
from tubecert.words.conditions import SAYS, condition_name, equation

_MARGIN = (
    "A margin is (allowed - needed)/allowed: positive means that the condition holds. Its lower side is proven; the "
    "upper side is what the margin can be at most, whatever the constants are within their enclosures."
)


def conditions(result: Mapping[str, Any]) -> Iterator[Block]:
    """One row per condition and set of gains, then what is missing where there are no gains."""
    found = tuple(_rows(result))
    if found:
        yield Table(
            columns=("certificate", "condition", "what it says", "proven margin", "at most"),
            rows=found,
            note=_MARGIN,
        )
    for section, title in NAMES.items():
        for item in result.get(section, {}).get("shortfalls", ()):
            if item.get("needed") is not None and item.get("allowed") is not None:
                told = f"{up(item['needed'])} is needed, {down(item['allowed'])} is allowed"
                yield Words(text=f"{title}, {condition_name(item['condition'])}: {told}.")


def _rows(result: Mapping[str, Any]) -> Iterator[tuple[Cell, ...]]:
    for section, pair in _pairs(result):
        margins = pair.get("margins") or {_only(section): pair.get("margin")}
        for name, margin in margins.items():
            yield _row(NAMES[section], name, margin)


def _pairs(result: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The gains that each certificate stands for."""
    for section in NAMES:
        data = result.get(section)
        if data is None or not any(row.section == section for row in rows(result)):
            continue
        if section == "distance":
            pair = data.get("asked") or data.get("least_adaptation") or data.get("split")
            yield section, pair
        elif data.get("bandwidth") is not None:
            yield section, data


def _only(section: str) -> str:
    """The name of the condition of a certificate that has one."""
    return "sup D(t)" if section == "distance" else "sup D(t), sampled"


def _row(title: str, name: str, margin: Sequence[float | None] | None) -> tuple[Cell, ...]:
    low, high = margin or (None, None)
    said = SAYS.get(name, SAYS["sampled" if name.endswith("sampled") else "distance"])
    return (
        Cell(text=title),
        Cell(text=equation(name)),
        Cell(text=said),
        Cell(
            text=_percent(low, down),
            kind="number",
            share=min(low, 1.0) if low is not None and low > 0 else None,
        ),
        Cell(text=_percent(high, up), kind="number"),
    )


def _percent(share: float | None, shown: Any) -> str:
    return UNKNOWN if share is None else f"{shown(100 * share, 3)} %"

"""A sweep as a page: its figures, and its points as a table."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.report.figures_sweep import sweep_figures
from tubecert.report.page import Block, Cell, Figures, Kind, Page, Section, Table, Words
from tubecert.report.sweep import SweepTable, summary

_MOST = 500  # rows on the page


def page_of_sweep(table: SweepTable) -> Page:
    """The page; the whole table is in a file beside it."""
    figures = sweep_figures(table)
    drawn: tuple[Block, ...] = (
        (Figures(figures=tuple(figures)),)
        if figures
        else (Words(text="Figures are drawn for one or two keys whose values are numbers in order."),)
    )
    keys = ", ".join(f"{axis.path} ({len(axis.texts)} values)" for axis in table.axes)
    return Page(
        name=table.name,
        verdict="",
        summary=summary(table).plain,
        meaning=f"Each point is a certification of its own. The keys that were changed: {keys}.",
        tiles=(),
        sections=(
            Section(key="points", title="Points", blocks=tuple(_points(table))),
            Section(key="figures", title="Figures", blocks=drawn),
        ),
        about="sweep",
    )


def _points(table: SweepTable) -> Iterator[Block]:
    columns = (*(axis.path for axis in table.axes), *table.headings)
    kinds: dict[str, Kind] = {axis.path: "number" for axis in table.axes}
    kinds |= {"rho": "number", "verdict": "verdict"}
    rows = [
        tuple(
            Cell(text=text, kind=kinds.get(column, "text"))
            for column, text in zip(columns, table.texts(row), strict=True)
        )
        for row in table.rows[:_MOST]
    ]
    left = len(table.rows) - len(rows)
    yield Table(columns=columns, rows=tuple(rows), note=f"{left} more are in table.csv" if left else "")

"""Figures of a sweep: over one key curves, over two keys heat maps; what is not certified is marked, never left out.

In: the table of a sweep. Out: figures. A value is drawn where its own kind is certified.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby, pairwise, product
from math import sqrt
from typing import Final

import numpy as np

from tubecert.digits import short
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.figures_gains import STYLES
from tubecert.report.quantities import Quantity
from tubecert.report.sweep import ERROR, Row, SweepTable
from tubecert.sweep import grid
from tubecert.verdict import Verdict

_PARTS: Final = ("epsilon", "rho_a", "rho_r")  # of rho, which is drawn
_HEAT: Final = 7  # colours of a heat map, in the style sheet
_WIDE: Final = 20  # times the least: such values are drawn by their logarithms
_LEGEND: Final = {
    **{str(verdict): str(verdict) for verdict in Verdict},
    ERROR: "invalid",
    "none": "nothing proven",
}


def sweep_figures(table: SweepTable) -> list[Chart]:
    """Every figure that there is: over one or two keys whose values are numbers in order."""
    if not all(_ordered(axis.numbers or ()) for axis in table.axes):
        return []
    if len(table.axes) == 1:
        return list(_curves(table, table.axes[0]))
    return list(_maps(table)) if len(table.axes) == 2 else []


def _ordered(values: Sequence[float]) -> bool:
    return len(values) > 0 and list(values) in (sorted(values), sorted(values, reverse=True))


def _shown(table: SweepTable) -> list[Quantity]:
    """What is drawn: the tube, and of the gains of each kind those that a set was chosen for."""
    found: dict[tuple[str, str], Quantity] = {}
    for each in table.columns:
        values = {value for row in table.rows if (value := _value(row, each)) is not None}
        chosen = each.role or each.name.endswith("radius") or not each.section
        if not chosen or each.share or each.name in _PARTS or len(values) < 2:
            continue
        place = each.section, each.name
        if place not in found or each.name.startswith(each.role.removeprefix("least_")):
            found[place] = each
    return list(found.values())


def _value(row: Row, quantity: Quantity) -> float | None:
    """A value of gains that are certified, or of a tube that is proven to lie in the safe set."""
    found = row.found.get(quantity.key)
    if found is None:
        return None
    if not quantity.section:
        held = row.verdict == Verdict.CERTIFIED or row.value("rho_r") is not None
        return found.number if held else None
    return found.number if row.value(f"{quantity.section}.verdict") == Verdict.CERTIFIED else None


# -- one key


def _curves(table: SweepTable, axis: grid.Axis) -> Iterator[Chart]:
    """A chart for each quantity, the same gain of all kinds and all half-widths in one; rho comes first."""
    groups: dict[str, list[Quantity]] = {}
    for each in sorted(_shown(table), key=lambda each: each.name != "rho"):
        name = each.name if each.section else each.name.partition(".")[0]
        groups.setdefault(name, []).append(each)
    for name, members in groups.items():
        yield _curve(table, axis, name, members)


def _curve(table: SweepTable, axis: grid.Axis, name: str, members: Sequence[Quantity]) -> Chart:
    places = axis.numbers or ()
    label = members[0].words.rpartition(", ")[2] if members[0].section else name.replace("_", " ")
    values = [v for each in members for row in table.rows if (v := _value(row, each)) is not None]
    x = Axis.around(places, axis.path, log=axis.log, pad=0.03)
    chart = Chart(
        key=f"sweep-{name}",
        title=f"{label} against {axis.path}",
        x=x,
        y=Axis.around(values, label, log=_is_wide(values)),
        caption="Every dot is a certificate; shaded: the verdict is not certified.",
    )
    for (one, other), row in zip(pairwise(_edges(axis)), table.rows, strict=True):
        if row.verdict != Verdict.CERTIFIED:
            low, high = max(min(one, other), x.low), min(max(one, other), x.high)
            chart.box((low, chart.y.low), (high, chart.y.high), f"cell {row.verdict}", _LEGEND[row.verdict])
    for index, each in enumerate(members):
        style = STYLES.get(each.section, "") if each.section else f"m{index % 3 + 1}"
        points = [(at, _value(row, each)) for at, row in zip(places, table.rows, strict=True)]
        _line(chart, points, style, each.words.removesuffix(f", {label}") if each.section else each.words)
    return chart


def _line(chart: Chart, points: Sequence[tuple[float, float | None]], style: str, words: str) -> None:
    """A curve, interrupted where there is no value."""
    for known, part in groupby(points, key=lambda point: point[1] is not None):
        drawn = [(x, y) for x, y in part if y is not None]
        if known:
            chart.line(drawn, style, words)
        for point in drawn:
            chart.dot(point, style, tip=f"{short(point[0])}: {short(point[1])}", size=3.0)


# -- two keys


def _cells(table: SweepTable) -> Iterator[tuple[Row, Point, Point]]:
    """Every row with the corners of its cell; the second key goes across."""
    down, across = (list(pairwise(_edges(axis))) for axis in table.axes)
    for row, (rows, columns) in zip(table.rows, product(down, across), strict=True):
        yield row, (min(columns), min(rows)), (max(columns), max(rows))


def _plane(table: SweepTable, key: str, title: str, caption: str) -> Chart:
    """A heat map without cells, and without room beside them."""
    y, x = (Axis.around(_edges(axis), axis.path, log=axis.log, pad=0.0) for axis in table.axes)
    return Chart(key=key, title=title, x=x, y=y, caption=caption)


def _maps(table: SweepTable) -> Iterator[Chart]:
    caption = "Each cell is one certification, at the values in its middle."
    chart = _plane(table, "sweep-verdict", "Verdict", caption)
    for row, low, high in _cells(table):
        chart.box(low, high, f"cell {row.verdict}", _LEGEND[row.verdict])
    yield chart
    for each in _shown(table):
        yield _map(table, each)


def _map(table: SweepTable, quantity: Quantity) -> Chart:
    """A colour for each of so many equal steps, in factors where values are wide apart; the least first."""
    values = [v for row in table.rows if (v := _value(row, quantity)) is not None]
    space = np.geomspace if _is_wide(values) else np.linspace
    steps = space(min(values), max(values), _HEAT + 1)
    key = f"sweep-{quantity.key.replace('.', '-')}"
    caption = "A colour stands for a range of values; a pointer that rests on a cell shows its own."
    chart = _plane(table, key, quantity.words, caption)
    cells = [(value, cell) for cell in _cells(table) if (value := _value(cell[0], quantity)) is not None]
    for value, (_, low, high) in sorted(cells, key=lambda each: each[0]):
        step = min(int(np.searchsorted(steps, value, side="right")) - 1, _HEAT - 1)
        words = f"{short(steps[step], 3)} to {short(steps[step + 1], 3)}"
        chart.box(low, high, f"cell h{step}", words, short(value))
    for row, low, high in _cells(table):
        if _value(row, quantity) is None:
            verdict = str(row.value(f"{quantity.section}.verdict") or row.verdict)
            style = verdict if verdict != Verdict.CERTIFIED else "none"
            chart.box(low, high, f"cell {style}", _LEGEND[style])
    return chart


def _is_wide(values: Sequence[float]) -> bool:
    return min(values) > 0 and max(values) > _WIDE * min(values)


def _edges(axis: grid.Axis) -> list[float]:
    """Where the cell of each value of a key begins, and where the last one ends."""
    values = list(axis.numbers or ())
    if len(values) == 1:
        return [values[0] - 0.5, values[0] + 0.5]
    if axis.log:
        inner = [sqrt(a * b) for a, b in pairwise(values)]
        return [values[0] ** 2 / inner[0], *inner, values[-1] ** 2 / inner[-1]]
    inner = [(a + b) / 2 for a, b in pairwise(values)]
    return [2 * values[0] - inner[0], *inner, 2 * values[-1] - inner[-1]]

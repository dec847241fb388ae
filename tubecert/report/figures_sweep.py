"""Figures of a sweep: over one key curves, over two keys heat maps; what is not certified is marked, never left out.

In: the table of a sweep. Out: figures. A value is drawn where its own kind is certified.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby, pairwise, product
from math import log, sqrt
from typing import Final

from tubecert.digits import short
from tubecert.report.figures_axes import LEFT, RIGHT, WIDTH, Axis, Chart, Point, number, text
from tubecert.report.figures_gains import STYLES
from tubecert.report.page import Block, Figure, Figures, Page, Section, Words
from tubecert.report.quantities import Quantity
from tubecert.report.sweep import ERROR, Row, SweepTable
from tubecert.sweep import grid
from tubecert.verdict import Verdict

_COLORS: Final = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))  # viridis
_PARTS: Final = ("epsilon", "rho_a", "rho_r")  # of rho, which is drawn
_STRIP, _STEPS = 40, 40  # height of the scale of colours below a heat map, and its colours
_WIDE: Final = 20  # times the least: such values are drawn by their logarithms
_LEGEND: Final = {
    **{str(verdict): str(verdict) for verdict in Verdict},
    ERROR: "invalid",
    "none": "nothing proven",
}


def sweep_figures(table: SweepTable) -> list[Figure]:
    """Every figure that there is: over one or two keys whose values are numbers in order."""
    if not all(_ordered(axis.numbers or ()) for axis in table.axes):
        return []
    if len(table.axes) == 1:
        return list(_curves(table, table.axes[0]))
    return list(_maps(table)) if len(table.axes) == 2 else []


def with_figures(page: Page, drawn: Sequence[Figure]) -> Page:
    """The page of a sweep with its figures, or with why there are none."""
    shown: Block = Figures(figures=tuple(drawn))
    if not drawn:
        shown = Words(text="Figures are drawn for one or two keys whose values are numbers in order.")
    return replace(page, sections=(*page.sections, Section(key="figures", title="Figures", blocks=(shown,))))


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


def _curves(table: SweepTable, axis: grid.Axis) -> Iterator[Figure]:
    """A chart for each quantity, the same gain of all kinds and all half-widths in one; rho comes first."""
    groups: dict[str, list[Quantity]] = {}
    for each in sorted(_shown(table), key=lambda each: each.name != "rho"):
        name = each.name if each.section else each.name.partition(".")[0]
        groups.setdefault(name, []).append(each)
    for name, members in groups.items():
        yield _curve(table, axis, name, members)


def _curve(table: SweepTable, axis: grid.Axis, name: str, members: Sequence[Quantity]) -> Figure:
    places = axis.numbers or ()
    label = members[0].words.rpartition(", ")[2] if members[0].section else name.replace("_", " ")
    values = [v for each in members for row in table.rows if (v := _value(row, each)) is not None]
    x = Axis.around(places, axis.path, log=axis.log, pad=0.03)
    title = f"{label} against {axis.path}"
    chart = Chart(f"sweep-{name}", title, x, Axis.around(values, label, log=_is_wide(values)))
    legend = [
        (f"cell {key}", words) for key, words in _LEGEND.items() if key != "certified" and table.count(key)
    ]
    for (one, other), row in zip(pairwise(_edges(axis)), table.rows, strict=True):
        if row.verdict != Verdict.CERTIFIED:
            low, high = max(min(one, other), x.low), min(max(one, other), x.high)
            chart.box((low, chart.y.low), (high, chart.y.high), f"cell {row.verdict}")
    for index, each in enumerate(members):
        style = STYLES.get(each.section, "") if each.section else f"m{index % 3 + 1}"
        _line(chart, [(at, _value(row, each)) for at, row in zip(places, table.rows, strict=True)], style)
        legend.append((style, each.words.removesuffix(f", {label}") if each.section else each.words))
    caption = "Every dot is a certificate; shaded: the verdict is not certified."
    return Figure(key=chart.key, title=title, svg=chart.text(), legend=tuple(legend), caption=caption)


def _line(chart: Chart, points: Sequence[tuple[float, float | None]], style: str) -> None:
    """A curve, interrupted where there is no value."""
    for known, part in groupby(points, key=lambda point: point[1] is not None):
        drawn = [(x, y) for x, y in part if y is not None]
        if known and len(drawn) > 1:
            chart.line(drawn, style)
        for point in drawn:
            chart.dot(point, style, 3.0, f"{short(point[0])}: {short(point[1])}")


# -- two keys


def _cells(table: SweepTable) -> Iterator[tuple[Row, Point, Point]]:
    """Every row with the corners of its cell; the second key goes across."""
    down, across = (list(pairwise(_edges(axis))) for axis in table.axes)
    for row, (rows, columns) in zip(table.rows, product(down, across), strict=True):
        yield row, (min(columns), min(rows)), (max(columns), max(rows))


def _plane(table: SweepTable, key: str, title: str) -> Chart:
    """The axes of a heat map, without room beside the cells."""
    y, x = (Axis.around(_edges(axis), axis.path, log=axis.log, pad=0.0) for axis in table.axes)
    return Chart(key, title, x, y)


def _maps(table: SweepTable) -> Iterator[Figure]:
    chart = _plane(table, "sweep-verdict", "Verdict")
    for row, low, high in _cells(table):
        chart.box(low, high, f"cell {row.verdict}")
    legend = tuple((f"cell {key}", words) for key, words in _LEGEND.items() if table.count(key))
    caption = "Each cell is one certification, at the values in its middle."
    yield Figure(key=chart.key, title="Verdict", svg=chart.text(), legend=legend, caption=caption)
    for each in _shown(table):
        yield _map(table, each)


def _map(table: SweepTable, quantity: Quantity) -> Figure:
    values = [v for row in table.rows if (v := _value(row, quantity)) is not None]
    low, high, wide = min(values), max(values), _is_wide(values)
    chart = _plane(table, f"sweep-{quantity.key.replace('.', '-')}", quantity.words)
    missing: dict[str, None] = {}
    for row, lower, upper in _cells(table):
        value = _value(row, quantity)
        if value is None:
            verdict = str(row.value(f"{quantity.section}.verdict") or row.verdict)
            style = verdict if verdict != Verdict.CERTIFIED else "none"
            missing[style] = None
            chart.box(lower, upper, f"cell {style}")
            continue
        share = log(value / low) / log(high / low) if wide else (value - low) / (high - low)
        rect = chart.box(lower, upper, "")
        rect.set("fill", _color(share))
        ET.SubElement(rect, "title").text = short(value)
    _scale(chart, short(low), short(high), "in equal factors" if wide else "")
    legend = tuple((f"cell {style}", _LEGEND[style]) for style in missing)
    return Figure(key=chart.key, title=quantity.words, svg=chart.text(), legend=legend)


def _scale(chart: Chart, low: str, high: str, how: str) -> None:
    """Explains the colours below the drawing."""
    chart.svg.set("viewBox", f"0 0 {WIDTH} {chart.height + _STRIP}")
    top, width = chart.height + 4, WIDTH - LEFT - RIGHT
    for step in range(_STEPS):
        place = {"x": number(LEFT + width * step / _STEPS), "y": str(top), "height": "12"}
        look = {"width": number(width / _STEPS + 0.5), "fill": _color(step / (_STEPS - 1))}
        ET.SubElement(chart.svg, "rect", {**place, **look})
    for words, at, style in ((low, 0.0, "tick"), (how, 0.5, "tick middle"), (high, 1.0, "tick end")):
        text(chart.svg, (LEFT + at * width, top + 26), words, style)


def _color(place: float) -> str:
    """A colour of the scale, from 0 to 1."""
    index = min(int(place * (len(_COLORS) - 1)), len(_COLORS) - 2)
    part = place * (len(_COLORS) - 1) - index
    mixed = (round(a + (b - a) * part) for a, b in zip(_COLORS[index], _COLORS[index + 1], strict=True))
    return "#" + "".join(f"{channel:02x}" for channel in mixed)


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

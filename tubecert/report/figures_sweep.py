"""Figures of a sweep: over one key curves, over two keys heat maps; what is not certified is marked, never left out.

In: the table of a sweep. Out: figures. A value is drawn where its own kind is certified.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from math import log, sqrt

from tubecert.digits import short
from tubecert.report.figures_axes import LEFT, RIGHT, WIDTH, Axis, Chart, Point, number, text
from tubecert.report.figures_gains import STYLES
from tubecert.report.page import Block, Figure, Figures, Page, Section, Words
from tubecert.report.quantities import Quantity
from tubecert.report.sweep import ERROR, Row, SweepTable
from tubecert.sweep import grid
from tubecert.verdict import Verdict

_COLORS = ((68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))  # viridis
_PARTS = ("epsilon", "rho_a", "rho_r")  # of rho, which is drawn
_STRIP = 40  # height of the scale of colours below a heat map
_LEGEND = {
    **{str(verdict): str(verdict) for verdict in Verdict},
    ERROR: "invalid",
    "none": "nothing proven",
}


def sweep_figures(table: SweepTable) -> list[Figure]:
    """Every figure that there is: over one or two keys with numbers in order, beside one of words at most for one."""
    axes = [axis for axis in table.axes if _ordered(axis.numbers or ())]
    words = [axis for axis in table.axes if axis not in axes]
    if len(axes) == 1 and len(words) <= 1:
        return list(_curves(table, axes[0], words))
    return list(_maps(table, axes[0], axes[1])) if len(axes) == 2 and not words else []


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Curve:
    """The values of a quantity at the places of a key, None where nothing is drawn; `words`: what it is called."""

    quantity: Quantity
    values: tuple[float | None, ...]
    words: str


def _curves(table: SweepTable, axis: grid.Axis, words: Sequence[grid.Axis]) -> Iterator[Figure]:
    """A chart for each quantity, with a curve for each kind, and for each word where they differ."""
    shown = sorted(_shown(table), key=lambda each: _group(each) != "rho")
    groups: dict[str, list[Quantity]] = {}
    for each in shown:
        groups.setdefault(_group(each), []).append(each)
    for name, members in groups.items():
        yield _curve(table, axis, name, members, words)


def _group(quantity: Quantity) -> str:
    """What is drawn in one chart: the same gain of all kinds, all half-widths."""
    return quantity.name.partition(".")[0] if not quantity.section else quantity.name


def _parts(table: SweepTable, words: Sequence[grid.Axis]) -> list[tuple[str, list[Row]]]:
    """The rows of every word, in the order of the other key."""
    if not words:
        return [("", list(table.rows))]
    (axis,) = words
    return [(text, [row for row in table.rows if _text_of(row, axis) == text]) for text in axis.texts]


def _text_of(row: Row, axis: grid.Axis) -> str:
    return next(each.text for each in row.point.settings if each.path == axis.path)


def _drawn(parts: Sequence[tuple[str, list[Row]]], members: Sequence[Quantity], label: str) -> list[_Curve]:
    """The curves of a chart: of a word whose values are those of another one, none."""
    found: list[_Curve] = []
    for each in members:
        own: dict[tuple[float | None, ...], _Curve] = {}
        for word, rows in parts:
            values = tuple(_value(row, each) for row in rows)
            if values not in own and any(value is not None for value in values):
                name = _told_apart(each, label)
                own[values] = _Curve(quantity=each, values=values, words=f"{name}, {word}")
        if len(own) == 1:
            own = {key: replace(one, words=_told_apart(each, label)) for key, one in own.items()}
        found += own.values()
    return found


def _curve(
    table: SweepTable,
    axis: grid.Axis,
    name: str,
    members: Sequence[Quantity],
    words: Sequence[grid.Axis],
) -> Figure:
    places, parts = axis.numbers or (), _parts(table, words)
    label = members[0].words.rpartition(", ")[2] if members[0].section else name.replace("_", " ")
    curves = _drawn(parts, members, label)
    values = [v for each in curves for v in each.values if v is not None]
    spread = min(values) > 0 and max(values) > 20 * min(values)
    x = Axis.around(places, axis.path, log=axis.log, pad=0.03)
    title = f"{label} against {axis.path}"
    chart = Chart(f"sweep-{name}", title, x, Axis.around(values, label, log=spread))
    legend = [] if words else [(f"cell {verdict}", text) for verdict, text in _uncertified(table)]
    for (low, high), row in zip(pairwise(_edges(places, log_=axis.log)), parts[0][1], strict=True):
        if row.verdict != Verdict.CERTIFIED and not words:
            ends = max(min(low, high), x.low), min(max(low, high), x.high)
            chart.box((ends[0], chart.y.low), (ends[1], chart.y.high), f"cell {row.verdict}")
    for index, each in enumerate(curves):
        style = STYLES.get(each.quantity.section, "") if each.quantity.section else f"m{index % 3 + 1}"
        for known, part in groupby(
            zip(places, each.values, strict=True), key=lambda point: point[1] is not None
        ):
            if known:
                _line(chart, [(x, y) for x, y in part if y is not None], style)
        legend.append((style, each.words))
    caption = "Every dot is a certificate" + ("." if words else "; shaded: the verdict is not certified.")
    return Figure(key=f"sweep-{name}", title=title, svg=chart.text(), legend=tuple(legend), caption=caption)


def _told_apart(quantity: Quantity, label: str) -> str:
    """What a curve is called beside others of the same quantity."""
    return quantity.words.removesuffix(f", {label}") if quantity.section else quantity.words


def _line(chart: Chart, points: Sequence[Point], style: str) -> None:
    if len(points) > 1:
        chart.line(points, style)
    for point in points:
        chart.dot(point, style, 3.0, f"{short(point[0])}: {short(point[1])}")


def _uncertified(table: SweepTable) -> list[tuple[str, str]]:
    return [(key, words) for key, words in _LEGEND.items() if key != Verdict.CERTIFIED and table.count(key)]


# -- two keys


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plane:
    """The cells of a heat map: the keys, and the edges between their values."""

    table: SweepTable
    down: grid.Axis
    across: grid.Axis

    def cells(self) -> Iterator[tuple[Row, Point, Point]]:
        """Every row with the corners of its cell; the second key goes across."""
        rows = iter(self.table.rows)
        for bottom, top in pairwise(_edges(self.down.numbers or (), log_=self.down.log)):
            for left, right in pairwise(_edges(self.across.numbers or (), log_=self.across.log)):
                low, high = (min(left, right), min(bottom, top)), (max(left, right), max(bottom, top))
                yield next(rows), low, high

    def chart(self, key: str, title: str) -> Chart:
        """The axes, without room beside the cells."""
        x, y = (
            Axis.around(_edges(axis.numbers or (), log_=axis.log), axis.path, log=axis.log, pad=0.0)
            for axis in (self.across, self.down)
        )
        return Chart(key, title, x, y)


def _maps(table: SweepTable, down: grid.Axis, across: grid.Axis) -> Iterator[Figure]:
    plane = _Plane(table=table, down=down, across=across)
    chart = plane.chart("sweep-verdict", "Verdict")
    for row, low, high in plane.cells():
        chart.box(low, high, f"cell {row.verdict}")
    legend = tuple((f"cell {key}", words) for key, words in _LEGEND.items() if table.count(key))
    caption = "Each cell is one certification, at the values in its middle."
    yield Figure(key="sweep-verdict", title="Verdict", svg=chart.text(), legend=legend, caption=caption)
    for each in _shown(table):
        yield _map(plane, each)


def _map(plane: _Plane, quantity: Quantity) -> Figure:
    values = [v for row in plane.table.rows if (v := _value(row, quantity)) is not None]
    low, high = min(values), max(values)
    spread = low > 0 and high > 20 * low
    key = f"sweep-{quantity.key.replace('.', '-')}"
    chart = plane.chart(key, quantity.words)
    missing: dict[str, None] = {}
    for row, lower, upper in plane.cells():
        value = _value(row, quantity)
        if value is None:
            verdict = row.value(f"{quantity.section}.verdict") or row.verdict
            style = str(verdict) if verdict != Verdict.CERTIFIED else "none"
            missing[style] = None
            chart.box(lower, upper, f"cell {style}")
            continue
        place = (
            (log(value / low) / log(high / low) if spread else (value - low) / (high - low))
            if high > low
            else 0.5
        )
        _colored(chart, lower, upper, _color(place), f"{short(value)}")
    svg = _with_scale(chart, short(low), short(high), "in equal factors" if spread else "")
    legend = tuple((f"cell {style}", _LEGEND.get(style, style)) for style in missing)
    return Figure(key=key, title=quantity.words, svg=svg, legend=legend, caption="")


def _colored(chart: Chart, low: Point, high: Point, color: str, words: str) -> None:
    (left, bottom), (right, top) = chart.at(low), chart.at(high)
    size = {"x": left, "y": top, "width": right - left, "height": bottom - top}
    rect = ET.SubElement(chart.plot, "rect", {"fill": color, **{key: number(v) for key, v in size.items()}})
    ET.SubElement(rect, "title").text = words


def _with_scale(chart: Chart, low: str, high: str, how: str) -> str:
    """The drawing with its colours explained below."""
    chart.svg.set("viewBox", f"0 0 {WIDTH} {chart.height + _STRIP}")
    top, width, steps = chart.height + 4, WIDTH - LEFT - RIGHT, 40
    for step in range(steps):
        place = {"x": number(LEFT + width * step / steps), "y": str(top), "height": "12"}
        ET.SubElement(
            chart.svg,
            "rect",
            {**place, "width": number(width / steps + 0.5), "fill": _color(step / (steps - 1))},
        )
    text(chart.svg, (LEFT, top + 26), low, "tick")
    text(chart.svg, (LEFT + width / 2, top + 26), how, "tick middle")
    text(chart.svg, (LEFT + width, top + 26), high, "tick end")
    return chart.text()


def _color(place: float) -> str:
    """A colour of the scale, from 0 to 1."""
    index = min(int(place * (len(_COLORS) - 1)), len(_COLORS) - 2)
    part = place * (len(_COLORS) - 1) - index
    mixed = (round(a + (b - a) * part) for a, b in zip(_COLORS[index], _COLORS[index + 1], strict=True))
    return "#" + "".join(f"{channel:02x}" for channel in mixed)


def _edges(values: Sequence[float], *, log_: bool) -> list[float]:
    """Where the cell of each value begins, and where the last one ends."""
    if log_:
        inner = [sqrt(a * b) for a, b in pairwise(values)]
        return [values[0] ** 2 / inner[0], *inner, values[-1] ** 2 / inner[-1]]
    inner = [(a + b) / 2 for a, b in pairwise(values)]
    if not inner:
        return [values[0] - 0.5, values[0] + 0.5]
    return [2 * values[0] - inner[0], *inner, 2 * values[-1] - inner[-1]]

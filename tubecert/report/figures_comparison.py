"""Certificates side by side as drawings: a row for a quantity, a dot for a certificate, hollow where not certified."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from tubecert.digits import short
from tubecert.report.figures_axes import WIDTH, Axis, blank, number, path, text
from tubecert.report.page import Figure
from tubecert.report.quantities import Quantity
from tubecert.verdict import Verdict

_STYLES = ("n1", "n2", "n3", "n4", "n5", "n6")
_LEFT, _RIGHT, _ROW, _FOOT = 150, 16, 26, 34
_RHO_R = "rho_r"
_PARTS = ("epsilon", "rho_a", _RHO_R, "rate")
Found = Mapping[str, Quantity]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Mark:
    """A value of one certificate, by its number."""

    side: int
    value: float
    certified: bool


def comparison_figures(
    names: Sequence[str], sides: Sequence[Found], quantities: Sequence[Quantity]
) -> list[Figure]:
    """A drawing for the tube, for every gain and for the margins that are left."""
    groups: dict[str, list[Quantity]] = {}
    for each in quantities:
        chosen = each.role or not each.section
        if chosen and each.name not in _PARTS and any(_mark(i, side, each) for i, side in enumerate(sides)):
            groups.setdefault(_title(each), []).append(each)
    return [_dots(title, names, sides, members) for title, members in groups.items()]


def _title(quantity: Quantity) -> str:
    if not quantity.section:
        return "Tube"
    return "Margins left" if quantity.share else quantity.words.rpartition(", ")[2]


def _mark(index: int, side: Found, quantity: Quantity) -> _Mark | None:
    own = side.get(quantity.key)
    value = None if own is None else own.number
    if value is None:
        return None
    if not quantity.section:  # a tube that is not proven to lie in the safe set has no rho_r
        return _Mark(side=index, value=value, certified=_RHO_R in side and side[_RHO_R].value is not None)
    verdict = side.get(f"{quantity.section}.verdict")
    return _Mark(
        side=index, value=value, certified=verdict is not None and verdict.value == Verdict.CERTIFIED
    )


def _dots(title: str, names: Sequence[str], sides: Sequence[Found], members: Sequence[Quantity]) -> Figure:
    rows = [[mark for i, side in enumerate(sides) if (mark := _mark(i, side, each))] for each in members]
    share = members[0].share
    values = [100 * mark.value if share else mark.value for row in rows for mark in row]
    spread = min(values) > 0 and max(values) > 20 * min(values)
    axis = Axis.around(values, "", log=spread, pad=0.06)
    bottom = _ROW * len(rows) + 8
    svg = blank(title, bottom + _FOOT)
    for tick in axis.ticks():
        x = _LEFT + axis.share(tick) * (WIDTH - _LEFT - _RIGHT)
        ET.SubElement(ET.SubElement(svg, "g", {"class": "grid"}), "path", {"d": path([(x, 4), (x, bottom)])})
        text(svg, (x, bottom + 15), short(tick), "tick middle")
    for index, (each, row) in enumerate(zip(members, rows, strict=True)):
        y = _ROW * index + 8 + _ROW / 2
        words = each.words.removesuffix(f", {title}").replace(", margin", ",")
        text(svg, (_LEFT - 8, y + 4), words if len(words) < 28 else words[:26] + "…", "small end")
        for mark in row:
            value = 100 * mark.value if share else mark.value
            shift = 4.0 * (mark.side - (len(sides) - 1) / 2) if len(sides) <= 4 else 0.0
            x = _LEFT + axis.share(value) * (WIDTH - _LEFT - _RIGHT)
            style = f"dot {_style(mark.side)}" + ("" if mark.certified else " hollow")
            place = {"cx": number(x), "cy": number(y + shift), "r": "4"}
            dot = ET.SubElement(svg, "circle", {"class": style, **place})
            ET.SubElement(dot, "title").text = f"{names[mark.side]}, {each.words}: {short(value)}"
    key = f"compare-{title.split(maxsplit=1)[0].strip('(').lower()}"
    legend = tuple((_style(i), name) for i, name in enumerate(names))
    unit = "in per cent; " if share else ""
    caption = f"{unit}a hollow dot is not certified." if _any_open(rows) else unit.removesuffix("; ")
    return Figure(
        key=key,
        title=title,
        svg=ET.tostring(svg, encoding="unicode"),
        legend=legend,
        caption=caption.capitalize(),
    )


def _any_open(rows: Sequence[Sequence[_Mark]]) -> bool:
    return any(not mark.certified for row in rows for mark in row)


def _style(side: int) -> str:
    return _STYLES[side % len(_STYLES)]

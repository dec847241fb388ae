"""Figures of the gains: what a bandwidth costs in rate, what it leaves of the margins, which constants bind.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any

from tubecert.report.figures_axes import WIDTH, Axis, Chart, Point, blank, number, text
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.numbers import exact, short
from tubecert.report.page import Figure

STYLES = {"conditions_26": "a", "distance": "b", "sampled": "c"}
_LOWEST = -0.5  # margins below are not drawn
_MOST = 12  # constants shown


def gain_figures(result: Mapping[str, Any]) -> list[Figure]:
    """Every figure that the certificate has data for."""
    made = (_trade_off(result), _sample_time(result), *_margins(result), _elasticities(result))
    return [figure for figure in made if figure is not None]


def _trade_off(result: Mapping[str, Any]) -> Figure | None:
    curves = {
        section: [(float(p["bandwidth"]), float(p["adaptation_rate"])) for p in result[section]["curve"]]
        for section in ("conditions_26", "distance")
        if section in result
    }
    chosen = [row for row in rows(result) if row.adaptation_rate is not None]
    return _curves(
        "trade-off",
        "Adaptation rate against bandwidth",
        curves,
        [(row, (_value(row.bandwidth), _value(row.adaptation_rate))) for row in chosen],
        label="adaptation rate Γ",
        caption="Every point of a curve is a proven pair.",
    )


def _sample_time(result: Mapping[str, Any]) -> Figure | None:
    if "sampled" not in result:
        return None
    curve = [(float(p["bandwidth"]), float(p["sample_time"])) for p in result["sampled"]["curve"]]
    chosen = [row for row in rows(result) if row.sample_time is not None]
    return _curves(
        "sample-time",
        "Sample time against bandwidth",
        {"sampled": curve},
        [(row, (_value(row.bandwidth), _value(row.sample_time))) for row in chosen],
        label="sample time (s)",
        caption="The longest sample time that is proven to serve at each bandwidth.",
    )


def _curves(
    key: str,
    title: str,
    curves: Mapping[str, list[Point]],
    chosen: list[tuple[Gains, Point]],
    *,
    label: str,
    caption: str,
) -> Figure | None:
    drawn = {section: points for section, points in curves.items() if len(points) > 1}
    if not drawn:
        return None
    every = [p for points in drawn.values() for p in points] + [place for _, place in chosen]
    x = Axis.around([p[0] for p in every], "bandwidth ω (rad/s)", log=True)
    y = Axis.around([p[1] for p in every], label, log=True)
    chart = Chart(key, title, x, y)
    legend = []
    for section, points in drawn.items():
        chart.line(points, STYLES[section])
        legend.append((STYLES[section], NAMES[section]))
    for row, place in chosen:
        style = STYLES[row.section]
        chart.dot(place, f"{style} decides" if row.decides else style, 6 if row.decides else 4.5, _told(row))
    if any(row.decides for row, _ in chosen):
        legend.append(("decides", "decides the verdict"))
    return Figure(key=key, title=title, svg=chart.text(), legend=tuple(legend), caption=caption)


def _told(row: Gains) -> str:
    return f"{NAMES[row.section]}, {row.which}: {row.text()}"


def _value(gain: float | int | str | None) -> float:
    assert gain is not None
    return float(gain)


# -- margins


def _margins(result: Mapping[str, Any]) -> Iterator[Figure]:
    for section, claims in (("conditions_26", ("26a", "26b", "26c")), ("distance", ("margin",))):
        data = result.get(section, {}).get("margins_around")
        if data:
            yield _margin_figure(result, section, claims, data)


def _margin_figure(
    result: Mapping[str, Any], section: str, claims: tuple[str, ...], data: Mapping[str, Any]
) -> Figure:
    omegas = [float(w) for w in data["bandwidth"]]
    rate = exact(data["adaptation_rate"])
    known = [v for claim in claims for v in data[claim] if v is not None]
    low, high = max(min([*known, -0.1]), _LOWEST), max([*known, 0.1])
    title = f"Margins of {NAMES[section]} against bandwidth"
    key = f"margins-{STYLES[section]}"
    x = Axis.around(omegas, "bandwidth ω (rad/s)", log=True, pad=0.02)
    chart = Chart(key, title, x, Axis.around([100 * low, 100 * high], "margin left (%)"))
    chart.box((x.low, chart.y.low), (x.high, 0.0), "fails")
    chart.rule(0.0, "zero", across=True)
    legend = []
    for i, claim in enumerate(claims):
        style = f"m{i + 1}" if len(claims) > 1 else STYLES[section]
        for part in _known(omegas, data[claim]):
            chart.line(part, style)
        legend.append((style, f"({claim})" if claim != "margin" else NAMES[section]))
    pair = next(row for row in rows(result) if row.section == section and _is_pair(row, data))
    chart.rule(_value(pair.bandwidth), "chosen")
    legend += [("chosen", f"{pair.which}: ω = {exact(pair.bandwidth)} rad/s"), ("fails", "does not hold")]
    caption = f"With the adaptation rate kept at Γ = {rate}; each value is proven for its own bandwidth."
    return Figure(key=key, title=title, svg=chart.text(), legend=tuple(legend), caption=caption)


def _is_pair(row: Gains, data: Mapping[str, Any]) -> bool:
    return bool(row.adaptation_rate == data["adaptation_rate"])


def _known(omegas: list[float], values: list[float | None]) -> list[list[Point]]:
    """The stretches of a curve on which it is known, in per cent."""
    points = zip(omegas, values, strict=True)
    parts = (list(part) for known, part in groupby(points, key=lambda p: p[1] is not None) if known)
    return [[(w, 100 * max(v, 4 * _LOWEST)) for w, v in part if v is not None] for part in parts]


# -- what binds


def _elasticities(result: Mapping[str, Any]) -> Figure | None:
    """Bars: by how many per cent the least Gamma rises when a constant rises by one."""
    slopes = {s: v for s, v in result.get("elasticities", {}).items() if v}
    largest: dict[str, float] = {}
    for values in slopes.values():
        for name, value in values.items():
            largest[name] = max(largest.get(name, 0.0), abs(value))
    names = sorted(largest, key=lambda name: (-largest[name], name))[:_MOST]
    if not names:
        return None
    height = 24 * len(names) + 36
    svg = blank("How the least adaptation rate reacts to each constant", height)
    shown = [0.0, *(values.get(name, 0.0) for values in slopes.values() for name in names)]
    low, high = min(shown), max(shown)
    left, right = 92, WIDTH - 40
    scale = (right - left - (34 if low < 0 else 0)) / (high - low)
    zero = left + (34 if low < 0 else 0) - low * scale
    for row, name in enumerate(names):
        y = 24 * row + 6
        symbol = result.get("constants", {}).get(name, {}).get("symbol", name)
        text(svg, (left - 8, y + 14), symbol, "tick end")
        for lane, (section, values) in enumerate(sorted(slopes.items())):
            value = values.get(name, 0.0)
            _bar(svg, (zero, y + 9 * lane), value * scale, STYLES[section], short(value, 2))
    ET.SubElement(svg, "path", {"class": "curve zero", "d": f"M{number(zero)} 2V{24 * len(names) + 6}"})
    text(
        svg,
        ((left + right) / 2, height - 10),
        "% of the least Γ per 1 % of the constant",
        "axis middle",
    )
    legend = tuple((f"{STYLES[s]} bar", NAMES[s]) for s in sorted(slopes))
    caption = "The longest bars bind: a constant with a bar to the right would lower Γ if it were smaller."
    drawing = ET.tostring(svg, encoding="unicode")
    return Figure(key="elasticities", title="What binds", svg=drawing, legend=legend, caption=caption)


def _bar(svg: ET.Element, start: Point, length: float, style: str, words: str) -> None:
    if not length:
        return
    x = start[0] + min(length, 0.0)
    size = {"x": number(x), "y": number(start[1]), "width": number(abs(length)), "height": "8"}
    ET.SubElement(svg, "rect", {"class": f"bar {style}", **size})
    end = start[0] + length + (3 if length > 0 else -3)
    text(svg, (end, start[1] + 7.5), words, f"small {'start' if length > 0 else 'end'}")

"""Figures of the gains: what a bandwidth costs in rate, what it leaves of the margins, which constants bind.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import groupby

from tubecert.certificate.result import Result
from tubecert.kinds import HARDWARE, SAMPLED
from tubecert.kinds.data import Around
from tubecert.kinds.hardware import HardwareData
from tubecert.kinds.sampled import SampledData
from tubecert.report.figures_axes import WIDTH, Axis, Chart, Point, blank, number, text
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.numbers import exact, short
from tubecert.report.page import Figure
from tubecert.words.conditions import equation

STYLES = {"no_adaptation": "zero", "conditions_26": "a", "distance": "b", "sampled": "c", "hardware": "h"}
_LOWEST = -0.5  # margins below are not drawn
_MOST = 12  # constants shown


def gain_figures(result: Result) -> list[Figure]:
    """Every figure that the certificate has data for."""
    made = (
        _trade_off(result),
        _sample_time(result),
        _levels(result),
        *_margins(result),
        _elasticities(result),
    )
    return [figure for figure in made if figure is not None]


def _trade_off(result: Result) -> Figure | None:
    curves = {
        key: list(section.points())
        for key, section in result.sections.items()
        if key in NAMES and not isinstance(section, (SampledData, HardwareData))
    }
    return _curves(
        "trade-off",
        "Adaptation rate against bandwidth",
        curves,
        [(row, at) for row in rows(result) if (at := _place(row, row.pair.adaptation_rate)) is not None],
        label="adaptation rate Γ",
        caption="Every point of a curve is a proven pair.",
    )


def _sample_time(result: Result) -> Figure | None:
    section = result.sections.get(SAMPLED.key)
    if section is None:
        return None
    return _curves(
        "sample-time",
        "Sample time against bandwidth",
        {SAMPLED.key: list(section.points())},
        [
            (row, at)
            for row in rows(result)
            if row.section == SAMPLED.key and (at := _place(row, row.pair.sample_time)) is not None
        ],
        label="sample time (s)",
        caption="The longest sample time that is proven to serve at each bandwidth.",
    )


def _levels(result: Result) -> Figure | None:
    """What slower or faster sampling makes of the tube of certificate H."""
    section = result.sections.get(HARDWARE.key)
    if not isinstance(section, HardwareData) or len(section.points()) < 2 or section.level is None:
        return None
    points = [(1e3 * Ts, level) for Ts, level in section.points()]
    x = Axis.around([p[0] for p in points], "sample time (ms)", log=True)
    y = Axis.around([p[1] for p in points], "proven distance", log=True)
    chart = Chart("levels", "Tube against sample time", x, y)
    chart.line(points, STYLES[HARDWARE.key])
    if section.sample_time is not None:
        here = 1e3 * float(section.sample_time), float(section.level)
        chart.dot(here, f"{STYLES[HARDWARE.key]} decides", 6, f"{exact(1000 * section.sample_time)} ms")
    return Figure(
        key="levels",
        title="Tube against sample time",
        svg=chart.text(),
        legend=((STYLES[HARDWARE.key], NAMES[HARDWARE.key]), ("decides", "the machine")),
        caption="The least distance to the plan that is proven at each sample time, all else as it is.",
    )


def _place(row: Gains, other: Fraction | None) -> Point | None:
    """Where a row is drawn: its bandwidth, and its rate or its sample time."""
    bandwidth = row.pair.bandwidth
    return None if bandwidth is None or other is None else (float(bandwidth), float(other))


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


# -- margins


def _margins(result: Result) -> Iterator[Figure]:
    for key in NAMES:
        section = result.sections.get(key)
        around = None if section is None else section.margins_along()
        if around is not None:
            yield _margin_figure(result, key, around)


def _margin_figure(result: Result, section: str, around: Around) -> Figure:
    omegas = [float(w) for w in around.bandwidth]
    known = [v for values in around.margins.values() for v in values if v is not None]
    low, high = max(min([*known, -0.1]), _LOWEST), max([*known, 0.1])
    title = f"Margins of {NAMES[section]} against bandwidth"
    key = f"margins-{STYLES[section]}"
    x = Axis.around(omegas, "bandwidth ω (rad/s)", log=True, pad=0.02)
    chart = Chart(key, title, x, Axis.around([100 * low, 100 * high], "margin left (%)"))
    chart.box((x.low, chart.y.low), (x.high, 0.0), "fails")
    chart.rule(0.0, "zero", across=True)
    legend = []
    several = len(around.margins) > 1
    for i, (condition, values) in enumerate(sorted(around.margins.items())):
        style = f"m{i + 1}" if several else STYLES[section]
        for part in _known(omegas, values):
            chart.line(part, style)
        legend.append((style, equation(condition) if several else NAMES[section]))
    rate = around.adaptation_rate
    row = next(r for r in rows(result) if r.section == section and r.pair.adaptation_rate == rate)
    if row.pair.bandwidth is not None:
        chart.rule(float(row.pair.bandwidth), "chosen")
        legend.append(("chosen", f"{row.which}: ω = {exact(row.pair.bandwidth)} rad/s"))
    legend.append(("fails", "does not hold"))
    caption = (
        f"With the adaptation rate kept at Γ = {exact(rate)}; each value is proven for its own bandwidth."
    )
    return Figure(key=key, title=title, svg=chart.text(), legend=tuple(legend), caption=caption)


def _known(omegas: list[float], values: Sequence[float | None]) -> list[list[Point]]:
    """The stretches of a curve on which it is known, in per cent."""
    points = zip(omegas, values, strict=True)
    parts = (list(part) for known, part in groupby(points, key=lambda p: p[1] is not None) if known)
    return [[(w, 100 * max(v, 4 * _LOWEST)) for w, v in part if v is not None] for part in parts]


# -- what binds


def _elasticities(result: Result) -> Figure | None:
    """Bars: by how many per cent the least Gamma rises when a constant rises by one."""
    slopes = {s: v for s, v in (result.elasticities or {}).items() if v}
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
        symbol = result.constants[name].symbol if name in result.constants else name
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

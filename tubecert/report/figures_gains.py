"""Figures of trade-offs: what a bandwidth costs in adaptation rate, what metrics cost by their rates.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from tubecert.certificate.result import MetricRow, Result
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.page import Figure

STYLES = {"no_adaptation": "zero", "conditions_26": "a", "distance": "b"}
_DRAWN: Final = {
    "condition_number": "condition number",
    "input_gain": "beta / sqrt(a)",
    "adaptation_rate": "least Γ (B)",
}
_FLOORS: Final = {"identity": ("m1", "least condition number"), "input": ("m2", "least input gain")}


def gain_figures(result: Result) -> list[Figure]:
    """The trade-off of bandwidth and adaptation rate, if the certificate has data for it."""
    curves = {
        key: list(section.points())
        for key, section in result.sections.items()
        if key in NAMES and len(section.points()) > 1
    }
    if not curves:
        return []
    chosen = [(row, at) for row in rows(result) if (at := _place(row)) is not None]
    every = [p for points in curves.values() for p in points] + [place for _, place in chosen]
    x = Axis.around([p[0] for p in every], "bandwidth ω (rad/s)", log=True)
    y = Axis.around([p[1] for p in every], "adaptation rate Γ", log=True)
    title = "Adaptation rate against bandwidth"
    chart = Chart("trade-off", title, x, y)
    legend = []
    for section, points in curves.items():
        chart.line(points, STYLES[section])
        legend.append((STYLES[section], NAMES[section]))
    for row, place in chosen:
        style = STYLES[row.section]
        chart.dot(place, f"{style} decides" if row.decides else style, 6 if row.decides else 4.5, _told(row))
    if any(row.decides for row, _ in chosen):
        legend.append(("decides", "decides the verdict"))
    caption = "Points of a curve were found to serve: computed, not examined by recheck."
    return [Figure(key="trade-off", title=title, svg=chart.text(), legend=tuple(legend), caption=caption)]


def _place(row: Gains) -> Point | None:
    """Where a row is drawn: its bandwidth and its rate."""
    pair = row.pair
    if pair.bandwidth is None or pair.adaptation_rate is None:
        return None
    return float(pair.bandwidth), float(pair.adaptation_rate)


def _told(row: Gains) -> str:
    return f"{NAMES[row.section]}, {row.chosen}: {row.text()}"


def rate_figures(rows: Sequence[MetricRow]) -> list[Figure]:
    """A figure for each quantity that any of the rows has."""
    found = (
        (key, label, [row for row in rows if getattr(row, key) is not None]) for key, label in _DRAWN.items()
    )
    return [_figure(key, label, known) for key, label, known in found if known]


def _figure(key: str, label: str, rows: Sequence[MetricRow]) -> Figure:
    x = Axis.around([float(row.rate) for row in rows], "rate λ (1/s)")
    title = f"{label} against the rate"
    chart = Chart(f"rates-{key}", title, x, Axis.around([getattr(row, key) for row in rows], label, log=True))
    legend = []
    for floor, (style, words) in _FLOORS.items():
        points = sorted((float(row.rate), float(getattr(row, key))) for row in rows if row.floor == floor)
        if points:
            chart.line(points, style)
            legend.append((style, words))
        for point in points:
            chart.dot(point, style, 3.0)
    return Figure(key=chart.key, title=title, svg=chart.text(), legend=tuple(legend))

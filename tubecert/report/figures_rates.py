"""The metrics that a synthesis compared, drawn over the rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from tubecert.certificate.result import MetricRow
from tubecert.report.figures_axes import Axis, Chart
from tubecert.report.page import Figure

_DRAWN: Final = {
    "condition_number": "condition number",
    "input_gain": "beta / sqrt(a)",
    "adaptation_rate": "least Γ (B)",
}
_FLOORS: Final = {"identity": ("m1", "least condition number"), "input": ("m2", "least input gain")}


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

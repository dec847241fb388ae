"""Figures of trade-offs: what a bandwidth costs in adaptation rate, what metrics cost by their rates.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from tubecert.certificate.result import MetricRow, Result
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.verdict import Verdict

STYLES = {"no_adaptation": "zero", "conditions_26": "a", "distance": "b"}
_DRAWN: Final = {
    "condition_number": "condition number",
    "input_gain": "beta / sqrt(a)",
    "demand": "Γ |B|²",
}
_FOUND: Final = "Points of a curve were found to serve: computed, not examined by recheck."
_FLOORS: Final = {"identity": ("m1", "least condition number"), "input": ("m2", "least input gain")}


def trade_off(result: Result) -> Chart | None:
    """Bandwidths and adaptation rates: curves, as far as the certificate has them, and the gains that were chosen."""
    curves = {key: list(section.points()) for key, section in result.sections.items() if key in NAMES}
    chosen = [(row, at) for row in rows(result) if (at := _place(row)) is not None]
    every = [*(p for points in curves.values() for p in points), *(place for _, place in chosen)]
    if not every:
        return None
    x = Axis.around([p[0] for p in every], "bandwidth ω (rad/s)", log=True)
    y = Axis.around([p[1] for p in every], "adaptation rate Γ", log=True)
    title = "Adaptation rate against bandwidth"
    chart = Chart(key="trade-off", title=title, x=x, y=y, caption=_FOUND)
    for section, points in curves.items():
        if len(points) > 1:
            verdict = result.sections[section].verdict
            told = "" if verdict is Verdict.CERTIFIED else f", {verdict}"
            chart.line(points, STYLES[section], NAMES[section] + told)
    for row, place in chosen:
        tip, style = f"{NAMES[row.section]}, {row.chosen}: {row.text()}", STYLES[row.section]
        if row.decides:
            chart.dot(place, f"{style} decides", "decides the verdict", tip=tip, size=6)
        else:
            chart.dot(place, style, tip=tip)
    return chart


def _place(row: Gains) -> Point | None:
    """Where a row is drawn: its bandwidth and its rate."""
    return None if row.omega is None or row.Gamma is None else (row.omega, row.Gamma)


def rate_figures(rows: Sequence[MetricRow]) -> Iterator[Chart]:
    """A figure for each quantity that any of the rows has."""
    for key, label in _DRAWN.items():
        known = [
            (row.floor, float(row.rate), float(at)) for row in rows if (at := getattr(row, key)) is not None
        ]
        if not known:
            continue
        x, y = Axis.around([at for _, at, _ in known], "rate λ (1/s)"), [value for *_, value in known]
        title = f"{label} against the rate"
        chart = Chart(key=f"rates-{key}", title=title, x=x, y=Axis.around(y, label, log=True))
        for floor, (style, words) in _FLOORS.items():
            points = sorted((at, value) for own, at, value in known if own == floor)
            if points:
                chart.line(points, style, words)
            for point in points:
                chart.dot(point, style, size=3.0)
        yield chart

"""Figures of the gains: what a bandwidth costs in rate, what it leaves of the margins, which constants bind.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

from tubecert.certificate.result import Result
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.page import Figure

STYLES = {"no_adaptation": "zero", "conditions_26": "a", "distance": "b"}
_LOWEST = -0.5  # margins below are not drawn
_MOST = 12  # constants shown


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
    return f"{NAMES[row.section]}, {row.which}: {row.text()}"

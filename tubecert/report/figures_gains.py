"""Figures of the gains: what a bandwidth costs in rate, what it leaves of the margins, which constants bind.

In: `result` of a certificate. Out: figures. Curves and pairs are those of the certificate; nothing is computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from tubecert.certificate.result import Result
from tubecert.digits import exact
from tubecert.kinds import HARDWARE, SAMPLED
from tubecert.kinds.hardware import HardwareData
from tubecert.kinds.sampled import SampledData
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.page import Figure

STYLES = {"no_adaptation": "zero", "conditions_26": "a", "distance": "b", "sampled": "c", "hardware": "h"}
_LOWEST = -0.5  # margins below are not drawn
_MOST = 12  # constants shown


def gain_figures(result: Result) -> list[Figure]:
    """Every figure that the certificate has data for."""
    made = (
        _trade_off(result),
        _sample_time(result),
        _levels(result),
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

"""Figures that a user can draw into: the tube in a plane of states, what a bandwidth needs. They prove nothing.

In: `result` of a certificate, axes or none. Out: the axes, with what the page shows (`report.figures_tube`,
`report.figures_gains`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tubecert.asking import require_installed
from tubecert.certificate.result import Result
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.report.figures_file import paint
from tubecert.report.figures_gains import trade_off
from tubecert.report.figures_tube import plane_figure, state_figures

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def tube(result: Result, ax: Axes | None, states: tuple[str, str] | None) -> Axes:
    """Plan, tube, safe set and obstacles in the plane of two states; one state alone against time."""
    system, axes = result.spec.effective.system, _axes(ax)
    if len(system.states) == 1:
        for chart in state_figures(result):
            paint(axes, chart)
        return axes
    one, other = _places(system.states, states or system.states[:2])
    paint(axes, plane_figure(result, (one, other)))
    units = [system.units.get(system.states[i], "") for i in (one, other)]
    if units[0] == units[1]:
        axes.set_aspect("equal", adjustable="box")
    return axes


def tradeoff(result: Result, ax: Axes | None) -> Axes:
    """The proven pairs of bandwidth and adaptation rate of every kind, and the gains that were chosen."""
    axes, chart = _axes(ax), trade_off(result)
    if chart is not None:
        paint(axes, chart)
    return axes


def _axes(ax: Axes | None) -> Axes:
    """The axes to draw into; new ones of pyplot, which notebooks show, if there are none."""
    if ax is not None:
        return ax
    require_installed("matplotlib", "simulate", "figures need")
    import matplotlib.pyplot as plt

    _, axes = plt.subplots(layout="constrained")
    return axes


def _places(known: tuple[str, ...], names: tuple[str, ...]) -> tuple[int, int]:
    """Two states by name; raises `SpecError` for what are no two states."""
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(known):
        message = f"{', '.join(map(str, names))} are not two states"
        raise SpecError([Finding(code="TC112", message=message, help=f"the states are {', '.join(known)}")])
    return known.index(names[0]), known.index(names[1])

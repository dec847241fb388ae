"""Figures that a user can draw into: the tube in a plane of states, what a bandwidth needs. They prove nothing.

In: `result` of a certificate, axes or none. Out: the axes. What is drawn is chosen where the page chooses it
(`report.figures_tube`, `report.gains`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.certificate.effective import ObstacleView
from tubecert.certificate.result import Result
from tubecert.enclosure.interval import Array
from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.kinds import name_of
from tubecert.report import figures_tube
from tubecert.report.claimed import horizon
from tubecert.report.figures_scene import Plane
from tubecert.report.gains import rows
from tubecert.report.outline import widths

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

COLORS: Final = ("#7F7F7F", "#D55E00", "#0072B2", "#009E73", "#CC79A7", "#56B4E9")  # of Okabe and Ito
TUBE: Final = "#FBE3B5"  # opaque: overlapping shapes must not darken each other
UNPROVEN: Final = "#E4E4E4"
_GREY, _EDGE = "#BDBDBD", "#6E6E6E"
_SHAPES: Final = 400  # sections of the tube that are drawn


def tube(result: Result, ax: Axes | None, states: tuple[str, str] | None) -> Axes:
    """Plan, tube, safe set and obstacles in the plane of two states; one state alone against time."""
    names = result.spec.effective.system.states
    axes = _axes(ax)
    if len(names) == 1:
        return _over_time(result, axes)
    chosen = _plane(result, states or (names[0], names[1]))
    _box(axes, chosen)
    _tube(axes, result, chosen)
    for obstacle in result.spec.effective.obstacles:
        if set(obstacle.states) == set(chosen.names):
            axes.add_patch(_obstacle(obstacle, chosen))
    if len(chosen.plan):
        x, y = chosen.plan.T
        axes.plot(x, y, color="black", lw=1.0, ls="--", label="plan")
        axes.plot(x[0], y[0], color="black", marker="o", ms=4, ls="none", label="start of the plan")
    view = chosen.axes()
    axes.set_xlim(view[0].low, view[0].high)
    axes.set_ylim(view[1].low, view[1].high)
    if chosen.units[0] == chosen.units[1]:
        axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel(view[0].label)
    axes.set_ylabel(view[1].label)
    return axes


def tradeoff(result: Result, ax: Axes | None) -> Axes:
    """The proven pairs of bandwidth and adaptation rate of every kind, and the gains that were chosen."""
    axes = _axes(ax)
    pairs = [
        row for row in rows(result) if row.pair.bandwidth is not None and row.pair.adaptation_rate is not None
    ]
    keys = list(result.sections)
    for key in dict.fromkeys(row.section for row in pairs):
        color = COLORS[keys.index(key) % len(COLORS)]
        points = np.array(result.sections[key].points(), dtype=float).reshape(-1, 2)
        if len(points):
            axes.plot(points[:, 0], points[:, 1], color=color, lw=1.4, label=str(name_of(key)))
    for row in pairs:
        at = (float(row.pair.bandwidth or 0), float(row.pair.adaptation_rate or 0))
        size, label = (8, "decides the verdict") if row.decides else (5, None)
        color = COLORS[keys.index(row.section) % len(COLORS)]
        axes.plot(*at, marker="o", ms=size, color=color, ls="none", label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("bandwidth omega (rad/s)")
    axes.set_ylabel("adaptation rate Gamma")
    return axes


def _axes(ax: Axes | None) -> Axes:
    """The axes to draw into; new ones of pyplot, which notebooks show, if there are none."""
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError:
        message = "figures need matplotlib"
        help = "install tubecert with its extra: pip install 'tubecert[simulate]'"
        raise SpecError([Finding(code="TC122", message=message, help=help)]) from None
    _, axes = plt.subplots(layout="constrained")
    return axes


def _plane(result: Result, names: Sequence[str]) -> Plane:
    """What is known in the plane of two states, by name; raises `SpecError` for what are no two states."""
    known = list(result.spec.effective.system.states)
    if len(names) != 2 or len(set(names)) != 2 or not set(names) <= set(known):
        message = f"{', '.join(map(str, names))} are not two states"
        raise SpecError([Finding(code="TC112", message=message, help=f"the states are {', '.join(known)}")])
    return figures_tube.plane(result, (known.index(names[0]), known.index(names[1])))


def _box(axes: Axes, chosen: Plane) -> None:
    from matplotlib.patches import Rectangle

    low, high = chosen.safe
    box = Rectangle(low, high[0] - low[0], high[1] - low[1], fill=False, edgecolor=_EDGE, lw=1.0)
    box.set_label("safe set")
    axes.add_patch(box)


def _tube(axes: Axes, result: Result, chosen: Plane) -> None:
    """Sections of the tube along the plan."""
    from matplotlib.collections import PolyCollection

    if chosen.tube is None or not len(chosen.plan):
        return
    proven = result.tube is not None and result.tube.rho_r is not None
    sections = [chosen.tube + point for point in _along(chosen.plan)]
    color, label = (TUBE, "tube") if proven else (UNPROVEN, "tube, not proven to stay in the safe set")
    drawn = PolyCollection(sections, facecolors=color, edgecolors="none", zorder=1, label=label)
    axes.add_collection(drawn, autolim=False)


def _along(plan: Array) -> Array:
    """Points (K, 2) of a curve that are close together."""
    at = np.linspace(0, len(plan) - 1, _SHAPES if len(plan) > 1 else 1)
    return np.stack([np.interp(at, np.arange(len(plan)), plan[:, i]) for i in range(2)], axis=1)


def _over_time(result: Result, axes: Axes) -> Axes:
    """The tube of a single state; a plan without an end is drawn for one second."""
    (name,) = result.spec.effective.system.states
    low, high = map(float, result.safe_set[name])
    for side in (low, high):
        axes.axhline(side, color=_EDGE, lw=1.0, label="safe set" if side == low else None)
    samples, known = result.plan.samples, widths(result)
    if samples is not None:
        x = np.array([row[0] for row in samples.x])
        t = np.array(samples.t) if len(x) > 1 else np.array([0.0, float(horizon(result) or 1)])
        x = np.broadcast_to(x, t.shape)
        if known is not None:
            axes.fill_between(t, x - known[name], x + known[name], color=TUBE, lw=0, label="tube")
        axes.plot(t, x, color="black", lw=1.0, ls="--", label="plan")
    unit = result.spec.effective.system.units.get(name)
    axes.set_xlabel("t (s)")
    axes.set_ylabel(f"{name} ({unit})" if unit else name)
    return axes


def _obstacle(obstacle: ObstacleView, chosen: Plane) -> Patch:
    from matplotlib.patches import Circle, Polygon

    order = (0, 1) if obstacle.states == chosen.names else (1, 0)
    label = "obstacle"
    if obstacle.disc is not None:
        x, y = (float(obstacle.disc.center[i]) for i in order)
        return Circle(
            (x, y), float(obstacle.disc.radius), facecolor=_GREY, edgecolor=_EDGE, zorder=2, label=label
        )
    corners = np.array([[float(corner[i]) for i in order] for corner in obstacle.polygon])
    return Polygon(corners, closed=True, facecolor=_GREY, edgecolor=_EDGE, zorder=2, label=label)

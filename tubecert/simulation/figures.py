"""Figures of a campaign: what runs attained of the tube over time, and some of them in the plane. Trusted: no."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.clearance import corners_of
from tubecert.simulate.figures_style import COLORS, STYLE, TUBE, blank
from tubecert.simulation.campaign import Campaign
from tubecert.spec import Obstacle

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

FIGURES: Final = ("tube_use", "plane")
_GROUPS: Final = (("random runs", COLORS["nominal"]), ("adversaries", COLORS["l1"]))
_BOXES: Final = 400  # cross-sections of the tube that are drawn


def drawn(name: str, campaign: Campaign) -> Figure | None:
    """A figure by its name; None if there is nothing to draw. Raises `KeyError` for a name that is none."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        return {"tube_use": _tube_use, "plane": _plane}[name](campaign)


def _tube_use(campaign: Campaign) -> Figure:
    """Every state and input over time: bounds, stage by stage, and the largest deviations of all runs."""
    own = campaign.setting
    figure = blank(7.0, 0.9 + 1.5 * len(own.names))
    axes = figure.subplots(len(own.names), 1, sharex=True, squeeze=False)[:, 0]
    t = np.arange(own.samples) * own.Ts
    bounds = np.hstack([own.at(k) for k in range(own.samples)])
    units = dict(own.spec.units)
    for i, (axis, name) in enumerate(zip(axes, own.names, strict=True)):
        axis.fill_between(t, 0, bounds[i], step="post", color=TUBE, alpha=0.25, lw=0, label="proven")
        for (label, color), profile in zip(_GROUPS, campaign.profile, strict=True):
            axis.plot(t, profile[i] * bounds[i], color=color, lw=1.0, label=label)
        sign = f"|{name} - {name}*|"
        axis.set_ylabel(f"{sign} [{units[name]}]" if name in units else sign)
        axis.set_ylim(0, None)
    axes[-1].set_xlabel("t [s]")
    axes[-1].set_xlim(0, t[-1] if len(t) > 1 else None)
    _titled(figure, axes[0], campaign, 3)
    return figure


def _plane(campaign: Campaign) -> Figure | None:
    """The plane of two states: plan, tube, obstacles and some runs."""
    own = campaign.setting
    names = _names(campaign)
    if names is None:
        return None
    i, j = (own.spec.states.index(name) for name in names)
    figure = blank(6.4, 5.6)
    axis = figure.subplots()
    if own.spec.trajectory.bundle is None:
        _tube(axis, campaign, i, j)
    for obstacle in own.spec.obstacles:
        if obstacle.states == names:
            axis.add_patch(_shape(obstacle))
    path = campaign.found[0].path
    axis.plot(path[:, i], path[:, j], color=COLORS["l1"], lw=0.5, alpha=0.5)
    axis.plot([], [], color=COLORS["l1"], lw=0.5, label="some runs")
    axis.autoscale_view()
    axis.set_xlabel(names[0])
    axis.set_ylabel(names[1])
    _titled(figure, axis, campaign, 4)
    return figure


def _names(campaign: Campaign) -> tuple[str, str] | None:
    """The states of the plane: those asked for, else those of an obstacle, else the first two."""
    spec = campaign.setting.spec
    if spec.simulation and spec.simulation.plane:
        return spec.simulation.plane
    if spec.obstacles:
        return spec.obstacles[0].states
    return (spec.states[0], spec.states[1]) if len(spec.states) > 1 else None


def _tube(axis: Axes, campaign: Campaign, i: int, j: int) -> None:
    from matplotlib.collections import PolyCollection

    own = campaign.setting
    plan = campaign.found[0].course.x[:: len(own.nominal.lengths), :, 0]
    samples = np.unique(np.linspace(0, own.samples - 1, _BOXES).astype(int))
    corners: Array = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    boxes = [plan[k, [i, j]] + corners * own.at(k)[[i, j], 0] for k in samples]
    axis.add_collection(
        PolyCollection(boxes, facecolors="#FBE3B5", edgecolors="none", zorder=1, label="tube")
    )
    axis.plot(plan[:, i], plan[:, j], color="black", lw=1.0, ls="--", zorder=5, label="plan")


def _shape(obstacle: Obstacle) -> Patch:
    from matplotlib.patches import Circle, Polygon

    look = {"facecolor": "#BDBDBD", "edgecolor": "#6E6E6E", "zorder": 2}
    if obstacle.radius is None:
        return Polygon(corners_of(obstacle), closed=True, **look)
    x, y = map(float, obstacle.center)
    return Circle((x, y), float(obstacle.radius), **look)


def _titled(figure: Figure, axis: Axes, campaign: Campaign, columns: int) -> None:
    axis.set_title(
        f"{campaign.setting.spec.name}: {campaign.runs} runs of the sampled loop", fontsize=9, loc="left"
    )
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)

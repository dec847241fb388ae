"""The plane of two states: plan, tube, obstacles and loops."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.campaigns.figures import LIGHT, blank, labelled, names_of, obstacles, titled
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.simulate.campaign import Campaign
from tubecert.simulate.figures_style import line, title
from tubecert.simulate.setting import Setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SHAPES: Final = 400  # cross-sections of the tube that are drawn


def plane(campaign: Campaign) -> Figure | None:
    """The plane with plan, tube, obstacles and loops."""
    setting = campaign.setting
    names = names_of(setting.spec)
    if names is None:
        return None
    from matplotlib.collections import PolyCollection

    figure = blank(6.4, 5.6)
    axis = figure.subplots()
    i, j = (setting.spec.states.index(name) for name in names)
    t = np.linspace(0.0, setting.horizon, 2001)
    plan = setting.plan.enclose(t, t)[0].mid
    section = _section(setting, i, j)
    shapes = [section + point for point in _spread(plan[:, [i, j]])]
    axis.add_collection(PolyCollection(shapes, facecolors=LIGHT, edgecolors="none", zorder=1, label="tube"))
    obstacles(axis, setting.spec, names)
    for item in campaign.drawn:
        axis.plot(item.runs.x[0, :, i], item.runs.x[0, :, j], zorder=4, **line(item))
    axis.plot(plan[:, i], plan[:, j], color="black", lw=1.0, ls="--", zorder=5, label="plan")
    axis.plot(*plan[0, [i, j]], marker="o", ms=4, color="black", ls="none", zorder=6)
    axis.plot(*plan[-1, [i, j]], marker="s", ms=4, color="black", ls="none", zorder=6)
    _window(axis, np.vstack(shapes), [item.runs.x[0][:, [i, j]] for item in campaign.drawn])
    axis.set_aspect("equal")
    axis.set_xlabel(labelled(setting.spec, names[0]))
    axis.set_ylabel(labelled(setting.spec, names[1]))
    titled(figure, axis, title(campaign), 5)
    return figure


def _spread(curve: Array) -> Array:
    """Points (K, 2) of a curve at equal distances along it."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    if length[-1] == 0:
        return curve[:1]
    wanted = np.linspace(0.0, length[-1], _SHAPES)
    return np.stack([np.interp(wanted, length, curve[:, i]) for i in range(2)], axis=1)


def _section(setting: Setting, i: int, j: int) -> Array:
    """The outline (K, 2) of the tube around a point of the plan, projected to the plane of two states.

    For a constant metric that is the projection of the ellipsoid d < dbar; else that of |S (x - x*)| < rho, a disc
    where z is x, cut to the half-widths.
    """
    angle = np.linspace(0.0, 2 * np.pi, 73)[:-1]
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    W = setting.model.W
    if all(e.is_constant for row in W for e in row):
        values = Tape([W[a][b] for a in (i, j) for b in (i, j)], ()).run_floats([], ()).reshape(2, 2)
        return np.asarray(setting.reach * circle @ np.linalg.cholesky(values).T)
    widths = setting.half_widths[[i, j]]
    spread = np.linalg.inv(setting.S.T @ setting.S)[np.ix_([i, j], [i, j])]
    return np.clip(setting.rho * circle @ np.linalg.cholesky(spread).T, -widths, widths)


def _window(axis: Axes, tube: Array, curves: list[Array]) -> None:
    """The tube and what stays within a tube of it."""
    low, high = tube.min(axis=0), tube.max(axis=0)
    room = 0.5 * (high - low)
    for curve in curves:
        shown = curve[np.isfinite(curve).all(axis=1)]
        if len(shown):
            low = np.maximum(np.minimum(low, shown.min(axis=0)), tube.min(axis=0) - room)
            high = np.minimum(np.maximum(high, shown.max(axis=0)), tube.max(axis=0) + room)
    margin = 0.04 * (high - low)
    axis.set_xlim(low[0] - margin[0], high[0] + margin[0])
    axis.set_ylim(low[1] - margin[1], high[1] + margin[1])

"""Figures of a campaign: PNG and SVG with the same bytes for the same data. They show; they prove nothing.

Colours are those of Okabe and Ito, told apart by everybody; what is certified is orange, the plan is dashed black.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.simulate.campaign import Campaign, Drawn
from tubecert.simulate.clearance import corners_of
from tubecert.simulate.setting import Setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS: Final = {
    "l1": "#0072B2",
    "sampled": "#009E73",
    "ccm": "#D55E00",
    "reference": "#CC79A7",
    "nominal": "#7F7F7F",
}
TUBE: Final = "#E69F00"
NAMES: Final = {
    "l1": "L1 adaptive",
    "sampled": "L1, sampled adaptation",
    "ccm": "CCM alone",
    "reference": "reference system",
    "nominal": "CCM, no uncertainty",
}
FORMATS: Final = ("png", "svg")
_STYLE: Final[Any] = {
    "svg.hashsalt": "tubecert",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "savefig.dpi": 150,
}
_SHAPES: Final = 400  # cross-sections of the tube that are drawn in the plane


def figures(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    """File names and contents, one figure after the other."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    import matplotlib as mpl

    drawers: dict[str, Callable[[Campaign], Figure | None]] = {
        "states": _states,
        "plane": _plane,
        "inputs": _inputs,
        "tube_use": _tube_use,
        "monte_carlo": _monte_carlo,
    }
    for name, draw in drawers.items():
        with mpl.rc_context(_STYLE):
            figure = draw(campaign)
            if figure is not None:
                yield from _files(name, figure)


def _files(name: str, figure: Figure) -> Iterator[tuple[str, bytes]]:
    for kind in FORMATS:
        buffer = BytesIO()
        metadata = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
        figure.savefig(buffer, format=kind, metadata=metadata)
        yield f"{name}.{kind}", buffer.getvalue()


def _figure(width: float, height: float) -> Figure:
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _states(campaign: Campaign) -> Figure:
    """Every state over time, in the tube's half-widths, with the radius that is certified in the long run."""
    setting, first = campaign.setting, campaign.drawn[0].runs
    names = setting.spec.states
    figure = _figure(7.0, 0.9 + 1.7 * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    ultimate = _ultimate(campaign)
    for i, (axis, name, width) in enumerate(zip(axes, names, setting.half_widths, strict=True)):
        plan = first.x_plan[:, i]
        axis.fill_between(first.t, plan - width, plan + width, color=TUBE, alpha=0.25, lw=0, label="tube")
        if ultimate is not None and ultimate < width:
            for sign in (-1, 1):
                label = "in the long run" if sign > 0 else None
                axis.plot(first.t, plan + sign * ultimate, color=TUBE, lw=1.0, ls=(0, (5, 2)), label=label)
        for item in campaign.drawn:
            axis.plot(item.runs.t, item.runs.x[0, :, i], **_line(item))
        axis.plot(first.t, plan, color="black", lw=1.0, ls="--", label="plan")
        _limit(axis, plan, width, [item.runs.x[0, :, i] for item in campaign.drawn])
        axis.set_ylabel(_labelled(setting, name))
    _finish(figure, axes[-1], axes[0], campaign)
    return figure


def _limit(axis: Axes, plan: Array, width: float, curves: list[Array]) -> None:
    """Limits that show the tube and what stays within a few tubes of it; what diverges leaves the picture."""
    low, high = float(np.min(plan)) - width, float(np.max(plan)) + width
    room = 1.5 * (high - low)
    for curve in curves:
        shown = curve[np.isfinite(curve)]
        if shown.size:
            low, high = min(low, float(shown.min())), max(high, float(shown.max()))
    low = max(low, float(np.min(plan)) - width - room)
    high = min(high, float(np.max(plan)) + width + room)
    margin = 0.06 * (high - low)
    axis.set_ylim(low - margin, high + margin)


def _plane(campaign: Campaign) -> Figure | None:
    """The plane with plan, tube, obstacles and loops."""
    setting = campaign.setting
    names = plane_of(setting)
    if names is None:
        return None
    from matplotlib.collections import PolyCollection

    figure = _figure(6.4, 5.6)
    axis = figure.subplots()
    i, j = (setting.spec.states.index(name) for name in names)
    plan = _fine_plan(setting)
    section = _section(setting, i, j)
    shapes = [section + point for point in _spread(plan[:, [i, j]])]
    # drawn opaque: overlapping shapes must not darken each other
    axis.add_collection(PolyCollection(shapes, facecolors="#FBE3B5", edgecolors="none", zorder=1))
    _obstacles(axis, setting, names)
    for item in campaign.drawn:
        axis.plot(item.runs.x[0, :, i], item.runs.x[0, :, j], zorder=4, **_line(item))
    axis.plot(plan[:, i], plan[:, j], color="black", lw=1.0, ls="--", zorder=5, label="plan")
    axis.plot(*plan[0, [i, j]], marker="o", ms=4, color="black", ls="none", zorder=6)
    axis.plot(*plan[-1, [i, j]], marker="s", ms=4, color="black", ls="none", zorder=6)
    _window(axis, np.vstack(shapes), [item.runs.x[0][:, [i, j]] for item in campaign.drawn])
    axis.set_aspect("equal")
    axis.set_xlabel(_labelled(setting, names[0]))
    axis.set_ylabel(_labelled(setting, names[1]))
    axis.set_title(_title(campaign), fontsize=9, loc="left")
    handles, labels = axis.get_legend_handles_labels()
    from matplotlib.patches import Patch

    tube = Patch(facecolor="#FBE3B5")
    figure.legend([tube, *handles], ["tube", *labels], loc="outside lower center", ncols=5)
    return figure


def plane_of(setting: Setting) -> tuple[str, str] | None:
    """The states of the plane that is drawn: those asked for, else those of an obstacle, else the first two."""
    spec = setting.spec
    if spec.simulation and spec.simulation.plane:
        return spec.simulation.plane
    if spec.obstacles:
        return spec.obstacles[0].states
    return (spec.states[0], spec.states[1]) if len(spec.states) > 1 else None


def _fine_plan(setting: Setting) -> Array:
    """The plan's states (K, n) for drawing."""
    t = np.linspace(0.0, setting.horizon, 2001)
    x, _ = setting.plan.enclose(t, t)
    return x.mid


def _spread(curve: Array) -> Array:
    """Points (K, 2) of a curve at equal distances along it."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    if length[-1] == 0:
        return curve[:1]
    wanted = np.linspace(0.0, length[-1], _SHAPES)
    return np.stack([np.interp(wanted, length, curve[:, i]) for i in range(2)], axis=1)


def _section(setting: Setting, i: int, j: int) -> Array:
    """The outline (K, 2) of the tube around a point of the plan, projected to the plane of two states.

    For a constant metric that is the projection of the ellipsoid d < dbar; else the disc of radius rho, cut to the
    half-widths.
    """
    angle = np.linspace(0.0, 2 * np.pi, 73)[:-1]
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    W = setting.model.W
    if all(e.is_constant for row in W for e in row):
        values = Tape([W[a][b] for a in (i, j) for b in (i, j)], ()).run_floats([], ()).reshape(2, 2)
        return np.asarray(setting.reach * circle @ np.linalg.cholesky(values).T)
    widths = setting.half_widths[[i, j]]
    return np.clip(setting.rho * circle, -widths, widths)


def _obstacles(axis: Axes, setting: Setting, names: tuple[str, str]) -> None:
    from matplotlib.patches import Circle, Patch, Polygon

    label: str | None = "obstacle"
    for obstacle in setting.spec.obstacles:
        if set(obstacle.states) != set(names):
            continue
        turned = obstacle.states != names
        style: dict[str, Any] = {"facecolor": "#BDBDBD", "edgecolor": "#6E6E6E", "zorder": 2, "label": label}
        patch: Patch
        if obstacle.radius is not None:
            center = [float(value) for value in obstacle.center]
            patch = Circle((center[::-1] if turned else center), float(obstacle.radius), **style)  # type: ignore[arg-type]
        else:
            corners = corners_of(obstacle)
            patch = Polygon(corners[:, ::-1] if turned else corners, closed=True, **style)
        axis.add_patch(patch)
        label = None


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


def _inputs(campaign: Campaign) -> Figure:
    """What acts: u = u* + k + u_a, for every loop and input, and what u_a should cancel."""
    setting = campaign.setting
    names, loops = setting.spec.inputs, campaign.drawn
    figure = _figure(1.2 + 3.6 * len(loops), 0.9 + 2.2 * len(names))
    axes = figure.subplots(len(names), len(loops), sharex=True, sharey="row", squeeze=False)
    for column, item in enumerate(loops):
        runs = item.runs
        for row, name in enumerate(names):
            axis = axes[row, column]
            axis.plot(runs.t, runs.u[0, :, row], color="black", lw=1.0, label="u = u* + k + u_a")
            axis.plot(runs.t, runs.u_plan[:, row], color="#7F7F7F", ls="--", label="plan u*")
            axis.plot(runs.t, runs.k[0, :, row], color=COLORS["ccm"], label="feedback k")
            axis.plot(runs.t, -runs.h[0, :, row], color=TUBE, lw=2.6, alpha=0.7, label="-h")
            if item.loop.problem.adaptive:
                axis.plot(runs.t, runs.u_a[0, :, row], color=COLORS["l1"], lw=1.0, label="adaptive u_a")
            if column == 0:
                axis.set_ylabel(_labelled(setting, name))
        axes[0, column].set_title(NAMES[item.loop.controller], fontsize=9, loc="left")
        axes[-1, column].set_xlabel("t [s]")
        axes[-1, column].set_xlim(0, setting.horizon)
    fullest = max(range(len(loops)), key=lambda column: len(axes[0, column].lines))
    figure.legend(*axes[0, fullest].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _tube_use(campaign: Campaign) -> Figure:
    """The distance over time, as a share of the tube; above 1 the tube is left."""
    setting = campaign.setting
    figure = _figure(7.0, 3.4)
    axis = figure.subplots()
    most = 1.0
    for item in campaign.drawn:
        share = item.runs.distance[0] / setting.reach
        most = max(most, float(np.nanmax(share)))
        axis.plot(item.runs.t, share, **_line(item))
        if item.loop.promise is not None and item.loop.promise.decay is not None:
            bound = item.loop.promise.decay(item.runs.t) / setting.reach
            color = COLORS[item.loop.controller]
            axis.plot(
                item.runs.t, bound, color=color, lw=1.0, ls=":", label=f"certified D(t), {_short(item)}"
            )
    for attack in campaign.attacks:
        if attack.worst is not None:
            share = attack.worst.distance[0] / setting.reach
            label = f"worst adversary, {_controller(attack.loop.controller)}"
            axis.plot(
                attack.worst.t, share, color=COLORS[attack.loop.controller], lw=1.0, alpha=0.5, label=label
            )
    axis.axhspan(0, 1, color=TUBE, alpha=0.18, lw=0)
    axis.axhline(1, color=TUBE, lw=1.0)
    axis.set_ylim(0, min(1.06 * most, 5.0))
    axis.set_ylabel("d(x*, x) / dbar")
    _finish(figure, axis, axis, campaign)
    return figure


def _monte_carlo(campaign: Campaign) -> Figure | None:
    """How the runs of a sample are spread over the tube, over time."""
    attacks = [item for item in campaign.attacks if item.sample is not None]
    if not attacks:
        return None
    setting = campaign.setting
    figure = _figure(7.0, 0.8 + 2.8 * len(attacks))
    axes = figure.subplots(len(attacks), 1, sharex=True, squeeze=False)[:, 0]
    for axis, attack in zip(axes, attacks, strict=True):
        assert attack.sample is not None
        runs, color = attack.sample.runs, COLORS[attack.loop.controller]
        share = runs.distance / setting.reach
        alive = ~np.isnan(share).all(axis=0)
        t, share = runs.t[alive], share[:, alive]
        low, q25, median, q75, high = np.nanquantile(share, [0, 0.25, 0.5, 0.75, 1], axis=0)
        axis.fill_between(t, low, high, color=color, alpha=0.18, lw=0, label="all runs")
        axis.fill_between(t, q25, q75, color=color, alpha=0.35, lw=0, label="middle half")
        axis.plot(t, median, color=color, label="median")
        if attack.worst is not None:
            worst = attack.worst.distance[0] / setting.reach
            axis.plot(attack.worst.t, worst, color="black", lw=1.0, label="worst adversary")
        promise = attack.loop.promise
        if promise is not None and promise.decay is not None:
            axis.plot(
                t, promise.decay(t) / setting.reach, color=TUBE, lw=1.4, ls="--", label="certified D(t)"
            )
        axis.axhline(1, color=TUBE, lw=1.2, label="tube")
        axis.set_ylim(0, min(max(1.08, 1.05 * float(np.nanmax(share))), 5.0))
        axis.set_ylabel("d(x*, x) / dbar")
        title = f"{NAMES[attack.loop.controller]}: {len(share)} random runs, seed {campaign.seed}"
        axis.set_title(title, fontsize=9, loc="left")
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    axes[-1].set_xlabel("t [s]")
    axes[-1].set_xlim(0, setting.horizon)
    return figure


def _line(item: Drawn) -> dict[str, Any]:
    controller = item.loop.controller
    style = "-" if item.loop.tested or controller in ("nominal", "reference") else (0, (6, 1.5))
    return {"color": COLORS[controller], "ls": style, "label": NAMES[controller]}


def _short(item: Drawn) -> str:
    return _controller(item.loop.controller)


def _controller(name: str) -> str:
    return NAMES[name]


def _ultimate(campaign: Campaign) -> float | None:
    """The smallest radius in the long run that is certified for a loop that is drawn."""
    found = [item.loop.promise.ultimate for item in campaign.drawn if item.loop.promise is not None]
    return min((value for value in found if value is not None), default=None)


def _labelled(setting: Setting, name: str) -> str:
    """A state or input with its unit, as far as the specification tells."""
    unit = dict(setting.spec.units).get(name)
    return f"{name} [{unit}]" if unit else name


def _title(campaign: Campaign) -> str:
    setting = campaign.setting
    return f"{setting.spec.name}: rho = {setting.rho:.4g}, uncertainty {campaign.uncertainty}"


def _finish(figure: Figure, bottom: Axes, legend: Axes, campaign: Campaign) -> None:
    bottom.set_xlabel("t [s]")
    bottom.set_xlim(0, campaign.setting.horizon)
    legend.set_title(_title(campaign), fontsize=9, loc="left")
    handles, labels = legend.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)

"""Figures of a campaign: PNG and SVG with the same bytes for the same data. They show; they prove nothing.

Here what is drawn over time; the plane of two states is in `figures_plane`, what all have in common in
`figures_style`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from tubecert.campaigns.figures import COLORS, STYLE, TUBE, blank, images, labelled
from tubecert.enclosure.interval import Array
from tubecert.simulate.campaign import Campaign
from tubecert.simulate.figures_plane import plane
from tubecert.simulate.figures_style import NAMES, finish, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figures(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    """File names and contents, one figure after the other."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    for name in drawers():
        if (figure := drawn(name, campaign)) is not None:
            yield from images(name, figure)


def drawn(name: str, campaign: Campaign) -> Figure | None:
    """A figure by its name; None if there is nothing to draw. Raises `KeyError` for a name that is none."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        return drawers()[name](campaign)


def drawers() -> dict[str, Callable[[Campaign], Figure | None]]:
    """All figures that there may be, by name."""
    return {
        "states": _states,
        "plane": plane,
        "inputs": _inputs,
        "tube_use": _tube_use,
        "monte_carlo": _monte_carlo,
    }


def _states(campaign: Campaign) -> Figure:
    """Every state over time, in the tube's half-widths, with the radius that is certified in the long run."""
    setting, first = campaign.setting, campaign.drawn[0].runs
    names = setting.spec.states
    figure = blank(7.0, 0.9 + 1.7 * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    ultimate = _ultimate(campaign)
    own = None if np.array_equal(setting.S, np.eye(len(names))) else setting.S
    for i, (axis, name, width) in enumerate(zip(axes, names, setting.half_widths, strict=True)):
        plan = first.x_plan[:, i]
        axis.fill_between(first.t, plan - width, plan + width, color=TUBE, alpha=0.25, lw=0, label="tube")
        # |x_i - x_i*| <= sup sqrt(W_ii) d, as the half-widths, where they are what bounds the tube
        rest = ultimate if ultimate is None or own is None else ultimate / setting.rho * width
        if rest is not None and rest < width:
            for sign in (-1, 1):
                label = "in the long run" if sign > 0 else None
                axis.plot(first.t, plan + sign * rest, color=TUBE, lw=1.0, ls=(0, (5, 2)), label=label)
        for item in campaign.drawn:
            axis.plot(item.runs.t, item.runs.x[0, :, i], **line(item))
        axis.plot(first.t, plan, color="black", lw=1.0, ls="--", label="plan")
        _limit(axis, plan, width, [item.runs.x[0, :, i] for item in campaign.drawn])
        axis.set_ylabel(labelled(setting.spec, name))
    finish(figure, axes[-1], axes[0], campaign)
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


def _inputs(campaign: Campaign) -> Figure:
    """What acts: u = u* + k + u_a, for every loop and input, what u_a should cancel, limits and proven ranges."""
    setting = campaign.setting
    names, loops = setting.spec.inputs, campaign.drawn
    limits = {name: [float(end) for end in ends] for name, ends in setting.spec.limits}
    figure = blank(1.2 + 3.6 * len(loops), 0.9 + 2.2 * len(names))
    axes = figure.subplots(len(names), len(loops), sharex=True, sharey="row", squeeze=False)
    for column, item in enumerate(loops):
        runs = item.runs
        for row, name in enumerate(names):
            axis = axes[row, column]
            axis.plot(runs.t, runs.u[0, :, row], color="black", lw=1.0, label="u = u* + k + u_a")
            axis.plot(runs.t, runs.u_plan[:, row], color="#7F7F7F", ls="--", label="plan u*")
            axis.plot(runs.t, runs.k[0, :, row], color=COLORS["ccm"], label="feedback k")
            axis.plot(runs.t, -runs.h[0, :, row], color=TUBE, lw=2.6, alpha=0.7, label="-h")
            promise = item.loop.promise
            stays = (
                [(own.least, own.greatest) for own in promise.ranges if own.column == row] if promise else []
            )
            ends = [("limits", end) for end in limits.get(name, ())] + [
                ("certified range", e) for two in stays for e in two
            ]
            for label, end in ends:
                style = "-" if label == "limits" else ":"
                axis.axhline(end, color="#7F7F7F", lw=1.0, ls=style, label=label)
            if item.loop.problem.adaptive or item.loop.tested:
                axis.plot(runs.t, runs.u_a[0, :, row], color=COLORS["l1"], lw=1.0, label="adaptive u_a")
            if column == 0:
                axis.set_ylabel(labelled(setting.spec, name))
        axes[0, column].set_title(NAMES[item.loop.controller], fontsize=9, loc="left")
        axes[-1, column].set_xlabel("t [s]")
        axes[-1, column].set_xlim(0, setting.horizon)
    fullest = max(range(len(loops)), key=lambda column: len(axes[0, column].lines))
    handles, labels = axes[0, fullest].get_legend_handles_labels()
    shown = dict(zip(labels, handles, strict=True))  # both ends of a range have one
    figure.legend(shown.values(), shown.keys(), loc="outside lower center", ncols=5)
    return figure


def _tube_use(campaign: Campaign) -> Figure:
    """The distance over time, as a share of the tube; above 1 the tube is left."""
    setting = campaign.setting
    figure = blank(7.0, 3.4)
    axis = figure.subplots()
    most = 1.0
    for item in campaign.drawn:
        share = item.runs.distance[0] / setting.reach
        most = max(most, float(np.nanmax(share)))
        axis.plot(item.runs.t, share, **line(item))
        if item.loop.promise is not None and item.loop.promise.decay is not None:
            bound = item.loop.promise.decay(item.runs.t) / setting.reach
            color = COLORS[item.loop.controller]
            axis.plot(
                item.runs.t,
                bound,
                color=color,
                lw=1.0,
                ls=":",
                label=f"certified D(t), {NAMES[item.loop.controller]}",
            )
    for attack in campaign.attacks:
        if attack.worst is not None:
            share = attack.worst.distance[0] / setting.reach
            label = f"worst adversary, {NAMES[attack.loop.controller]}"
            axis.plot(
                attack.worst.t, share, color=COLORS[attack.loop.controller], lw=1.0, alpha=0.5, label=label
            )
    axis.axhspan(0, 1, color=TUBE, alpha=0.18, lw=0)
    axis.axhline(1, color=TUBE, lw=1.0)
    axis.set_ylim(0, min(1.06 * most, 5.0))
    axis.set_ylabel("d(x*, x) / dbar")
    finish(figure, axis, axis, campaign)
    return figure


def _monte_carlo(campaign: Campaign) -> Figure | None:
    """How the runs of a sample are spread over the tube, over time."""
    attacks = campaign.attacks
    if not attacks:
        return None
    setting = campaign.setting
    figure = blank(7.0, 0.8 + 2.8 * len(attacks))
    axes = figure.subplots(len(attacks), 1, sharex=True, squeeze=False)[:, 0]
    for axis, attack in zip(axes, attacks, strict=True):
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


def _ultimate(campaign: Campaign) -> float | None:
    """The smallest radius in the long run that is certified for a loop that is drawn."""
    found = [item.loop.promise.ultimate for item in campaign.drawn if item.loop.promise is not None]
    return min((value for value in found if value is not None), default=None)

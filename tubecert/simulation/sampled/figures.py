"""A campaign as files: summary, runs, and figures of what runs attained over time, and in the plane. Trusted: no."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulation.figures import COLORS, TUBE, blank, images, labelled, names_of, plane, titled
from tubecert.simulation.folder import npz
from tubecert.simulation.sampled.campaign import Campaign
from tubecert.simulation.sampled.setting import course_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_GROUPS: Final = (("random runs", COLORS["nominal"]), ("adversaries", COLORS["l1"]))
_BOXES: Final = 400  # cross-sections of the tube that are drawn


def files(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    """Beside its summary, figures only of what was not interrupted; the same campaign gives the same bytes."""
    own, names = campaign, np.array(campaign.setting.names)
    more = {"error": own.errors, "profile": own.profile, "aimed": own.aimed, "names": names}
    yield "runs.npz", npz({**own.peaks, **more})
    if campaign.runs == campaign.asked:  # to draw takes longer than who is interrupted has
        yield from images(DRAWERS, campaign)


def _title(campaign: Campaign) -> str:
    return f"{campaign.setting.spec.name}: {campaign.runs} runs of the sampled loop"


def _tube_use(campaign: Campaign) -> Figure:
    """Every state and input over time: bounds, stage by stage, and the largest deviations of all runs."""
    own = campaign.setting
    figure = blank(7.0, 0.9 + 1.5 * len(own.names))
    axes = figure.subplots(len(own.names), 1, sharex=True, squeeze=False)[:, 0]
    each = slice(None, -1, len(own.lengths))  # sample
    t, bounds = own.t[each], own.limits[each].T
    for i, (axis, name) in enumerate(zip(axes, own.names, strict=True)):
        axis.fill_between(t, 0, bounds[i], step="post", color=TUBE, alpha=0.25, lw=0, label="tube")
        for (label, color), profile in zip(_GROUPS, campaign.profile, strict=True):
            axis.plot(t, profile[i] * bounds[i], color=color, lw=1.0, label=label)
        axis.set_ylabel(labelled(own.spec, name, f"|{name} - {name}*|"))
        axis.set_ylim(0, None)
    axes[-1].set_xlabel("t [s]")
    axes[-1].set_xlim(0, t[-1] if len(t) > 1 else None)
    titled(figure, axes[0], _title(campaign), 3)
    return figure


def _plane(campaign: Campaign) -> Figure | None:
    """The plane of two states: plan, tube, obstacles and some runs."""
    own, names = campaign.setting, names_of(campaign.setting.spec)
    if names is None:
        return None
    i, j = (own.spec.states.index(name) for name in names)
    plan, boxes = None, list[Array]()
    if own.spec.trajectory.bundle is None:
        parts, corners = len(own.lengths), np.array([[1.0, 1], [1, -1], [-1, -1], [-1, 1]])
        plan = course_of(own).x[::parts, [i, j], 0]
        shown = np.unique(np.linspace(0, own.samples - 1, _BOXES).astype(int))
        boxes = [plan[k] + corners * own.limits[k * parts, [i, j]] for k in shown]
    figure, axis = plane(own.spec, names, boxes, plan)
    axis.plot(campaign.x[:, i], campaign.x[:, j], color=COLORS["l1"], lw=0.5, alpha=0.5)
    axis.plot([], [], color=COLORS["l1"], lw=0.5, label="some runs")
    axis.autoscale_view()
    titled(figure, axis, _title(campaign), 4)
    return figure


DRAWERS: Final[Mapping[str, Callable[[Campaign], Figure | None]]] = {"tube_use": _tube_use, "plane": _plane}

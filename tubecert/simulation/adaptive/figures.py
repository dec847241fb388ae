"""A campaign as files, the same bytes for the same campaign: runs, summary and figures, which prove nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.simulation.adaptive.campaign import Campaign
from tubecert.simulation.adaptive.loops import Loop, Runs
from tubecert.simulation.adaptive.setting import Setting
from tubecert.simulation.figures import COLORS, TUBE, blank, images, labelled, names_of, plane, titled
from tubecert.simulation.folder import npz

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES: Final = {
    "l1": "L1 adaptive",
    "ccm": "CCM alone",
    "reference": "reference system",
    "nominal": "CCM, no uncertainty",
}
_SHAPES: Final = 400  # cross-sections of the tube that are drawn
_FARTHEST: Final = 5.0  # shares of the tube that are drawn


def files(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    """Beside its summary, figures only of what was not interrupted: to draw takes seconds."""
    yield "runs.npz", npz(dict(_arrays(campaign)))
    if not campaign.interrupted:
        yield from figures(campaign)


def _arrays(campaign: Campaign) -> Iterator[tuple[str, Array]]:
    """Everything that was drawn and sampled, by `<controller>_<what>`; of random runs their peaks, too."""
    for item in campaign.loops:
        yield from _named(item.loop.controller, item.runs)
    for attack in campaign.attacks:
        if attack.adversary is not None:
            yield from _named(f"{attack.random.loop.controller}_adversary", attack.adversary.runs)
        prefix, runs = f"{attack.random.loop.controller}_sample", attack.random.runs
        yield from ((f"{prefix}_{name}", getattr(runs, name)) for name in ("t", "distance", "x", "error"))
        yield f"{prefix}_start", runs.x[:, 0]
        yield from ((f"{prefix}_largest_{name}", peak) for name, peak in runs.found.peak._asdict().items())


def _named(prefix: str, runs: Runs) -> Iterator[tuple[str, Array]]:
    """The first run."""
    yield from ((f"{prefix}_{name}", getattr(runs, name)) for name in ("t", "x_plan", "u_plan"))
    for name in ("x", "u", "k", "u_a", "sigma_hat", "h", "xtilde", "distance"):
        yield f"{prefix}_{name}", getattr(runs, name)[0]


def figures(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    """File names and contents, one figure after the other."""
    return images(DRAWERS, campaign)


def _states(campaign: Campaign) -> Figure:
    """Every state over time, in the tube's half-widths, with the radius that is certified in the long run."""
    setting, first = campaign.setting, campaign.loops[0].runs
    names = setting.spec.states
    figure = blank(7.0, 0.9 + 1.7 * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    promises = [item.loop.promise for item in campaign.loops if item.loop.promise is not None]
    ultimate = min((own.ultimate for own in promises if own.ultimate is not None), default=None)
    plain = np.array_equal(setting.S, np.eye(len(names)))
    for i, (axis, name, width) in enumerate(zip(axes, names, setting.box, strict=True)):
        plan, curves = first.x_plan[:, i], [item.runs.x[0, :, i] for item in campaign.loops]
        axis.fill_between(first.t, plan - width, plan + width, color=TUBE, alpha=0.25, lw=0, label="tube")
        # |x_i - x_i*| <= sup sqrt(W_ii) d, as the half-widths, where they are what bounds the tube
        rest = None if ultimate is None else ultimate if plain else ultimate / setting.rho * width
        if rest is not None and rest < width:
            for sign, label in ((-1, None), (1, "in the long run")):
                axis.plot(first.t, plan + sign * rest, color=TUBE, lw=1.0, ls=(0, (5, 2)), label=label)
        for item, curve in zip(campaign.loops, curves, strict=True):
            _draw(axis, item.loop, item.runs.t, curve)
        axis.plot(first.t, plan, color="black", lw=1.0, ls="--", label="plan")
        axis.set_ylim(*_window(np.array([plan.min() - width, plan.max() + width]), curves, 1.5))
        axis.set_ylabel(labelled(setting.spec, name))
    return _over_time(figure, axes[-1], axes[0], campaign)


def _plane(campaign: Campaign) -> Figure | None:
    """The plane of two states with plan, tube, obstacles and loops."""
    setting = campaign.setting
    names = names_of(setting.spec)
    if names is None:
        return None
    i, j = (setting.spec.states.index(name) for name in names)
    t = np.linspace(0.0, setting.horizon, 2001)
    plan = setting.plan.enclose(t, t)[0].mid[:, [i, j]]
    section = _section(setting, i, j)
    shapes = [section + point for point in plan[:: -(-len(plan) // _SHAPES)]]
    figure, axis = plane(setting.spec, names, shapes, plan)
    for item in campaign.loops:
        _draw(axis, item.loop, item.runs.x[0, :, i], item.runs.x[0, :, j], zorder=4)
    for end, marker in ((0, "o"), (-1, "s")):
        axis.plot(*plan[end], marker=marker, ms=4, color="black", ls="none", zorder=6)
    tube = np.vstack(shapes)
    axis.set_xlim(*_window(tube[:, 0], [item.runs.x[0, :, i] for item in campaign.loops], 0.5))
    axis.set_ylim(*_window(tube[:, 1], [item.runs.x[0, :, j] for item in campaign.loops], 0.5))
    axis.set_aspect("equal")
    titled(figure, axis, _title(campaign), 5)
    return figure


def _inputs(campaign: Campaign) -> Figure:
    """What acts, u = u* + k + u_a, for every input and loop, with limits and proven ranges."""
    setting, first = campaign.setting, campaign.loops[0].runs
    limits = dict(setting.spec.limits)
    figure = blank(7.0, 0.9 + 2.0 * len(setting.spec.inputs))
    axes = figure.subplots(len(setting.spec.inputs), 1, sharex=True, squeeze=False)[:, 0]
    for i, (axis, name) in enumerate(zip(axes, setting.spec.inputs, strict=True)):
        for item in campaign.loops:
            _draw(axis, item.loop, item.runs.t, item.runs.u[0, :, i])
            stays = item.loop.promise.ranges.get(name) if item.loop.promise else None
            for end, label in ((stays.least, "certified range"), (stays.greatest, None)) if stays else ():
                axis.axhline(end, color=TUBE, lw=1.2, ls=":", label=label)
        for limit, label in zip(limits.get(name, ()), ("limits", None), strict=False):
            axis.axhline(float(limit), color="#7F7F7F", lw=1.0, label=label)
        axis.plot(first.t, first.u_plan[:, i], color="black", lw=1.0, ls="--", label="plan")
        axis.set_ylabel(labelled(setting.spec, name))
    return _over_time(figure, axes[-1], axes[0], campaign)


def _tube_use(campaign: Campaign) -> Figure:
    """The distance over time, as a share of the tube; above 1 the tube is left."""
    reach, figure, most = campaign.setting.reach, blank(7.0, 3.4), 1.0
    axis = figure.subplots()
    for item in campaign.loops:
        t, share = item.runs.t, item.runs.distance[0] / reach
        most = max(most, float(np.nanmax(share)))
        _draw(axis, item.loop, t, share)
        if item.loop.promise is not None and item.loop.promise.decay is not None:
            bound = item.loop.promise.decay(t) / reach
            _draw(axis, item.loop, t, bound, "certified D(t), ", lw=1.0, ls=":")
    for worst in (attack.adversary for attack in campaign.attacks if attack.adversary):
        share = worst.runs.distance[0] / reach
        _draw(axis, worst.loop, worst.runs.t, share, "worst adversary, ", lw=1.0, alpha=0.5)
    axis.axhspan(0, 1, color=TUBE, alpha=0.18, lw=0)
    axis.axhline(1, color=TUBE, lw=1.0)
    axis.set_ylim(0, min(1.06 * most, _FARTHEST))
    axis.set_ylabel("d(x*, x) / dbar")
    return _over_time(figure, axis, axis, campaign)


def _monte_carlo(campaign: Campaign) -> Figure | None:
    """How the runs of a sample are spread over the tube, over time."""
    if not campaign.attacks:
        return None
    (attack,), reach, figure = campaign.attacks, campaign.setting.reach, blank(7.0, 3.6)
    loop, runs, worst = attack.random.loop, attack.random.runs, attack.adversary
    axis, share, color = figure.subplots(), runs.distance / reach, COLORS[loop.controller]
    alive = ~np.isnan(share).all(axis=0)
    t, share = runs.t[alive], share[:, alive]
    low, q25, median, q75, high = np.nanquantile(share, [0, 0.25, 0.5, 0.75, 1], axis=0)
    axis.fill_between(t, low, high, color=color, alpha=0.18, lw=0, label=f"{len(share)} random runs")
    axis.fill_between(t, q25, q75, color=color, alpha=0.35, lw=0, label="middle half")
    axis.plot(t, median, color=color, label="median")
    if worst is not None:
        axis.plot(
            worst.runs.t, worst.runs.distance[0] / reach, color="black", lw=1.0, label="worst adversary"
        )
    if loop.promise is not None and loop.promise.decay is not None:
        axis.plot(t, loop.promise.decay(t) / reach, color=TUBE, lw=1.4, ls="--", label="certified D(t)")
    axis.axhline(1, color=TUBE, lw=1.2, label="tube")
    axis.set_ylim(0, min(max(1.08, 1.05 * float(np.nanmax(share))), _FARTHEST))
    axis.set_ylabel("d(x*, x) / dbar")
    return _over_time(figure, axis, axis, campaign, f"random runs of {_NAMES['l1']}, seed {campaign.seed}")


DRAWERS: Final[Mapping[str, Callable[[Campaign], Figure | None]]] = {
    "states": _states,
    "plane": _plane,
    "inputs": _inputs,
    "tube_use": _tube_use,
    "monte_carlo": _monte_carlo,
}


def _draw(axis: Axes, loop: Loop, x: Array, y: Array, about: str = "", **style: Any) -> None:
    """A curve of a loop: dashed for the one that nothing adapts and h acts on."""
    dashes = (0, (6, 1.5)) if loop.controller == "ccm" else "-"
    usual = {"color": COLORS[loop.controller], "ls": dashes, "label": about + _NAMES[loop.controller]}
    axis.plot(x, y, **(usual | style))


def _title(campaign: Campaign, what: str = "") -> str:
    setting = campaign.setting
    about = what or f"uncertainty {campaign.uncertainty}"
    return f"{setting.spec.name}: rho = {near(setting.rho, 4)}, {about}"


def _over_time(figure: Figure, bottom: Axes, top: Axes, campaign: Campaign, what: str = "") -> Figure:
    """Time on the axes at the bottom; the title over those whose labels become the legend."""
    bottom.set_xlabel("t [s]")
    bottom.set_xlim(0, campaign.setting.horizon)
    titled(figure, top, _title(campaign, what), 3)
    return figure


def _window(tube: Array, curves: list[Array], room: float) -> tuple[float, float]:
    """Limits that show the tube (K,) and what stays within some tubes of it; what diverges leaves the picture."""
    low, high = tube.min(), tube.max()
    away = room * (high - low)
    shown = np.concatenate(
        [tube, *(np.clip(own[np.isfinite(own)], low - away, high + away) for own in curves)]
    )
    margin = 0.05 * np.ptp(shown)
    return float(shown.min() - margin), float(shown.max() + margin)


def _section(setting: Setting, i: int, j: int) -> Array:
    """The outline (K, 2) of the tube around a point of the plan, projected to the plane of two states.

    For a constant metric that is the projection of the ellipsoid d < dbar; else that of |S (x - x*)| < rho, a disc
    where z is x, cut to the half-widths.
    """
    angle, W = np.linspace(0.0, 2 * np.pi, 73)[:-1], [e for row in setting.model.W for e in row]
    size, spread = setting.rho, np.asarray(np.linalg.inv(setting.P))
    if all(e.is_constant for e in W):
        size, spread = setting.reach, Tape(W, ()).run_floats([], ()).reshape(spread.shape)
    root, width = np.linalg.cholesky(spread[np.ix_([i, j], [i, j])]), setting.box[[i, j]]
    return np.clip(size * np.stack([np.cos(angle), np.sin(angle)], axis=1) @ root.T, -width, width)

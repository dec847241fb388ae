"""A campaign as files: data (NPZ, CSV), summary (JSON) and figures. The same campaign gives the same bytes."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator

import numpy as np

from tubecert.campaigns.figures import FORMATS
from tubecert.campaigns.folder import npz, written_to
from tubecert.enclosure.interval import Array
from tubecert.simulate.campaign import Attack, Campaign, Drawn
from tubecert.simulate.runs import Runs
from tubecert.simulate.summary import summary


def write(folder: str, campaign: Campaign, *, certificate: str) -> list[str]:
    """Writes every file of a campaign; returns their names. Raises `TargetError`.

    Earlier figures that are not replaced do not stay: to draw takes seconds, which an interruption does not leave.
    """
    from tubecert.simulate.figures import drawers

    names = [f"{name}.{kind}" for name in drawers() for kind in FORMATS]
    return written_to(folder, summary(campaign, certificate).to_json(), _files(campaign), names)


def _files(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    from tubecert.simulate.figures import figures

    yield "runs.npz", npz(_arrays(campaign))
    for item in campaign.drawn:
        yield f"{item.loop.controller}.csv", _table(*_drawn_table(campaign, item))
    for attack in campaign.attacks:
        yield f"monte_carlo_{attack.loop.controller}.csv", _table(*_sample_table(campaign, attack))
    if not campaign.interrupted:
        yield from figures(campaign)


def _arrays(campaign: Campaign) -> dict[str, Array]:
    """Everything that was drawn and sampled, by `<controller>_<what>`."""
    arrays: dict[str, Array] = {}
    for item in campaign.drawn:
        arrays |= _named(item.loop.controller, item.runs)
    for attack in campaign.attacks:
        prefix = attack.loop.controller
        if attack.worst is not None:
            arrays |= _named(f"{prefix}_adversary", attack.worst)
        runs = attack.sample.runs
        arrays |= {
            f"{prefix}_sample_t": runs.t,
            f"{prefix}_sample_distance": runs.distance,
            f"{prefix}_sample_x": runs.x,
            f"{prefix}_sample_error": runs.error,
            f"{prefix}_sample_start": attack.sample.cases.start,
        }
    return arrays


def _named(prefix: str, runs: Runs) -> dict[str, Array]:
    shared = {"t": runs.t, "x_plan": runs.x_plan, "u_plan": runs.u_plan}
    own = ("x", "k", "u_a", "sigma_hat", "h", "xtilde", "distance")
    return {f"{prefix}_{name}": value for name, value in shared.items()} | {
        f"{prefix}_{name}": getattr(runs, name)[0] for name in own
    }


def _drawn_table(campaign: Campaign, item: Drawn) -> tuple[list[str], Array]:
    """One row for each output time."""
    spec, runs = campaign.setting.spec, item.runs
    groups = {
        "": (spec.states, runs.x[0]),
        "plan ": (spec.states, runs.x_plan),
        " ": (spec.inputs, runs.u[0]),
        "plan  ": (spec.inputs, runs.u_plan),
        "k ": (spec.inputs, runs.k[0]),
        "u_a ": (spec.inputs, runs.u_a[0]),
        "h ": (spec.inputs, runs.h[0]),
    }
    header = [
        "t",
        *(f"{prefix.strip()}_{name}".lstrip("_") for prefix, (names, _) in groups.items() for name in names),
    ]
    columns = [runs.t[:, None], *(values for _, values in groups.values()), runs.distance[0][:, None]]
    return [*header, "distance"], np.hstack(columns)


def _sample_table(campaign: Campaign, attack: Attack) -> tuple[list[str], Array]:
    """One row for each run: what it used of the tube, and when."""
    runs, setting = attack.sample.runs, campaign.setting
    worst = runs.worst
    columns = {
        "run": np.arange(runs.lanes),
        "distance_over_dbar": worst.distance.value / setting.reach,
        "t_distance": worst.distance.time,
        "deviation_over_rho": worst.deviation.value / setting.rho,
        "u": worst.u.value,
        "k": worst.k.value,
        "xtilde": worst.xtilde.value,
        "sigma_error": worst.sigma_error.value,
        "h": worst.h.value,
        "error_over_rho": runs.error / setting.rho,
    }
    return list(columns), np.stack(list(columns.values()), axis=1)


def _table(header: list[str], rows: Array) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([_cell(value) for value in row] for row in rows.tolist())
    return text.getvalue().encode()


def _cell(value: float) -> str:
    if not math.isfinite(value):
        return ""
    return f"{value:.0f}" if value == int(value) and abs(value) < 1e15 else f"{value:.9g}"

"""A campaign as files: runs (NPZ), summary (JSON) and figures (PNG). The same campaign gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.enclosure.interval import Array
from tubecert.simulation.adaptive.campaign import Campaign
from tubecert.simulation.adaptive.loops import Runs
from tubecert.simulation.folder import npz, written_to


def write(folder: str, campaign: Campaign, *, certificate: str) -> list[str]:
    """Writes every file of a campaign; returns their names. Raises `TargetError`.

    Earlier figures that are not replaced do not stay: to draw takes seconds, which an interruption does not leave.
    """
    from tubecert.simulation.adaptive.figures import DRAWERS

    data, outdated = campaign.summary(certificate), [f"{name}.png" for name in DRAWERS]
    return written_to(folder, data, _files(campaign), outdated)


def _files(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    from tubecert.simulation.adaptive.figures import figures

    yield "runs.npz", npz(dict(_arrays(campaign)))
    if not campaign.interrupted:
        yield from figures(campaign)


def _arrays(campaign: Campaign) -> Iterator[tuple[str, Array]]:
    """Everything that was drawn and sampled, by `<controller>_<what>`; of random runs their peaks, too."""
    for item in campaign.loops:
        yield from _named(item.loop.controller, item.runs)
    for attack in campaign.attacks:
        if attack.adversary is not None:
            yield from _named(f"{attack.loop.controller}_adversary", attack.adversary.runs)
        prefix, runs = f"{attack.loop.controller}_sample", attack.random.runs
        yield from ((f"{prefix}_{name}", getattr(runs, name)) for name in ("t", "distance", "x", "error"))
        yield f"{prefix}_start", runs.x[:, 0]
        yield from ((f"{prefix}_largest_{name}", peak) for name, peak in runs.found.peak.items())


def _named(prefix: str, runs: Runs) -> Iterator[tuple[str, Array]]:
    """The first run."""
    yield from ((f"{prefix}_{name}", getattr(runs, name)) for name in ("t", "x_plan", "u_plan"))
    for name in ("x", "u", "k", "u_a", "sigma_hat", "h", "xtilde", "distance"):
        yield f"{prefix}_{name}", getattr(runs, name)[0]

"""A campaign as a folder: summary.json, runs.npz, figures. The same campaign gives the same bytes. Trusted: no."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from tubecert.files import replace
from tubecert.simulate.output import unwritable
from tubecert.simulation.campaign import Campaign, summary
from tubecert.simulation.figures import FIGURES, drawn

SUMMARY: Final = "summary.json"


def write(folder: str, campaign: Campaign) -> list[str]:
    """Writes the files of a campaign of one run at least, the summary last; their names. Raises `TargetError`."""
    written = []
    try:
        (Path(folder) / SUMMARY).unlink(missing_ok=True)  # of earlier files, which are now replaced
        for name, data in _files(campaign):
            replace(Path(folder) / name, data)
            written.append(name)
    except OSError as error:
        raise unwritable(folder, error) from None
    return written


def _files(campaign: Campaign) -> Iterator[tuple[str, bytes]]:
    buffer = io.BytesIO()
    kept = {name: campaign.all(name) for name in ("share", "when", "value", "bound", "left", "slack")}
    names = np.array(campaign.setting.names)
    np.savez_compressed(
        buffer, allow_pickle=False, names=names, profile=campaign.profile, aimed=campaign.aimed, **kept
    )
    yield "runs.npz", buffer.getvalue()
    for name in FIGURES:
        figure = drawn(name, campaign)
        if figure is None:
            continue
        for kind in ("png", "svg"):
            image = io.BytesIO()
            dated = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
            figure.savefig(image, format=kind, metadata=dated)
            yield f"{name}.{kind}", image.getvalue()
    text = json.dumps(summary(campaign).to_json(), indent=1, sort_keys=True, allow_nan=False)
    yield SUMMARY, (text + "\n").encode()

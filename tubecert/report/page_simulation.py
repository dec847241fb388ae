"""The figures of a simulation on the page of the certificate that it was compared with. They prove nothing.

In: what a folder of `simulate` holds. Out: blocks. A picture is shown as an image, in which nothing runs.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from tubecert.report.page import Block, Pictures, Words

TITLES: Mapping[str, str] = {
    "states": "States over time",
    "plane": "The plane",
    "inputs": "Inputs over time",
    "tube_use": "How much of the tube the loops use",
    "monte_carlo": "Random runs",
}
_PROVES_NOTHING = (
    "Outcome: {outcome}. A simulation can falsify a certificate; that it did not proves nothing: the loops that are "
    "drawn met the uncertainties that were tried, the certificate is about all of them."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulated:
    """What is shown of a simulation: its outcome, and figures (PNG) by name."""

    outcome: str
    figures: Mapping[str, bytes]


def simulated_blocks(found: Simulated | None) -> Iterator[Block]:
    """What came of it, and the figures; nothing where there was none."""
    if found is None:
        return
    yield Words(text=_PROVES_NOTHING.format(outcome=found.outcome))
    images = ((name, b64encode(data).decode()) for name, data in found.figures.items())
    yield Pictures(pictures={TITLES[name]: f"data:image/png;base64,{image}" for name, image in images})

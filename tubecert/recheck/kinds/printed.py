"""Members that the sections of several kinds have, read."""

from __future__ import annotations

from tubecert.recheck.conditions import Gains
from tubecert.recheck.document import Members, Node
from tubecert.recheck.enclosures import enclosure
from tubecert.recheck.kinds.kind import Shortfall

GAINS = ("bandwidth", "adaptation_rate", "predictor_gain", "projection_radius")


def read_gains(own: Members) -> Gains:
    """The four gains of A and B."""
    return Gains(
        bandwidth=own["bandwidth"].decimal(),
        adaptation_rate=own["adaptation_rate"].decimal(),
        predictor_gain=own["predictor_gain"].decimal(),
        projection_radius=own["projection_radius"].decimal(),
    )


def read_shortfalls(node: Node) -> tuple[Shortfall, ...]:
    """What is missing."""
    parts = (item.closed("condition", "margin") for item in node.entries())
    return tuple(Shortfall(own["condition"].text(), enclosure(own["margin"])) for own in parts)

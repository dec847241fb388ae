"""The loop of adaptation."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.recheck.document import Node
from tubecert.recheck.specified.numbers import positive

LETTERS: Final = {"0": "no_adaptation", "A": "conditions_26", "B": "distance"}
"""The key of every kind of certificate by the letter that a specification names it with, in the order of the table."""

DECIDES: Final = (*LETTERS, "all")


@dataclass(frozen=True, slots=True)
class Loop:
    """The g of the predictor -g I (None: that of each pair), the smooth layer of the projection.

    `decides`: the letter of the kind that the specification wants to decide, None if it does not say.
    """

    predictor_gain: Fraction | None
    smooth: Fraction | None
    decides: str | None


def read_loop(adaptation: Node, conditions: Node) -> Loop:
    """`adaptation` and `conditions`."""
    own, chosen = adaptation.closed("A_m", "projection"), conditions.closed(optional=("decides",))
    projection = own["projection"]
    return Loop(
        predictor_gain=_gain(own["A_m"]),
        smooth=None if projection.value == "hard" else positive(projection.closed("smooth")["smooth"]),
        decides=chosen.get("decides", lambda item: item.word(*DECIDES)),
    )


def _gain(node: Node) -> Fraction | None:
    """The g of A_m = -g I, written as the number -g; None for auto."""
    if node.value == "auto":
        return None
    value = node.exact()
    if value >= 0:
        raise node.refused("must be auto or a negative number")
    return -value

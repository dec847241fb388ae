"""The loop of adaptation."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Final

from tubecert.recheck.document import Node
from tubecert.recheck.specified.numbers import Rows, positive, square

LETTERS: Final = {
    "0": "no_adaptation",
    "A": "conditions_26",
    "B": "distance",
    "C": "sampled",
    "H": "hardware",
}
"""The key of every kind of certificate by the letter that a specification names it with, in the order of the table."""

DECIDES: Final = (*LETTERS, "all")


@dataclass(frozen=True, slots=True)
class Loop:
    """The predictor (None: -g I for the g that each pair states), the smooth layer of the projection, the kernel.

    `decides`: the letter of the kind that the specification wants to decide, None if it does not say.
    """

    A_m: Rows | None
    smooth: Fraction | None
    kernel: str
    decides: str | None


def read_loop(adaptation: Node, conditions: Node, n: int) -> Loop:
    """`adaptation` and `conditions` for n states."""
    own, chosen = adaptation.closed("A_m", "projection"), conditions.closed(optional=("kernel", "decides"))
    A_m, projection = own["A_m"], own["projection"]
    kernel = chosen.get("kernel", lambda item: item.word("tight", "paper"))
    return Loop(
        A_m=None if A_m.value == "auto" else square(A_m, n),
        smooth=None if projection.value == "hard" else positive(projection.closed("smooth")["smooth"]),
        kernel=kernel or "tight",  # the form of the certificate: both kernels are theorems
        decides=chosen.get("decides", lambda item: item.word(*DECIDES)),
    )

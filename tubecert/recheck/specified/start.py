"""The start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node
from tubecert.recheck.specified.numbers import Numbers, Range, not_negative, several, span

_MOST_WIDE = 10  # sides of a box of starts: all its corners are examined


@dataclass(frozen=True, slots=True)
class Start:
    """x(0): a point, anything within a radius of x*(0), or anything in a box."""

    at: Numbers | None
    within: Fraction | None
    box: dict[str, Range] | None


def read_start(node: Node, states: Sequence[str]) -> Start:
    """The start; a claim says it in the same words."""
    own = node.closed(optional=("at", "within", "box"))
    if len(node.mapping()) != 1:
        raise node.refused("must be `at`, `within` or `box`")
    return Start(
        own.get("at", lambda item: several(item, len(states))),
        own.get("within", not_negative),
        own.get("box", lambda item: _start_box(item, states)),
    )


def _start_box(node: Node, states: Sequence[str]) -> dict[str, Range]:
    """A range for every state, which may be a point, but not all of them."""
    own = node.closed(*states)
    box: dict[str, Range] = {}
    for name in states:
        box[name] = span(own[name])
    if not 0 < sum(low < high for low, high in box.values()) <= _MOST_WIDE:
        raise node.refused(f"must have a width in 1 to {_MOST_WIDE} states")
    return box

"""How large a search for a metric is, from its sizes alone, before it begins.

In: a model. Out: counts. Untrusted: it only warns.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from tubecert.expression import free_symbols
from tubecert.model import ControlAffineModel

# the largest that was seen to end has nine states, of which three move; a chain of ten, one that moves
_STATES: Final = 10
_MOVING: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """Slopes depend on `moving` states, in which a box has `vertices`; `entries`: unknown numbers of a constant W."""

    states: int
    entries: int
    moving: int
    vertices: int


def beyond(model: ControlAffineModel) -> Size | None:
    """The size of a search that is out of reach; None if it is not known to be."""
    n = len(model.states)
    if n < _STATES:  # slopes are not asked for in vain
        return None
    moving = len(free_symbols(e for row in (*model.f_x, *model.B) for e in row) & {*model.states})
    if moving < _MOVING:
        return None
    return Size(states=n, entries=n * (n + 1) // 2, moving=moving, vertices=2**moving)

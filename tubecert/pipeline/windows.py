"""How wide the tube is to be in each window: narrower and narrower, until that pays no more."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.search.along import narrowed
from tubecert.spec.windows import windows_of
from tubecert.stages.bounded import Bounded
from tubecert.stages.windows import with_windows

_ROUGH = 0.2  # gap of constants that only radii are chosen by
_ROUNDS = 4
_PAYS = 0.9  # of the widest radius


def windowed(bounded: Bounded) -> Bounded:
    """With the windows of the specification, if it has any: each in a tube about as narrow as what is proven in it."""
    count = len(windows_of(bounded.question.spec)) - 1
    if bounded.machine is None or count < 1:
        return bounded
    radii: Sequence[Fraction] = [bounded.enclosed.tube.rho] * count
    for _ in range(_ROUNDS):
        rough = with_windows(bounded, radii, gap=_ROUGH)
        found = None if rough.machine is None else narrowed(rough.problem, rough.machine)
        if found is None:
            break
        pays, radii = max(found) < _PAYS * max(radii), found
        if not pays:
            break
    return with_windows(bounded, radii)

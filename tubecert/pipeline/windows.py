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
    tried: list[Sequence[Fraction]] = [[bounded.enclosed.tube.rho] * count]
    for _ in range(_ROUNDS):
        found = _narrowed(with_windows(bounded, tried[-1], gap=_ROUGH))
        if found is None:
            break
        tried.append(found)
        if max(found) > _PAYS * max(tried[-2]):
            break
    return _first_that_serves(bounded, tried[::-1])


def _first_that_serves(bounded: Bounded, tried: Sequence[Sequence[Fraction]]) -> Bounded:
    """With the first radii that something is proven in; else with the last."""
    for radii in tried[:-1]:
        closely = with_windows(bounded, radii)
        if _narrowed(closely) is not None:
            return closely
    return with_windows(bounded, tried[-1])


def _narrowed(bounded: Bounded) -> list[Fraction] | None:
    return None if bounded.machine is None else narrowed(bounded.problem, bounded.machine)

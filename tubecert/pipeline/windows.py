"""How wide the tube is to be in each window: narrower and narrower, until that pays no more."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.conditions.problem import Formulas
from tubecert.conditions.proposal import Asked
from tubecert.kinds import DISTANCE, SAMPLED
from tubecert.search.along import narrowed
from tubecert.search.stretches import gains_found, radii_for, serve_still
from tubecert.spec.windows import windows_of
from tubecert.stages.bounded import Bounded
from tubecert.stages.judged import deciding
from tubecert.stages.windows import with_parts, with_windows

_ROUGH = 0.2  # gap of constants that only radii are chosen by
_ROUNDS = 4
_PAYS = 0.9  # of the widest radius


def _of_machine(bounded: Bounded, count: int) -> Bounded:
    """The windows of certificate H, each in a tube about as narrow as what is proven in it."""
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


def _of_gains(bounded: Bounded, asked: Asked, count: int) -> Bounded:
    """The windows of certificates B and C.

    Their gains are about the tube that was asked for, so constants are close from the start: in the narrower tubes the
    same gains serve.
    """
    widest = with_parts(bounded, [bounded.enclosed.tube.rho] * count)
    gains = gains_found(widest.problem, asked)
    if not gains:
        return widest
    narrow = with_parts(bounded, radii_for(widest.problem, gains))
    return narrow if serve_still(narrow.problem, gains) else widest


def windowed(bounded: Bounded, asked: Asked) -> Bounded:
    """With the windows of the specification, if it has any: those of H, and those of B and C.

    Beside a machine B and C have them only where they decide.
    """
    count = len(windows_of(bounded.question.spec)) - 1
    if count < 1:
        return bounded
    if bounded.machine is not None:
        bounded = _of_machine(bounded, count)
    return _of_gains(bounded, asked, count) if _has_parts(bounded) else bounded


def _has_parts(bounded: Bounded) -> bool:
    if bounded.problem.formulas is Formulas.AS_PRINTED or bounded.problem.gain is not None:
        return False
    decides = {DISTANCE.key, SAMPLED.key} & set(deciding(bounded.question))
    return bounded.machine is None or bool(decides)

"""The table of kinds: what every room iterates that computes with them."""

from __future__ import annotations

from typing import Any, Final

from tubecert.conditions.problem import TubeProblem
from tubecert.kinds import HARDWARE, name_of
from tubecert.kinds.alone import Alone
from tubecert.kinds.distance import Distance
from tubecert.kinds.hardware import Hardware
from tubecert.kinds.kind import Kind
from tubecert.kinds.rates import Rates
from tubecert.kinds.sampled import Sampled

AnyKind = Kind[Any]

KINDS: Final[tuple[AnyKind, ...]] = (Alone(), Rates(), Distance(), Sampled(), Hardware())


def kind_of(word: str) -> AnyKind:
    """The kind with this key, option or letter; `KeyError` if there is none."""
    name = name_of(word)
    return next(kind for kind in KINDS if kind.name == name)


def kinds_of(problem: TubeProblem) -> tuple[AnyKind, ...]:
    """The kinds that say anything of a problem."""
    return tuple(kind for kind in KINDS if kind.applies(problem))


def needed_by_all(problem: TubeProblem) -> frozenset[str]:
    """The constants without which no kind with adaptation can say anything, by field name.

    Where nothing is said yet of a machine, an uncertain B leaves no kind: then it is about certificate H all the same.
    """
    adaptive = [kind for kind in kinds_of(problem) if kind.name.adapts] or [kind_of(HARDWARE.letter)]
    return frozenset.intersection(*(kind.theorem.needs(problem) for kind in adaptive))

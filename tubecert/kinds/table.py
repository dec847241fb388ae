"""The table of kinds: what every room iterates that computes with them."""

from __future__ import annotations

from typing import Any, Final

from tubecert.conditions.problem import TubeProblem
from tubecert.kinds import alone, distance, name_of, rates
from tubecert.kinds.kind import Kind

AnyKind = Kind[Any]

KINDS: Final[tuple[AnyKind, ...]] = (alone.KIND, rates.KIND, distance.KIND)


def kind_of(word: str) -> AnyKind:
    """The kind with this key, option or letter; `KeyError` if there is none."""
    name = name_of(word)
    return next(kind for kind in KINDS if kind.name == name)


def needed_by_all(problem: TubeProblem) -> frozenset[str]:
    """The constants without which no kind with adaptation can say anything, by field name."""
    return frozenset.intersection(*(kind.theorem.needs(problem) for kind in KINDS if kind.name.adapts))

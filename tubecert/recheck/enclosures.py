"""An interval as a certificate writes it."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.document import Node


@dataclass(frozen=True, slots=True)
class Enclosure:
    """[below, above]; None where there is no bound."""

    below: Fraction | None
    above: Fraction | None

    @property
    def is_interval(self) -> bool:
        """Whether its ends, as far as there are any, are in order."""
        return self.below is None or self.above is None or self.below <= self.above


def maybe(node: Node) -> Fraction | None:
    """A number, or null."""
    return None if node.value is None else node.number()


def enclosure(node: Node) -> Enclosure:
    """[below, above]; either may be null."""
    low, high = node.pair()
    return Enclosure(maybe(low), maybe(high))

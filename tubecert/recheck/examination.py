"""A statement of a certificate with everything that it depends on, and how it is examined.

Equal keys mean equal outcomes: a memory of outcomes may be shared between certificates that differ in a field or two.
"""

from __future__ import annotations

import json
from collections.abc import Callable, MutableMapping
from dataclasses import dataclass, field

from flint import ctx

from tubecert.recheck.cover import Outcome

BOXES = 64  # bits, for boxes
SHARP = 160  # bits, for formulas at decimals

Memory = MutableMapping[str, Outcome]


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the certificate, what it depends on (None: it is examined each time), and how to examine it."""

    name: str
    key: tuple[object, ...] | None
    examine: Callable[[], Outcome] = field(repr=False)
    bits: int = BOXES

    def outcome(self, memory: Memory | None = None) -> Outcome:
        """The outcome; what arithmetic cannot represent is undecided."""
        if memory is None or self.key is None:
            return self._examined()
        name = json.dumps([self.name, self.key], default=str, sort_keys=True)
        if name not in memory:
            memory[name] = self._examined()
        return memory[name]

    def _examined(self) -> Outcome:
        with ctx.workprec(self.bits):
            try:
                return self.examine()
            except (ArithmeticError, ValueError) as error:
                return Outcome(verdict="undecided", why=f"it cannot be evaluated: {error}")

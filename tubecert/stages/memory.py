"""What was proven before: claims that do not depend on a changed key are not proven again.

A proof is found again under everything that it follows from, so that it cannot be taken for another one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from tubecert.certificate.file import digest
from tubecert.metric.verify import Proofs
from tubecert.records import Json

T = TypeVar("T")


@dataclass(slots=True)
class Memory:
    """Values by what was computed and from what; `computed` counts what was not found, by name.

    With `most`, so many are kept: those that were computed last. `proofs` of metrics are kept for whoever asks.
    """

    kept: dict[tuple[str, str], Any] = field(default_factory=dict)
    computed: dict[str, int] = field(default_factory=dict)
    most: int | None = None
    proofs: Proofs = field(default_factory=Proofs)

    def recall(self, name: str, depends_on: Json, compute: Callable[[], T]) -> T:
        """The value that `compute` gives, which depends on `depends_on` (JSON data) and nothing else."""
        key = name, digest(depends_on)
        if key not in self.kept:
            self.kept[key] = compute()
            self.computed[name] = self.computed.get(name, 0) + 1
            if self.most is not None and len(self.kept) > self.most:
                del self.kept[next(key for key in self.kept)]
        value: T = self.kept[key]
        return value

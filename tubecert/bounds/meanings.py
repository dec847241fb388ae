"""What every constant of a certificate is, by its name there."""

from __future__ import annotations

from tubecert.bounds.constants import DERIVED, TABLE, WIND, Meaning

EVERY: dict[str, Meaning] = {**TABLE, **WIND, **DERIVED}


def meaning(name: str) -> Meaning:
    """The same whatever the name."""
    return EVERY.get(name, Meaning(symbol=name, equation="", unit="", words=name.replace("_", " ")))

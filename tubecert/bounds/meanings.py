"""What every constant of a certificate is, by its name there."""

from __future__ import annotations

from tubecert.bounds.constants import DERIVED, TABLE, WIND, Meaning
from tubecert.bounds.machines import COVARIANT, HARDWARE

EVERY: dict[str, Meaning] = {**TABLE, **WIND, **HARDWARE, **COVARIANT, **DERIVED}

"""The table of kinds: what the rest of recheck iterates."""

from __future__ import annotations

from typing import Any, Final

from tubecert.recheck.kinds.alone import Alone
from tubecert.recheck.kinds.distance import Distance
from tubecert.recheck.kinds.kind import Kind
from tubecert.recheck.kinds.rates import Rates

KINDS: Final[tuple[Kind[Any, Any], ...]] = (Alone(), Rates(), Distance())
KEYS: Final = tuple(kind.key for kind in KINDS)
CONDITIONS: Final = tuple(condition for kind in KINDS for condition in kind.conditions)

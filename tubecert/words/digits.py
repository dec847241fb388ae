"""Six digits, rounded so that what is said stays true."""

from __future__ import annotations

import math


def floor_text(value: float) -> str:
    """Six digits, rounded down."""
    digits = 6
    step = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1) if value else 1.0
    return f"{math.floor(value / step) * step:.{digits}g}"


def ceiling_text(value: float) -> str:
    """Six digits, rounded up."""
    return floor_text(-value).lstrip("-")

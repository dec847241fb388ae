"""Whether the processor computes as every enclosure assumes: IEEE 754, to nearest, with subnormal numbers.

In: nothing. Out: nothing, or `ProcessorError`. A library that was linked with `-ffast-math` makes the thread that loads
it flush subnormal numbers to 0, and other code may leave a direction of rounding behind. Then a step outward is none,
and nothing is proven.
"""

from __future__ import annotations

import sys
from typing import Final

from tubecert.errors import ProcessorError

_SMALLEST: Final = sys.float_info.min
_ONE: Final = 1.0
_STEP: Final = sys.float_info.epsilon


def require_ieee() -> None:
    """Raises `ProcessorError` if subnormal numbers are flushed to 0, or rounding is not to nearest."""
    gradual = _SMALLEST / 2 > 0 and _SMALLEST / 2 * 2 == _SMALLEST
    not_up = _STEP / 4 + _ONE == _ONE and -_STEP / 4 - _ONE == -_ONE
    not_down = 3 * _STEP / 4 + _ONE == _ONE + _STEP
    if not (gradual and not_up and not_down):
        raise ProcessorError

"""Units behind numbers: what to write in place of them. No number has a unit; times are in seconds, sample rates in Hz.

In: a number and the word behind it, as written. Out: a sentence. Trusted: yes, but nothing is computed with it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Final

HAS_NONE: Final = "a number has no unit"

_TIMES: Final[Mapping[str, str]] = {"s": "1", "ms": "0.001", "us": "0.000001", "min": "60", "h": "3600"}
_RATES: Final[Mapping[str, str]] = {"Hz": "1", "kHz": "1000"}
_OTHERS: Final = "m mm cm km N Nm kN kg g V mV A mA W kW J Pa bar K C F rpm percent sec seconds hz"
_PARTS: Final[Mapping[str, tuple[str, str]]] = {
    "mm": ("0.001", "m"),
    "cm": ("0.01", "m"),
    "km": ("1000", "m"),
    "kN": ("1000", "N"),
    "mV": ("0.001", "V"),
    "mA": ("0.001", "A"),
    "kW": ("1000", "W"),
}
_BANDWIDTH: Final = " (of a bandwidth, in rad/s: 2*pi times that, as one number)"
UNITS: Final = frozenset((*_TIMES, *_RATES, *_OTHERS.split()))


def instead_of(number: str, unit: str) -> str:
    """What to write for a number with a unit behind it, which may be the name of something as well."""
    word = unit.partition("/")[0].partition("*")[0].partition("^")[0].strip()
    named = f"; if {word} is a name of yours: {number}*{word}"
    rest = unit[len(word) :]
    if word in _PARTS and re.fullmatch(r"(/s(\^2|\*\*2)?)?", rest):
        factor, base = _PARTS[word]
        value = _times(number, factor)
        return f"{number} {unit} is {value} {base}{rest}: write {value} if the other numbers are in {base}{rest}{named}"
    second = {"sec": "s", "seconds": "s", "hz": "Hz"}.get(unit, unit)
    for known, what in ((_TIMES, "times are in seconds"), (_RATES, f"sample rates are in Hz{_BANDWIDTH}")):
        if second in known:
            return f"write {_times(number, known[second])}: {what}{named}"
    return f"write {number}, in the units of the other numbers{named}"


def _times(number: str, factor: str) -> str:
    """A decimal times another one, as it is written if that is 1."""
    return number if factor == "1" else f"{(Decimal(number) * Decimal(factor)).normalize():f}"

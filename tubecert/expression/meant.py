"""What is meant by a word that is not known, or by a unit behind a number: what to write in its place.

A word may be a typing error of a known one, but never of one that means something else: z is not meant by dz. Words
that mean something in other formats and languages are tables of `pages/instead.toml`; none is taken for a typing error.
No number has a unit; times are in seconds, sample rates in Hz.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Mapping
from decimal import Decimal
from difflib import get_close_matches
from functools import cache
from importlib import resources
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
_CUTOFF = 0.6  # of difflib's ratio
_LONGEST = 60


def near(name: str, known: Collection[str]) -> list[str]:
    """The known word that is closest to `name`, if one is close, and `name` is not its derivative."""
    others = [word for word in known if name not in rates_of(word)]
    lower = {word.lower(): word for word in sorted(others, reverse=True)}
    return [lower[word] for word in get_close_matches(name.lower()[:_LONGEST], lower, n=1, cutoff=_CUTOFF)]


def mistyped(name: str, known: Collection[str]) -> list[str]:
    """The name in an expression that `name` is a typing error of, if it is plain which.

    What adds to a name means something else (vx, x0, x_ref beside x), and so does what lacks an index of it.
    """
    return near(name, [word for word in known if not _is_other(name.lower(), word.lower())])


def suggestion(name: str, known: Collection[str], *, what: str = "known names") -> str:
    """A did-you-mean, and the list of what is known."""
    words = sorted(set(known))
    shown = ", ".join(words[:20]) + (", ..." if len(words) > 20 else "")
    meant = "".join(f"did you mean {word}? " for word in near(name, words))
    return f"{meant}{what}: {shown}"


def rates_of(name: str) -> tuple[str, ...]:
    """What people call the derivative of `name` by the time."""
    before = (f"{prefix}{name}" for prefix in ("d", "d_", "dot", "dot_"))
    after = (f"{name}{suffix}" for suffix in ("dot", "_dot", "Dot"))
    return (*before, *after, f"d{name}_dt", f"d{name}dt")


def _is_other(name: str, word: str) -> bool:
    """Whether one is the other and something more that is not a letter typed twice, a plural or a line."""
    short, long = sorted((name, word), key=len)
    if short == long or short not in (long[: len(short)], long[-len(short) :]):
        return False
    if name == short and len(name) > 1 and long.startswith(short):
        return re.search(r"[\d_]", long[len(short) :]) is not None  # else its end is missing
    more = long.removeprefix(short) if long.startswith(short) else long.removesuffix(short)
    return not set(more) <= {"_", short[0], short[-1]} and more != "s"


@cache
def elsewhere(table: str) -> Mapping[str, str]:
    """What stands for a word, or is said of it, by the words of a table."""
    text = (resources.files("tubecert") / "pages" / "instead.toml").read_text(encoding="utf-8")
    return {word: said for words, said in tomllib.loads(text)[table].items() for word in words.split()}


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

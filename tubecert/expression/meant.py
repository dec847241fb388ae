"""Which known word an unknown one is a typing error of. Never a word that means something else: z is not meant by dz.

In: a word and the known ones. Out: a did-you-mean for a message, or nothing.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from difflib import get_close_matches

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

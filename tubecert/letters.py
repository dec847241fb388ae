"""What the kinds of certificates are called, everywhere: in commands, specifications, certificates and reports.

In: a word. Out: a `Name`. Trusted: yes; it decides nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True, kw_only=True)
class Name:
    """How a kind is called: its section in a certificate, its option in commands, its letter and title in reports.

    `adapts`: whether it is about the adaptive loop; `ALL` asks for those that are.
    """

    key: str
    option: str
    letter: str
    title: str
    adapts: bool = True

    def __str__(self) -> str:
        return f"{self.letter} {self.title}"


ALONE: Final = Name(key="no_adaptation", option="none", letter="0", title="no adaptation", adapts=False)
RATES: Final = Name(key="conditions_26", option="26", letter="A", title="paper's conditions")
DISTANCE: Final = Name(key="distance", option="distance", letter="B", title="distance")

NAMES: Final = (ALONE, RATES, DISTANCE)
ADAPTIVE: Final = tuple(name for name in NAMES if name.adapts)
ALL: Final = "all"


def name_of(word: str) -> Name:
    """The kind with this key, option or letter; `KeyError` if there is none."""
    for name in NAMES:
        if word in (name.key, name.option, name.letter):
            return name
    raise KeyError(word)


def words_of(names: tuple[Name, ...] = NAMES) -> tuple[str, ...]:
    """What a user may write for each: first its word, then its letter."""
    return (*(name.option for name in names), *(name.letter for name in names))

"""Kinds of certificates: what each one is called, needs, decides and writes. One table that every room iterates.

In: a problem and a proposal. Out: a section of the certificate. Trusted: yes: a section is written from the kernel's
judgement. A new kind is a theorem in `conditions` (listed in `kernel`), a search in `search` (listed there), its file
here (listed in `table`, named below) and its file in `recheck`.

| letter | module | theorem |
|---|---|---|
| A | `rates` | (26a)-(26c) of the paper, corrected |
| B | `distance` | the Riemannian distance bounded directly |
| C | `sampled` | the same with piecewise-constant adaptation |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["DISTANCE", "NAMES", "RATES", "SAMPLED", "Name", "name_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Name:
    """How a kind is called: its section in a certificate, its option in commands, its letter and title in reports."""

    key: str
    option: str
    letter: str
    title: str

    def __str__(self) -> str:
        return f"{self.letter} {self.title}"


RATES: Final = Name(key="conditions_26", option="26", letter="A", title="(26)")
DISTANCE: Final = Name(key="distance", option="distance", letter="B", title="distance")
SAMPLED: Final = Name(key="sampled", option="sampled", letter="C", title="sampled")

NAMES: Final = (RATES, DISTANCE, SAMPLED)


def name_of(word: str) -> Name:
    """The kind with this key, option or letter; `KeyError` if there is none."""
    for name in NAMES:
        if word in (name.key, name.option, name.letter):
            return name
    raise KeyError(word)

"""The words of C: names, numbers, strings and signs, each with its line; comments and blanks are gone."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

Kind = Literal["name", "number", "string", "sign", "end"]

_KINDS: tuple[Kind, ...] = ("name", "number", "string", "sign")
_WORD = re.compile(
    r"""(?P<blank>\s+|/\*.*?\*/)
    |(?P<name>[A-Za-z_][A-Za-z_0-9]*)
    |(?P<number>(?:\d+\.\d+(?:e[+-]?\d+)?|\d+e[+-]?\d+|\d+)f?)
    |(?P<string>"[^"\\\n]*")
    |(?P<sign>->|\+\+|\+=|&&|\|\||<=|>=|==|[-+*/<>=!?:;,&(){}\[\]])""",
    re.VERBOSE | re.DOTALL,
)


class UnreadError(ValueError):
    """A text that is not of the grammar, or does what has no bound here; says where and what."""


@dataclass(frozen=True, slots=True)
class Word:
    """A word of a text."""

    kind: Kind
    text: str
    line: int


def words(text: str) -> list[Word]:
    """The words of a text without lines of the preprocessor; the last one is its end."""
    return [*_words(text), Word("end", "", text.count("\n") + 1)]


def _words(text: str) -> Iterator[Word]:
    place, line = 0, 1
    while place < len(text):
        found = _WORD.match(text, place)
        if found is None:
            raise UnreadError(f"line {line}: {text[place : place + 20]!r} is no word that is known")
        own = found.group()
        kind = next((kind for kind in _KINDS if found[kind] is not None), None)
        if kind is not None:
            yield Word(kind, own, line)
        line += own.count("\n")
        place = found.end()

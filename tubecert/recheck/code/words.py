"""The words of C: names, numbers, strings and signs, each with its line; comments and blanks are gone.

A compiler has to see the same words: lines that go on in the next one, trigraphs, comments that hide lines of the
preprocessor, numbers to the base 8, and `--`, which is no double minus, are refused.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Literal

_HIDING = ("\\", "??")
_LONGEST = 10  # digits
Kind = Literal["name", "number", "string", "sign", "end"]

_KINDS: tuple[Kind, ...] = ("name", "number", "string", "sign")
_WORD = re.compile(
    r"""(?P<blank>\s+|/\*.*?\*/)
    |(?P<name>[A-Za-z_][A-Za-z_0-9]*)
    |(?P<number>(?:[0-9]+\.[0-9]+(?:e[+-]?[0-9]+)?|[0-9]+e[+-]?[0-9]+|[0-9]+)f?)
    |(?P<string>"[^"\\\n]*")
    |(?P<sign>->|--|\+\+|\+=|&&|\|\||<=|>=|==|[-+*/<>=!?:;,&(){}\[\]])""",
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


def words(text: str, gone: Collection[int] = ()) -> list[Word]:
    """The words of a text without lines of the preprocessor, which are `gone`; the last word is its end."""
    for sign in _HIDING:
        if sign in text:
            raise UnreadError(f"{sign!r} may join two lines or stand for another sign")
    return [*_words(text, gone), Word("end", "", text.count("\n") + 1)]


def _words(text: str, gone: Collection[int]) -> Iterator[Word]:
    place, line = 0, 1
    while place < len(text):
        found = _WORD.match(text, place)
        if found is None:
            raise UnreadError(f"line {line}: {text[place : place + 20]!r} is no word that is known")
        own = found.group()
        kind = next((kind for kind in _KINDS if found[kind] is not None), None)
        if kind == "number" and not _is_plain(own):
            raise UnreadError(f"line {line}: {own[:20]} may be another number in C")
        if kind is not None:
            yield Word(kind, own, line)
        last = line + own.count("\n")
        if own.startswith("/*") and any(line < each <= last for each in gone):
            raise UnreadError(f"line {line}: a comment holds lines of the preprocessor")
        line = last
        place = found.end()


def _is_plain(number: str) -> bool:
    """Not to the base 8, and a whole number of at most 31 bits."""
    octal = len(number) > 1 and number[0] == "0" and number[1].isdigit()
    return not octal and not (number.isdigit() and (len(number) > _LONGEST or int(number) >= 2**31))

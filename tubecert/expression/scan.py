"""The linear look at an expression's text before anything parses it.

It bounds length, nesting and numbers, knows every name, and finds what people write by mistake (`^`, `2x`,
`0x10`, a pasted minus sign), so that Python's own parser afterwards meets only short, shallow, well-formed
text.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from tubecert.expression.graph import FUNCTIONS as SMOOTH
from tubecert.expression.meant import HAS_NONE, UNITS, elsewhere, instead_of, mistyped

MAX_LENGTH: Final = 4_000
MAX_DEPTH: Final = 50
MAX_SIGNS: Final = 50
MAX_NUMBER_LENGTH: Final = 40
MAX_NUMBER_EXPONENT: Final = 300

ARITIES: Final[Mapping[str, int | None]] = {
    **dict.fromkeys(SMOOTH, 1),
    "abs": 1,
    "norm": None,
}
FUNCTIONS: Final = tuple(ARITIES)
KINKED: Final = frozenset({"abs", "norm"})
MAX_NAME_LENGTH: Final = 40
# What a name would hide: the grammar's own words, and Python's, whose parser sees the text.
RESERVED: Final = frozenset({"pi", *FUNCTIONS, *keyword.kwlist})
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")

Kind = Literal["syntax", "symbol", "limit", "value"]


class ExpressionError(ValueError):
    """What is wrong with an expression, `offset` characters into its text, and what to write instead."""

    def __init__(
        self, message: str, *, help: str = "", offset: int = 0, width: int = 1, kind: Kind = "syntax"
    ) -> None:
        super().__init__(message)
        self.message, self.help, self.offset, self.width, self.kind = message, help, offset, width, kind


@dataclass(frozen=True, slots=True, kw_only=True)
class Vocabulary:
    """The names an expression may use; `refused` says of other known names why they are not allowed here."""

    symbols: Collection[str]
    tables: Collection[str] = ()
    kinks: bool = False
    refused: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Token:
    kind: Literal["number", "name", "operator"]
    text: str
    offset: int

    def error(self, message: str, help: str = "", kind: Kind = "syntax") -> ExpressionError:
        return ExpressionError(message, help=help, offset=self.offset, width=len(self.text), kind=kind)


_TOKEN = re.compile(
    r"(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<operator>\*\*|[-+*/(),])"
)
_EQUATION = re.compile(r"[:=!<>]?=")
_IN_TIME = re.compile(r"\b([A-Za-z_]\w*)(\s*\(\s*t\s*(?:([-+])[^()]*)?\))", re.ASCII)
_LOOKALIKES = {
    "\u2212": "-", "\u2010": "-", "\u2011": "-", "\u2012": "-", "\u2013": "-", "\u2014": "-", "\ufe63": "-",
    "\uff0d": "-", "\u00d7": "*", "\u00b7": "*", "\u22c5": "*", "\u2217": "*", "\u2219": "*", "\u2022": "*",
    "\u00f7": "/", "\u2215": "/", "\u2044": "/", "\u00b2": "**2", "\u00b3": "**3", "\u2074": "**4",
    "\u221a": "sqrt(...)", "\u03c0": "pi", "\u00a0": "a space",
    "\u202f": "a space", "\u2009": "a space", "\uff08": "(", "\uff09": ")", "\uff0c": ",",
    **dict.fromkeys("\u2018\u2019\u201c\u201d\u201e", "straight quotes around an expression, and none in it"),
    "\u00b0": "30 deg in values and sets, 30*pi/180 in expressions",
}  # fmt: skip


def is_name(word: str) -> bool:
    """Whether a variable may have this name: it could not be told from the grammar's own words otherwise."""
    return len(word) <= MAX_NAME_LENGTH and bool(_NAME.fullmatch(word)) and word not in RESERVED


def normalise_spaces(text: str) -> str:
    """Line breaks and tabs as spaces, so that a text may span lines; offsets stay."""
    return text.translate({ord(c): " " for c in "\t\n\r\f\v"})


def scan(text: str, vocabulary: Vocabulary) -> None:
    """Raises `ExpressionError` unless `text` is a bounded sequence of known words in a sensible order."""
    if len(text) > MAX_LENGTH:
        raise ExpressionError(
            f"the expression has {len(text)} characters; at most {MAX_LENGTH} are read",
            help="split it, or use shorter names",
            kind="limit",
        )
    if not text.strip():
        raise ExpressionError("the expression is empty", help="write 0 if zero is meant")
    if found := _EQUATION.search(text):  # before its left side is taken for an unknown name
        raise _foreign(text, found.start())
    for found in _IN_TIME.finditer(text):
        if found[1] in vocabulary.symbols:
            raise _in_time(found)
    walk = _Walk(vocabulary)
    for token in _tokens(text):
        walk.step(token)
    walk.finish(text)


def _in_time(found: re.Match[str]) -> ExpressionError:
    """The error for x(t), or x at another time."""
    token = _Token("operator", found[2], found.start(2))
    if found[3] is None:
        return token.error(f"{found[1]} is its value at the time t already", f"write {found[1]}")
    return token.error(
        f"{found[0][:40]} reads as {found[1]} at another time, which expressions do not know",
        "a delay of sensors and computer is hardware: {delay: 0.1}, in s; one in the plant takes states of its own; "
        f"for a product write {found[1]}*(...)",
    )


def _tokens(text: str) -> Iterator[_Token]:
    position = 0
    while position < len(text):
        if text[position] == " ":
            position += 1
        elif match := _TOKEN.match(text, position):
            yield _token(text, match)
            position = match.end()
        else:
            raise _foreign(text, position)


def _token(text: str, match: re.Match[str]) -> _Token:
    word = match.group()
    if match.lastgroup == "operator":
        if word == "/" and text.startswith("//", match.start()):
            raise _foreign(text, match.start())
        return _Token("operator", word, match.start())
    if match.lastgroup == "name":
        return _Token("name", word, match.start())
    token = _Token("number", word, match.start())
    _check_number(token)
    tail = re.compile(r"[A-Za-z0-9_.]*").match(text, match.end())
    if tail and tail.group():
        raise _glued(token, tail.group())
    return token


def _check_number(token: _Token) -> None:
    digits, _, exponent = token.text.lower().partition("e")
    if len(token.text) > MAX_NUMBER_LENGTH:
        raise token.error(
            f"the number has {len(token.text)} characters; at most {MAX_NUMBER_LENGTH} are read", kind="limit"
        )
    if exponent and abs(int(exponent)) > MAX_NUMBER_EXPONENT:
        raise token.error(
            f"the exponent of {token.text} is beyond {MAX_NUMBER_EXPONENT}",
            "choose units in which the numbers are moderate",
            "limit",
        )
    if digits.isdigit() and len(digits) > 1 and digits[0] == "0":
        raise token.error(f"{token.text} has leading zeros", f"write {token.text.lstrip('0') or '0'}")


def _glued(token: _Token, tail: str) -> ExpressionError:
    """The error for a number that runs into something."""
    whole = _Token("number", token.text + tail, token.offset)
    if token.text == "0" and tail[0] in "xXoObB":
        return whole.error(f"{whole.text} is not a decimal number", "write numbers in decimal")
    if tail[0] == "_" and tail[1:2].isdigit():
        return whole.error("numbers have no separators", f"write {whole.text.replace('_', '')}")
    if tail in ("j", "J"):
        return whole.error("there are no imaginary numbers")
    if tail in ("e", "E"):
        return whole.error(
            f"the exponent of {whole.text} is missing", f"write {token.text}e0 or {token.text}*e"
        )
    if tail[0] == "." or tail[0].isdigit():
        return whole.error(f"{whole.text} is not a number", "write one decimal point")
    if tail in UNITS:
        return whole.error(HAS_NONE, instead_of(token.text, tail))
    return whole.error(f"{whole.text} lacks a multiplication sign", f"write {token.text}*{tail}")


def _foreign(text: str, position: int) -> ExpressionError:
    """The error for a character that is no part of the grammar."""
    for width in (2, 1):
        if advice := elsewhere("signs").get(text[position : position + width]):
            return ExpressionError(
                f"{text[position : position + width]} is not allowed in an expression",
                help=advice,
                offset=position,
                width=width,
            )
    if text[position] == ".":
        return ExpressionError(
            "there are no attributes", help="write plain names and decimal numbers", offset=position
        )
    character = text[position]
    shown = character if character.isprintable() else f"U+{ord(character):04X}"
    if instead := _LOOKALIKES.get(character):
        return ExpressionError(f"{shown} is not ASCII", help=f"write {instead}", offset=position)
    return ExpressionError(
        f"{shown} is not ASCII" if ord(character) > 126 else f"{shown} is not allowed",
        help="names are made of ASCII letters, digits and _ (spell Greek letters out: omega, theta)",
        offset=position,
    )


class _Walk:
    """Whether an operand or an operator is due, and which parentheses are open."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self.open: list[tuple[_Token, bool]] = []  # opening parenthesis, whether it belongs to a call
        self.last: _Token | None = None
        self.signs = 0

    @property
    def operand_due(self) -> bool:
        return self.last is None or (self.last.kind == "operator" and self.last.text != ")")

    @property
    def _is_function(self) -> bool:
        """Whether the last word is one that parentheses must follow."""
        name = self.last.text if self.last is not None and self.last.kind == "name" else ""
        return name in FUNCTIONS or name in self.vocabulary.tables

    def step(self, token: _Token) -> None:
        """Takes one token."""
        called = self._is_function
        if called and token.text != "(":
            raise self._uncalled(token)
        if token.kind == "name":
            self._known(token)
        if token.kind != "operator" or token.text == "(":
            self._operand(token, called)
        else:
            self._operator(token)
        self.last = token

    def finish(self, text: str) -> None:
        """Nothing may be left open at the end."""
        if self._is_function:
            raise self._uncalled()
        if self.last and self.operand_due:
            raise ExpressionError("the expression ends where a value is expected", offset=len(text.rstrip()))
        if self.open:
            raise self.open[-1][0].error("this parenthesis is never closed", f"close it; {_QUOTE}")

    def _operand(self, token: _Token, called: bool) -> None:
        if token.text == "(":
            if not called and not self.operand_due:
                raise self._juxtaposed(token)
            self.open.append((token, called))
            if len(self.open) > MAX_DEPTH:
                raise token.error(f"parentheses are nested more than {MAX_DEPTH} deep", kind="limit")
        elif not self.operand_due:
            raise self._juxtaposed(token)
        self.signs = 0

    def _operator(self, token: _Token) -> None:
        if self.operand_due:
            self._sign(token)
        else:
            self.signs = 0
        if token.text == ")":
            if not self.open:
                raise token.error("this parenthesis was never opened", f"remove it, or open one; {_QUOTE}")
            self.open.pop()
        elif token.text == "," and not (self.open and self.open[-1][1]):
            raise token.error(
                "an entry is one expression",
                "a comma separates the arguments of a function only; decimals have a point, and every expression "
                "has quotes of its own",
            )

    def _sign(self, token: _Token) -> None:
        if token.text not in "+-":
            if token.text == ")" and self.last and self.last.text == "(":
                called = self.open[-1][1]
                raise token.error(
                    "an argument is missing" if called else "there is nothing in the parentheses"
                )
            raise token.error(f"a value is missing before {token.text}")
        self.signs += 1
        if self.signs > MAX_SIGNS:
            raise token.error(f"more than {MAX_SIGNS} signs in a row", "write at most one sign", "limit")

    def _known(self, token: _Token) -> None:
        name, words = token.text, self.vocabulary
        if name in KINKED and not words.kinks:
            raise token.error(
                f"{name} is only allowed in h",
                "elsewhere expressions must be differentiable. v*abs(v) is, exactly for v in [-9, 9], as drag(v) with "
                "tables: {drag: {points: [[-9, -81, 18], [0, 0, 0], [9, 81, 18]], interpolation: slopes}} in system; "
                "so is abs(v)**3, by [-9, 729, -243], [0, 0, 0], [9, 729, 243]. sqrt(x**2 + c) with c > 0 may serve",
            )
        if name in words.symbols or name in words.tables or name in FUNCTIONS or name == "pi":
            return
        if name in words.refused:
            raise token.error(words.refused[name], kind="symbol")
        if name in _ANGLES:
            raise token.error(f"{name} is no name", _ANGLES[name])
        raise token.error(f"unknown symbol {name[:40]}", self._help(name), "symbol")

    def _help(self, name: str) -> str:
        """What was meant, if that is plain; a function only for its own letters in another order or case."""
        words = self.vocabulary
        if said := elsewhere("functions").get(name):
            return said
        functions = [*(f for f in FUNCTIONS if words.kinks or f not in KINKED), *sorted(words.tables)]
        meant = [f for f in functions if sorted(f) == sorted(name.lower())] or mistyped(
            name, [*words.symbols, *words.tables, "pi"]
        )
        listed = sorted({*words.symbols, "pi"})
        shown = ", ".join(listed[:20]) + (", ..." if len(listed) > 20 else "")
        return (
            "".join(f"did you mean {word}? " for word in meant)
            + f"names: {shown}; functions: {' '.join(functions)}; a constant of your own goes into system.parameters"
        )

    def _uncalled(self, due: _Token | None = None) -> ExpressionError:
        assert self.last is not None
        name = self.last.text
        power = "; its square is {name}(...)**2" if due is not None and due.text == "**" else ""
        return self.last.error(
            f"{name} needs an argument in parentheses", f"write {name}(...){power.format(name=name)}"
        )

    def _juxtaposed(self, token: _Token) -> ExpressionError:
        assert self.last is not None
        left = self.last.text if self.last.text != ")" else "(...)"
        right = token.text if token.text != "(" else "(...)"
        if self.last.kind == "number" and token.text in UNITS:
            return token.error(HAS_NONE, instead_of(left, right))
        if self.last.kind == "name" and token.text == "(":
            message = f"{left} is not a function; for a product a sign is missing"
        else:
            message = "a multiplication sign or another operator is missing"
        return token.error(message, f"write {left}*{right}")


_ANGLES = {
    "deg": "values and sets may be written as 30 deg; in an expression write 30*pi/180",
    **dict.fromkeys(("degree", "degrees"), "write 30 deg in values and sets, 30*pi/180 in expressions"),
    **dict.fromkeys(("rad", "radian", "radians"), "angles are in radians: leave the unit out"),
}
_QUOTE = "text with commas inside [ ] or { } must stand in quotes in YAML"

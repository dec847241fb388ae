"""The grammar of expressions, read by this room itself: text -> term, and what must hold for it to be defined.

Nothing of the producer's parser or graph is used: a text that both understand differently cannot pass both. What an
operation owes is recorded before anything is simplified: 0/x is 0, and yet x must not be.
"""

from __future__ import annotations

import keyword
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from tubecert.recheck.lookup import Table
from tubecert.recheck.terms import NOUGHT, UNIT, Term, looked_up, number, number_of, operation

PI = operation("pi")

MOST_CHARACTERS = 40_000
_DEEPEST = 60  # parentheses and exponents: each takes a few frames of the stack
_DIGITS = 400  # characters of one number
_EXPONENT = 300  # of one number
_POWER = 12  # of one **
_POWERS = 144  # of nested ones, multiplied
_BITS = 5_000  # of a constant

_SMOOTH = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt")
_KINKS = ("abs", "norm")
_TOKEN = re.compile(
    r" *(?:(?P<number>(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)|(?P<sign>\*\*|[-+*/(),]))"
)
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,39}")
_TAKEN = {"t", "pi", *_SMOOTH, *_KINKS, *keyword.kwlist, *(word.lower() for word in keyword.kwlist)}


class GrammarError(ValueError):
    """A text that is no expression of the grammar."""


@dataclass(frozen=True, slots=True)
class Owed:
    """What must hold for an operation to be defined (and C1): `argument` is `nonzero`, or `positive`."""

    kind: str
    argument: Term
    text: str


def is_name(name: str) -> bool:
    """Whether a state, an input or a parameter may have this name: it must not mean anything else in the grammar."""
    return _NAME.fullmatch(name) is not None and name not in _TAKEN


def read(
    text: str, symbols: Mapping[str, Term], *, tables: Mapping[str, Table] | None = None, kinks: bool = False
) -> tuple[Term, list[Owed]]:
    """The term that a text stands for, and what it owes; raises `GrammarError`."""
    if len(text) > MOST_CHARACTERS:
        raise GrammarError(f"it is longer than {MOST_CHARACTERS} characters")
    reading = _Reading(text, symbols, tables or {}, kinks=kinks)
    value = reading.sum()
    if reading.kind:
        raise GrammarError(f"{reading.word[:40]!r} was not expected")
    return value.term, reading.owed


def read_number(text: str) -> Fraction:
    """The rational that a text of numbers stands for; raises `GrammarError`."""
    term, _ = read(text, {})
    if term.op != "const":
        raise GrammarError("it is no rational number")
    return number_of(term)


@dataclass(frozen=True, slots=True)
class _Value:
    """A term, and the product of the exponents above its leaves."""

    term: Term
    growth: int = 1


class _Reading:
    """One pass over the tokens; each method takes what its rule of the grammar covers."""

    def __init__(
        self, text: str, symbols: Mapping[str, Term], tables: Mapping[str, Table], *, kinks: bool
    ) -> None:
        self._text, self._symbols, self._tables, self._kinks = text.rstrip(" "), symbols, tables, kinks
        self._at = self._end = self._depth = 0
        self.owed: list[Owed] = []
        self.kind: str | None = None
        self.word = ""
        self._next()

    def _next(self) -> None:
        self._at = self._end
        if self._end == len(self._text):
            self.kind, self.word = None, ""
            return
        found = _TOKEN.match(self._text, self._end)
        if found is None:
            raise GrammarError(f"{self._text[self._end : self._end + 20]!r} is not part of the grammar")
        self.kind, self._end = found.lastgroup, found.end()
        self.word = found[str(found.lastgroup)]

    def _takes(self, *signs: str) -> str | None:
        """The sign that is next, if it is one of these; it is taken."""
        if self.kind != "sign" or self.word not in signs:
            return None
        sign = self.word
        self._next()
        return sign

    def _must(self, sign: str) -> None:
        if not self._takes(sign):
            raise GrammarError(f"{sign!r} was expected before {self.word[:20]!r}")

    def sum(self) -> _Value:
        """product (+|- product)*"""
        value = self._product()
        while sign := self._takes("+", "-"):
            other = self._product()
            term = value.term + other.term if sign == "+" else value.term - other.term
            value = _bounded(term, max(value.growth, other.growth))
        return value

    def _product(self) -> _Value:
        """factor (*|/ factor)*"""
        begin = self._at
        value = self._factor()
        while sign := self._takes("*", "/"):
            other = self._factor()
            if sign == "/":
                self._owe("nonzero", other.term, begin)
            term = value.term * other.term if sign == "*" else value.term / other.term
            value = _bounded(term, max(value.growth, other.growth))
        return value

    def _factor(self) -> _Value:
        """(+|-)* power: a sign binds less than **"""
        minus = 0
        while sign := self._takes("+", "-"):
            minus += sign == "-"
        value = self._power()
        return _Value(-value.term, value.growth) if minus % 2 else value

    def _power(self) -> _Value:
        """atom, or atom ** factor with a factor that is a whole number"""
        begin = self._at
        base = self._atom()
        if not self._takes("**"):
            return base
        exponent = self._inside(self._factor).term
        if exponent.op != "const" or number_of(exponent).denominator != 1:
            raise GrammarError("an exponent is not a whole number")
        n = int(number_of(exponent))
        growth = base.growth * max(1, abs(n))
        if abs(n) > _POWER or growth > _POWERS or _bits(base.term) * abs(n) > _BITS:
            raise GrammarError("a power is too high")
        if n < 0:
            self._owe("nonzero", base.term, begin)
        return _bounded(base.term.raised(n), growth)

    def _atom(self) -> _Value:
        """A number, a name, a call, or a sum in parentheses"""
        kind, word, begin = self.kind, self.word, self._at
        if self._takes("("):
            value = self._inside(self.sum)
            self._must(")")
            return value
        if kind in (None, "sign"):
            raise GrammarError(f"a value was expected before {word[:20]!r}")
        self._next()
        if kind == "number":
            return _bounded(number(_decimal(word)), 1)
        if word in _SMOOTH or word in _KINKS or word in self._tables:
            self._must("(")
            args = [self._inside(self.sum)]
            while self._takes(","):
                args.append(self._inside(self.sum))
            self._must(")")
            return self._call(word, args, begin)
        if word == "pi":
            return _Value(PI)
        if word not in self._symbols:
            raise GrammarError(f"{word[:40]!r} is not known")
        return _Value(self._symbols[word])

    def _inside(self, rule: Callable[[], _Value]) -> _Value:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise GrammarError(f"parentheses or exponents are nested more than {_DEEPEST} deep")
        value = rule()
        self._depth -= 1
        return value

    def _call(self, name: str, values: list[_Value], begin: int) -> _Value:
        args = [value.term for value in values]
        growth = max(value.growth for value in values)
        if name != "norm" and len(args) != 1:
            raise GrammarError(f"{name} takes one argument")
        if name in self._tables:
            return _Value(self._looked_up(self._tables[name], args[0], begin), growth)
        if name in _KINKS:
            if not self._kinks:
                raise GrammarError(f"{name} is allowed in h only")
            return _Value(operation("norm", *args), growth)
        if name == "tan":
            self._owe("nonzero", operation("cos", args[0]), begin)
        if name in ("sqrt", "log"):
            self._owe("positive", args[0], begin)
        if name in ("asin", "acos"):
            self._owe("positive", UNIT - args[0].raised(2), begin)
        return _Value(operation(name, *args), growth)

    def _looked_up(self, table: Table, x: Term, begin: int) -> Term:
        first, last = table.ends
        self._owe("positive", x - number(first), begin)
        self._owe("positive", number(last) - x, begin)
        return looked_up(table, x)

    def _owe(self, kind: str, argument: Term, begin: int) -> None:
        if argument.op == "const":
            value = number_of(argument)
            if value == 0 or (kind == "positive" and value < 0):
                raise GrammarError(f"{self._text[begin : self._at].strip()[:60]!r} is not defined")
            return
        self.owed.append(Owed(kind, argument, self._text[begin : self._at].strip()[:200]))


def _decimal(word: str) -> Fraction:
    """A decimal, exactly."""
    _, _, exponent = word.lower().partition("e")
    if len(word) > _DIGITS or (exponent and abs(int(exponent)) > _EXPONENT):
        raise GrammarError("a number is too long, too large or too small")
    return Fraction(word)


def _bounded(term: Term, growth: int) -> _Value:
    if _bits(term) > _BITS:
        raise GrammarError("a constant is too long")
    return _Value(term, growth)


def _bits(term: Term) -> int:
    q = number_of(term) if term.op == "const" else NOUGHT.value
    assert isinstance(q, Fraction)
    return max(q.numerator.bit_length(), q.denominator.bit_length())


LONGEST = 40  # characters of a number
_PLAIN_DIGITS = 25  # longer ones have an exponent
_ZEROS = 4  # so many at least are worth one


def spelled(q: Fraction) -> str:
    """The text that stands for q; a reader of it needs no rule of arithmetic."""
    sign, size = "-" if q < 0 else "", abs(q)
    short = _short_decimal(size)
    return sign + (short if short is not None and len(short) <= LONGEST else str(size))


def _short_decimal(q: Fraction) -> str | None:
    """The decimal, if it is finite."""
    below = q.denominator
    places = next((k for k in range(below.bit_length() + 1) if 10**k % below == 0), None)
    if places is None:
        return None
    digits = str(q.numerator * 10**places // below)
    if places > _PLAIN_DIGITS:
        return f"{digits}e-{places}"
    if places:
        digits = digits.zfill(places + 1)
        return f"{digits[:-places]}.{digits[-places:]}"
    short = digits.rstrip("0")
    zeros = len(digits) - len(short)
    return f"{short}e{zeros}" if len(digits) > _PLAIN_DIGITS and zeros >= _ZEROS else digits

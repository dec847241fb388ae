"""Expressions of C99, in float or in double."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction

from tubecert.export.listing import decimal
from tubecert.export.program import GREATEST, LEAST, RATIO, TABLE


def last_not_after(begins: str, count: int, value: str) -> Iterator[str]:
    """Statements that leave in `low` the last of `count` numbers that a value is not below, by so many halvings."""
    yield f"    for (k = 0; k < {max(1, (count - 1).bit_length())}; k++) {{"
    yield "        const int middle = (low + high + 1) / 2;"
    yield "        if (low < high) {"
    yield f"            if ({value} >= {begins}[middle]) {{"
    yield "                low = middle;"
    yield "            } else {"
    yield "                high = middle - 1;"
    yield "            }"
    yield "        }"
    yield "    }"


@dataclass(frozen=True, slots=True)
class C:
    """Expressions of C99, in `float` or in `double`."""

    single: bool

    @property
    def real(self) -> str:
        """The type."""
        return "float" if self.single else "double"

    def number(self, value: Fraction) -> str:
        """A constant."""
        text = decimal(value, single=self.single)
        if not self.single:
            return text
        return f"{text[:-1]}f)" if text.endswith(")") else f"{text}f"

    def entry(self, name: str, index: int) -> str:
        """An entry of a vector that goes in."""
        return f"{name}[{index}]"

    def call(self, name: str, argument: str) -> str:
        """A function."""
        if name.startswith(TABLE):
            return f"{name}({argument})"
        return f"{name}{'f' if self.single else ''}({argument})"

    def choice(self, name: str, a: str, b: str) -> str:
        """A choice between two."""
        if name == LEAST:
            return f"{a} < {b} ? {a} : {b}"
        if name == GREATEST:
            return f"{a} > {b} ? {a} : {b}"
        zero, one = self.number(Fraction(0)), self.number(Fraction(1))
        if name == RATIO:
            return f"({a} > {zero} && {b} > {zero}) ? {a} / {b} : {zero}"
        return f"{a} > {b} ? {b} / {a} : {one}"


def comment(texts: Sequence[str]) -> Iterator[str]:
    """A comment of several lines."""
    yield f"/* {texts[0]}"
    for text in texts[1:]:
        yield f" * {text}".rstrip()
    yield " */"

"""The pages of `explain`: words of reports, finding codes, constants and equations, with meaning and source.

What a code or an equation means is data of this package (`tubecert/pages/*.toml`); names, symbols and units of the
constants come from the table that reports read.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

_WIDTH = 96


@dataclass(frozen=True, slots=True, kw_only=True)
class CodePage:
    """A finding code: what it means, and an example with its remedy."""

    code: str
    title: str
    meaning: str
    wrong: str = ""
    right: str = ""
    command: str = "check"

    def text(self) -> str:
        """The page."""
        parts = [f"{self.code}: {self.title}", _filled(self.meaning)]
        parts += [
            f"{name}:\n{_indented(text)}"
            for name, text in (("Wrong", self.wrong), ("Right", self.right))
            if text
        ]
        return "\n\n".join([*parts, f"Source: {self.command}, finding code {self.code}"])


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationPage:
    """An equation: what it says, its formula, and where it is proven."""

    tag: str
    title: str
    formula: str
    meaning: str
    source: str

    def text(self) -> str:
        """The page."""
        parts = [f"{self.tag}: {self.title}", _indented(self.formula), _filled(self.meaning)]
        return "\n\n".join([*parts, f"Source: {self.source}"])


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantPage:
    """A constant of the certificates."""

    name: str
    symbol: str
    words: str
    unit: str
    equation: str
    formula: str
    meaning: str

    def text(self) -> str:
        """The page."""
        parts = [
            f"{self.name} ({self.symbol}): {self.words}",
            _indented(self.formula),
            _filled(self.meaning),
            f"Unit: {self.unit} (x: state, u: input, d: Riemannian distance)",
            f"In a certificate: result.constants.{self.name}, as [proven below, proven above]",
            f"Source: {self.equation}; docs/theory, docs/equations.md",
        ]
        return "\n\n".join(parts)


@dataclass(frozen=True, slots=True, kw_only=True)
class WordPage:
    """A word of the reports: what it means, its unit if it is a number, other spellings, where to read on."""

    word: str
    title: str
    meaning: str
    see: str
    unit: str = ""
    also: tuple[str, ...] = ()

    def text(self) -> str:
        """The page."""
        parts = [f"{self.word}: {self.title}", _filled(self.meaning)]
        return "\n\n".join([*parts, *([f"Unit: {self.unit}"] if self.unit else []), f"Source: {self.see}"])


Page = CodePage | EquationPage | ConstantPage | WordPage


def _data(name: str) -> Mapping[str, Any]:
    return tomllib.loads((resources.files("tubecert") / "pages" / f"{name}.toml").read_text(encoding="utf-8"))


@cache
def codes() -> Mapping[str, CodePage]:
    """The pages of the finding codes."""
    return {code: CodePage(code=code, **page) for code, page in _data("codes").items()}


@cache
def equations() -> Mapping[str, EquationPage]:
    """The pages of the equations, by their tags."""
    return {tag: EquationPage(tag=tag, **page) for tag, page in _data("equations").items()}


@cache
def constants() -> Mapping[str, ConstantPage]:
    """The pages of the constants, by their names in a certificate."""
    from tubecert.bounds.constants import EVERY

    data = _data("constants")
    return {
        name: ConstantPage(
            name=name,
            symbol=meaning.symbol,
            words=meaning.words,
            unit=meaning.unit,
            equation=meaning.equation,
            **data[name],
        )
        for name, meaning in EVERY.items()
    }


@cache
def words() -> Mapping[str, WordPage]:
    """The pages of the words of reports."""
    return {
        word: WordPage(word=word, also=tuple(page.pop("also", ())), **page)
        for word, page in _data("words").items()
    }


def _spelled() -> Mapping[str, WordPage]:
    return {also: page for page in words().values() for also in page.also}


def find(topic: str) -> Page | None:
    """The page of a word, a code, an equation's tag, or a constant; case matters only where it has to."""
    wanted = " ".join(topic.split())
    if wanted in words():  # A and B are certificates before they are constants
        return words()[wanted]
    wanted = wanted[1:-1] if wanted.startswith("(") else wanted
    wanted = re.sub(r"^(fills|input) \S+$", r"\1", wanted)  # rows about a state or an input
    wanted = re.sub(r"^C([123])$", r"CCM_\1", wanted, flags=re.IGNORECASE)  # as reports call them
    tables: tuple[Mapping[str, Page], ...] = (codes(), constants(), equations())
    symbols: Mapping[str, Page] = {page.symbol: page for page in constants().values()}
    searched = (*tables, symbols, words(), _spelled())
    for table in searched:
        if wanted in table:
            return table[wanted]
    for spelled in (wanted, wanted.replace(" ", "_")):  # `speed on plan`, as sentences have it
        for table in searched:
            folded = [page for key, page in table.items() if key.lower() == spelled.lower()]
            if len(folded) == 1:
                return folded[0]
    return None


def topics() -> list[str]:
    """Everything that has a page."""
    symbols = (page.symbol for page in constants().values())
    return [*words(), *_spelled(), *codes(), *constants(), *symbols, *equations()]


def _filled(text: str) -> str:
    import textwrap

    paragraphs = text.strip().split("\n\n")
    return "\n\n".join(textwrap.fill(" ".join(paragraph.split()), _WIDTH) for paragraph in paragraphs)


def _indented(text: str) -> str:
    return "\n".join(f"    {line}".rstrip() for line in text.strip("\n").splitlines())

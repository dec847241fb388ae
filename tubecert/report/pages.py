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
class Page:
    """What is explained: a word of reports, a finding code, an equation or a constant; `kind` says which.

    `formula`, `wrong` and `right` are shown as they are; `also` are other spellings, `see` is where to read on.
    """

    kind: str
    name: str
    title: str
    meaning: str
    see: str
    symbol: str = ""
    formula: str = ""
    wrong: str = ""
    right: str = ""
    unit: str = ""
    stands: str = ""
    also: tuple[str, ...] = ()

    def text(self) -> str:
        """The page."""
        parts = [
            f"{self.name} ({self.symbol}): {self.title}" if self.symbol else f"{self.name}: {self.title}"
        ]
        parts += [_indented(self.formula), _filled(self.meaning)]
        parts += [f"{name}:\n{_indented(text)}" for name, text in self.examples if text]
        parts += [f"Unit: {self.unit}" if self.unit else "", self.stands, f"Source: {self.see}"]
        return "\n\n".join(filter(None, parts))

    @property
    def examples(self) -> tuple[tuple[str, str], ...]:
        """What is refused, and what is not."""
        return ("Wrong", self.wrong), ("Right", self.right)


def _data(name: str) -> Mapping[str, dict[str, Any]]:
    return tomllib.loads((resources.files("tubecert") / "pages" / f"{name}.toml").read_text(encoding="utf-8"))


@cache
def codes() -> Mapping[str, Page]:
    """The pages of the finding codes."""
    return {
        code: Page(kind="code", name=code, see=f"{own.pop('command', 'check')}, finding code {code}", **own)
        for code, own in _data("codes").items()
    }


@cache
def equations() -> Mapping[str, Page]:
    """The pages of the equations, by their tags."""
    pages = _data("equations").items()
    return {tag: Page(kind="equation", name=tag, see=own.pop("source"), **own) for tag, own in pages}


@cache
def constants() -> Mapping[str, Page]:
    """The pages of the constants, by their names in a certificate."""
    from tubecert.bounds.constants import EVERY

    data = _data("constants")
    return {
        name: Page(
            kind="constant",
            name=name,
            symbol=own.symbol,
            title=own.words,
            unit=f"{own.unit} (x: state, u: input, d: Riemannian distance)",
            stands=f"In a certificate: result.constants.{name}, as [proven below, proven above]",
            see=f"{own.equation}; docs/theory/index.md, docs/equations.md",
            **data[name],
        )
        for name, own in EVERY.items()
    }


@cache
def words() -> Mapping[str, Page]:
    """The pages of the words of reports."""
    pages = _data("words").items()
    return {word: Page(kind="word", name=word, also=tuple(own.pop("also", ())), **own) for word, own in pages}


def _spelled() -> Mapping[str, Page]:
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

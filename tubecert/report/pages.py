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
    """What is explained: a word, a code, an equation or a constant. `kind` says which; `also`: other spellings.

    `shown` is what stands before the meaning, as it is (a formula); `examples` and `after` follow it.
    """

    kind: str
    name: str
    title: str
    meaning: str
    source: str
    symbol: str = ""
    shown: str = ""
    examples: tuple[tuple[str, str], ...] = ()
    after: tuple[str, ...] = ()
    also: tuple[str, ...] = ()

    def text(self) -> str:
        """The page."""
        head = f"{self.name} ({self.symbol}): " if self.symbol else f"{self.name}: "
        shown = [_indented(self.shown)] if self.shown else []
        examples = (f"{name}:\n{_indented(text)}" for name, text in self.examples)
        parts = [f"{head}{self.title}", *shown, _filled(self.meaning), *examples, *self.after]
        return "\n\n".join([*parts, f"Source: {self.source}"])


def _data(name: str) -> Mapping[str, Any]:
    return tomllib.loads((resources.files("tubecert") / "pages" / f"{name}.toml").read_text(encoding="utf-8"))


@cache
def codes() -> Mapping[str, Page]:
    """The pages of the finding codes, with what is wrong and right in an example."""
    return {code: _of_code(code, **page) for code, page in _data("codes").items()}


def _of_code(
    code: str, *, title: str, meaning: str, wrong: str = "", right: str = "", command: str = "check"
) -> Page:
    return Page(
        kind="code",
        name=code,
        title=title,
        meaning=meaning,
        examples=tuple(each for each in (("Wrong", wrong), ("Right", right)) if each[1]),
        source=f"{command}, finding code {code}",
    )


@cache
def equations() -> Mapping[str, Page]:
    """The pages of the equations, by their tags."""
    pages = _data("equations").items()
    return {tag: Page(kind="equation", name=tag, shown=page.pop("formula"), **page) for tag, page in pages}


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
            shown=data[name]["formula"],
            meaning=data[name]["meaning"],
            after=(
                f"Unit: {own.unit} (x: state, u: input, d: Riemannian distance)",
                f"In a certificate: result.constants.{name}, as [proven below, proven above]",
            ),
            source=f"{own.equation}; docs/theory.md, docs/equations.md",
        )
        for name, own in EVERY.items()
    }


@cache
def words() -> Mapping[str, Page]:
    """The pages of the words of reports."""
    return {word: _of_word(word, **page) for word, page in _data("words").items()}


def _of_word(
    word: str, *, title: str, meaning: str, see: str, unit: str = "", also: tuple[str, ...] = ()
) -> Page:
    after = (f"Unit: {unit}",) if unit else ()
    return Page(
        kind="word", name=word, title=title, meaning=meaning, source=see, after=after, also=tuple(also)
    )


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

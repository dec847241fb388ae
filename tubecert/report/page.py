"""A page as data: sections of blocks, with nothing of HTML or Markdown in it.

A function `page_of` fills it from what a command found; `text`, `html`, `markdown` and `notebook` show it.
Every text is plain text: who shows it escapes it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Final, Literal

from tubecert.verdict import Verdict

if TYPE_CHECKING:  # who shows a page need not draw
    from tubecert.report.figures_axes import Chart

Kind = Literal["text", "number", "code", "verdict"]
_KINDS: Final[Mapping[str, Kind]] = {">": "number", "!": "verdict"}
_ALIKE: Final[Mapping[Verdict, Sequence[str]]] = {
    Verdict.CERTIFIED: ("confirmed", "metric proven", "not falsified"),
    Verdict.REFUTED: ("contradicted", "falsified", "tube left", "error"),
    Verdict.UNDECIDED: ("no result", "interrupted", "warning"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A value; `note` is a second, smaller line, `share` in [0, 1] the length of a bar beside it."""

    text: str
    kind: Kind = "text"
    note: str = ""
    share: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Words:
    """A paragraph."""

    block: ClassVar[str] = "words"
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Items:
    """A list, with or without a title."""

    block: ClassVar[str] = "items"
    title: str = ""
    items: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Names and values; a first screen that is full leaves those out whose names are `spare`, the first one first."""

    block: ClassVar[str] = "facts"
    facts: tuple[tuple[str, Cell], ...]
    spare: tuple[str, ...] = ()

    @classmethod
    def of(cls, rows: Iterable[tuple[str, str]], spare: tuple[str, ...] = ()) -> Facts:
        """Plain texts by their names."""
        return cls(facts=tuple((name, Cell(text=told)) for name, told in rows), spare=spare)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table; every row has as many cells as there are columns. `left` rows more are not shown."""

    block: ClassVar[str] = "table"
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    left: int = 0

    def __post_init__(self) -> None:
        if any(len(row) != len(self.columns) for row in self.rows):
            raise ValueError("a row of a table has another number of cells than the table has columns")

    @classmethod
    def of(cls, columns: Sequence[str], rows: Iterable[Sequence[str]], note: str = "") -> Table:
        """Plain texts; a column named >... holds numbers, one named !... verdicts."""
        kinds: list[Kind] = [_KINDS.get(column[:1], "text") for column in columns]
        cells = (
            tuple(Cell(text=text, kind=kind) for text, kind in zip(row, kinds, strict=True)) for row in rows
        )
        return cls(columns=tuple(column.lstrip(">!") for column in columns), rows=tuple(cells), note=note)


@dataclass(frozen=True, slots=True, kw_only=True)
class Listing:
    """Preformatted text: equations, commands."""

    block: ClassVar[str] = "listing"
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Figures side by side where there is room."""

    block: ClassVar[str] = "figures"
    figures: tuple[Chart, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pictures:
    """Images that were drawn elsewhere, as data URIs, by what they show."""

    block: ClassVar[str] = "pictures"
    pictures: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reason:
    """Why a claim holds or not; `at` is the witness, `relax` what would help."""

    block: ClassVar[str] = "reason"
    verdict: str
    claim: str
    message: str
    at: str = ""
    relax: str = ""


Block = Words | Items | Facts | Table | Listing | Figures | Pictures | Reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A titled part of the page; `key` is its anchor."""

    key: str
    title: str
    blocks: tuple[Block, ...]

    @classmethod
    def each(cls, parts: Iterable[tuple[str, str, Iterable[Block]]]) -> Iterator[Section]:
        """Those of the parts, by key and title, that have blocks."""
        for key, title, made in parts:
            if blocks := tuple(made):
                yield cls(key=key, title=title, blocks=blocks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """The whole page: the verdict, what it means, the numbers it is about, and everything one may ask next.

    A screen shows the first section, led by the `claim`, or by the `summary` where there is none. `caveat` is what a
    reader must know who has the page and not the certificate.
    """

    name: str
    verdict: str  # empty where the page is about several
    summary: str
    sections: tuple[Section, ...]
    meaning: str = ""
    about: str = "certificate"
    claim: str = ""
    caveat: str = ""

    @property
    def figures(self) -> tuple[Chart, ...]:
        """Every figure of it."""
        blocks = (block for section in self.sections for block in section.blocks)
        return tuple(each for block in blocks if isinstance(block, Figures) for each in block.figures)


def look(verdict: str) -> str:
    """Which of certified, refuted and undecided a word looks like; another word has no look."""
    return next((own for own, words in _ALIKE.items() if verdict in words), verdict)


def typeset(text: str) -> str:
    """Words with their inequalities as one sign."""
    return text.replace("<=", "≤").replace(">=", "≥").replace("+-", "±")

"""A page on a terminal: what it claims, the first section on one screen, where files are; with more asked for, all.

A first screen has at most 15 lines, files and next commands among them, at whatever width: facts that matter less,
then the last rows of tables, are left to `-v`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

from rich.console import Group
from rich.padding import Padding
from rich.table import Table as Grid
from rich.text import Text

from tubecert.report.page import Block, Cell, Facts, Items, Listing, Page, Reason, Table, Words, look
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions, RenderableType, RenderResult

_MOST: Final = 15  # lines of a first screen
_FEWEST: Final = 2  # rows of a table that is cut
_LABELS: Final = 12  # characters of the names before values
_WIDEST: Final = 24  # of them, where they are no texts
_FEW, _MANY = 5, 8  # columns of a table whose heads have room, and of one that has little
_COLORS: Final[Mapping[str, str]] = {
    Verdict.CERTIFIED: "green",
    Verdict.REFUTED: "red",
    Verdict.UNDECIDED: "yellow",
}
_ASCII: Final = str.maketrans(
    {"ω": "omega", "Γ": "Gamma", "ρ": "rho", "λ": "lambda", "±": "+-", "≤": "<=", "≥": ">=", "…": "..."}
)
Rows = Sequence[tuple[str, str]]


def headline(page: Page) -> Text:
    """The verdict, what it is about, and the numbers or the reason that go with it: one line."""
    led = _led(page, page.summary)
    led.no_wrap, led.overflow = True, "ignore"
    return led


def screen(page: Page, closing: Rows, *, verbose: bool) -> list[RenderableType]:
    """The page; `closing` are files and commands, which are neither wrapped nor cut."""
    if not verbose:
        return [_First(page, closing)]
    parts = list(_opening(page, page.sections[0].blocks))
    for section in page.sections[1:]:
        if body := list(_shown(section.blocks)):
            parts += [Text(), Text(section.title, style="bold"), *map(_indented, body)]
    return [*parts, Text(), *_closing(closing)]


@dataclass(frozen=True, slots=True)
class _First:
    """A first screen, made to fit when the width is known."""

    page: Page
    closing: Rows

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        blocks: Sequence[Block] | None = self.page.sections[0].blocks
        while blocks is not None:
            shown = Group(*_opening(self.page, blocks))
            lines = len(console.render_lines(shown, options, pad=False))
            width = _labels(blocks)
            blocks = _fewer(blocks) if lines + len(self.closing) > _MOST else None
        yield shown
        yield from _closing(self.closing, width)


def _fewer(blocks: Sequence[Block]) -> Sequence[Block] | None:
    """The blocks without a note, else the fact that matters least, else the last row of the longest table; or None."""
    for i, block in enumerate(blocks):
        if isinstance(block, Table) and block.note:
            return [*blocks[:i], replace(block, note=""), *blocks[i + 1 :]]
        names = [] if not isinstance(block, Facts) else [name for name, _ in block.facts]
        if isinstance(block, Facts) and (spare := next((n for n in block.spare if n in names), None)):
            last = len(names) - 1 - names[::-1].index(spare)
            left = (*block.facts[:last], *block.facts[last + 1 :])
            return [*blocks[:i], replace(block, facts=left), *blocks[i + 1 :]]
    tables = [(len(block.rows), i) for i, block in enumerate(blocks) if isinstance(block, Table)]
    longest, i = max(tables, default=(0, 0))
    table = blocks[i] if longest > _FEWEST else None
    if not isinstance(table, Table):
        return None
    rows = table.rows[: min(longest - 1, _MOST)]
    return [*blocks[:i], replace(table, rows=rows, left=table.left + longest - len(rows)), *blocks[i + 1 :]]


def _opening(page: Page, blocks: Sequence[Block]) -> Iterator[RenderableType]:
    yield _led(page, page.claim or page.summary)
    if page.verdict != Verdict.CERTIFIED and page.meaning:
        yield _indented(_text(page.meaning))
    yield from map(_indented, _shown(blocks))


def _closing(rows: Rows, width: int = _LABELS) -> Iterator[Text]:
    for what, where in rows:
        label = (f"  {what:<{width}}", "bold")
        yield Text.assemble(label, where, no_wrap=True, overflow="ignore")


def _led(page: Page, words: str) -> Text:
    verdict = (f"{page.verdict} ", f"bold {_color(page.verdict)}") if page.verdict else ""
    return Text.assemble(verdict, (f"{page.name}: ", "bold"), words.translate(_ASCII))


def _color(verdict: str) -> str:
    return _COLORS.get(look(verdict), "")


def _indented(item: RenderableType) -> Padding:
    return Padding(item, (0, 0, 0, 2), expand=False)


def _shown(blocks: Sequence[Block]) -> Iterator[RenderableType]:
    """Blocks as far as a terminal has them: no figures."""
    width = _labels(blocks)
    for block in blocks:
        match block:
            case Words():
                yield _text(block.text)
            case Items():
                yield from (_text(block.title),) if block.title else ()
                yield from (_text(f"- {item}") for item in block.items)
            case Facts():
                yield _facts([(name, _cell(cell)) for name, cell in block.facts], width)
            case Listing():
                yield _text(block.text)
            case Reason():
                yield _reason(block)
            case Table():
                yield _table(block, width)
                notes = (block.note, f"{block.left} more with -v" if block.left else "")
                yield from (_text(note, "dim") for note in notes if note)


def _labels(blocks: Sequence[Block]) -> int:
    """How wide names before values are where facts and tables stand together: their values begin in one column."""
    facts = [len(name) + 1 for block in blocks if isinstance(block, Facts) for name, _ in block.facts]
    rows = [len(row[0].text) + 2 for block in blocks if isinstance(block, Table) for row in block.rows]
    return max([_LABELS, *facts, *rows]) if facts and max(rows, default=0) <= _WIDEST else _LABELS


def _facts(rows: Sequence[tuple[str, RenderableType]], width: int = _LABELS) -> Grid:
    grid = Grid.grid()
    grid.add_column(min_width=width, no_wrap=True, style="bold")
    grid.add_column(style="not bold", overflow="fold")
    for name, told in rows:
        grid.add_row(_text(f"{name} "), told)
    return grid


def _table(block: Table, labels: int) -> Grid:
    """A table without lines: numbers stay whole, long texts are wrapped; of many columns heads as well."""
    from textwrap import wrap

    many = len(block.columns)
    gap = 2 if many < _MANY else 1
    grid = Grid(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="dim")
    grid.show_header = any(block.columns)
    cells = list(zip(*block.rows, strict=True)) or [()] * many
    for i, (head, column) in enumerate(zip(block.columns, cells, strict=True)):
        width = max((len(cell.text) for cell in column), default=0)
        number = bool(column) and column[0].kind == "number"
        justify: Literal["left", "right"] = "right" if number else "left"
        words = head.translate(_ASCII)
        if many > _FEW:
            words = "\n".join(wrap(words, max(width, 1), break_long_words=False))
        grid.add_column(words, justify=justify, overflow="fold", no_wrap=number or width <= _LABELS)
        grid.columns[i].min_width = None if i or number else labels - gap
    for row in block.rows:
        grid.add_row(*map(_cell, row))
    return grid


def _reason(block: Reason) -> RenderableType:
    """A claim that does not hold, where, and what would help."""
    about = (block.verdict, _color(block.verdict)), (f" {block.claim}", "bold")
    told = Text.assemble(*about, f": {block.message}".translate(_ASCII))
    more = [(name, _text(words)) for name, words in (("at", block.at), ("help", block.relax)) if words]
    return Group(told, _facts(more)) if more else told


def _cell(cell: Cell) -> Text:
    style = _color(cell.text) if cell.kind == "verdict" else ""
    return Text.assemble((cell.text.translate(_ASCII), style), (f"\n{cell.note}", "dim") if cell.note else "")


def _text(words: str, style: str = "") -> Text:
    return Text(words.translate(_ASCII), style=style)

"""A page on a terminal: what it claims, the first section, where files are; all sections if more is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from rich.console import Group
from rich.table import Table as Grid
from rich.text import Text

from tubecert.report.layout import VERDICTS, indented, plain_table, titled
from tubecert.report.page import Block, Cell, Facts, Items, Listing, Page, Reason, Table, Words
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from rich.console import RenderableType

_LABELS: Final = 12  # characters of the names before values
_ASCII: Final = str.maketrans({"ω": "omega", "Γ": "Gamma", "ρ": "rho", "±": "+-", "≤": "<=", "≥": ">="})


def headline(page: Page) -> Text:
    """The verdict, what it is about, and the numbers or the reason that go with it: one line."""
    return _led(page, page.summary)


def screen(page: Page, closing: Sequence[tuple[str, str]], *, verbose: bool) -> list[RenderableType]:
    """The page; `closing` are files and commands, which are neither wrapped nor cut."""
    first, *others = page.sections
    parts: list[RenderableType] = [_led(page, page.claim or page.summary)]
    if page.verdict != Verdict.CERTIFIED:
        parts.append(indented(_text(page.meaning)))
    parts += map(indented, _shown(first.blocks))
    for section in others if verbose else ():
        if body := list(_shown(section.blocks)):
            parts += titled(section.title, body)
    parts += [Text()] if verbose else []
    for what, where in closing:
        label = (f"  {what:<{_LABELS}}", "bold")
        parts.append(Text.assemble(label, where, no_wrap=True, overflow="ignore"))
    return parts


def _led(page: Page, words: str) -> Text:
    verdict = (page.verdict, f"bold {VERDICTS[Verdict(page.verdict)]}")
    return Text.assemble(verdict, (f" {page.name}: ", "bold"), words.translate(_ASCII))


def _shown(blocks: Sequence[Block]) -> Iterator[RenderableType]:
    """Blocks as far as a terminal has them: no figures."""
    for block in blocks:
        match block:
            case Words():
                yield _text(block.text)
            case Items():
                yield from (_text(block.title),) if block.title else ()
                yield from (_text(f"- {item}") for item in block.items)
            case Facts():
                yield _facts([(name, _cell(cell)) for name, cell in block.facts])
            case Listing():
                yield _text(block.text)
            case Reason():
                yield _reason(block)
            case Table():
                yield _table(block)
                yield from (_text(block.note, "dim"),) if block.note else ()


def _facts(rows: Sequence[tuple[str, RenderableType]]) -> Grid:
    grid = Grid.grid()
    grid.add_column(min_width=_LABELS, no_wrap=True, style="bold")
    grid.add_column(style="not bold", overflow="fold")
    for name, told in rows:
        grid.add_row(_text(f"{name} "), told)
    return grid


def _table(block: Table) -> Grid:
    """A table, of which the column with the longest text is wrapped."""
    widest = [max((len(row[i].text) for row in block.rows), default=0) for i in range(len(block.columns))]
    columns = (column.translate(_ASCII) for column in block.columns)
    grid = plain_table(*columns, wrapped=widest.index(max(widest)))
    grid.columns[0].min_width = _LABELS - 2
    for row in block.rows:
        grid.add_row(*map(_cell, row))
    return grid


def _reason(block: Reason) -> RenderableType:
    """A claim that does not hold, where, and what would help."""
    about = (block.verdict, VERDICTS[Verdict(block.verdict)]), (f" {block.claim}", "bold")
    told = Text.assemble(*about, f": {block.message}".translate(_ASCII))
    more = [(name, _text(words)) for name, words in (("at", block.at), ("help", block.relax)) if words]
    return Group(told, _facts(more)) if more else told


def _cell(cell: Cell) -> Text:
    style = VERDICTS[Verdict(cell.text)] if cell.kind == "verdict" else ""
    return Text.assemble((cell.text.translate(_ASCII), style), (f"\n{cell.note}", "dim") if cell.note else "")


def _text(words: str, style: str = "") -> Text:
    return Text(words.translate(_ASCII), style=style)

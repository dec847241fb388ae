"""A page on a terminal: the verdict, the first section, where files are; all sections if more is asked for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from rich.table import Table as Grid
from rich.text import Text

from tubecert.report.layout import VERDICTS, indented, plain_table, titled
from tubecert.report.page import Block, Cell, Facts, Items, Page, Table
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from rich.console import RenderableType

_LABELS: Final = 12  # characters of the names before values


def headline(page: Page) -> Text:
    """The verdict, what it is about, and what it says."""
    verdict = (page.verdict, f"bold {VERDICTS[Verdict(page.verdict)]}")
    return Text.assemble(verdict, (f" {page.name}: ", "bold"), page.summary)


def screen(page: Page, closing: Sequence[tuple[str, str]], *, verbose: bool) -> list[RenderableType]:
    """The page; `closing` are files and commands, which are neither wrapped nor cut."""
    first, *others = page.sections
    parts: list[RenderableType] = [headline(page), *map(indented, _shown(first.blocks))]
    for section in others if verbose else ():
        if body := list(_shown(section.blocks)):
            parts += titled(section.title, body)
    for what, where in closing:
        label = (f"  {what:<{_LABELS}}", "bold")
        parts.append(Text.assemble(label, where, no_wrap=True, overflow="ignore"))
    return parts


def _shown(blocks: Sequence[Block]) -> Iterator[RenderableType]:
    """Blocks as far as a terminal has them: no figures."""
    for block in blocks:
        match block:
            case Items():
                yield from (Text(f"- {item}") for item in block.items)
            case Facts():
                grid = Grid.grid()
                grid.add_column(min_width=_LABELS, no_wrap=True, style="bold")
                grid.add_column(style="not bold", overflow="fold")
                for name, cell in block.facts:
                    grid.add_row(Text(f"{name} "), Text(cell.text))
                yield grid
            case Table():
                grid = plain_table(*block.columns, wrapped=len(block.columns) - 1)
                grid.columns[0].min_width = _LABELS - 2
                for row in block.rows:
                    grid.add_row(*(_text(cell) for cell in row))
                yield grid
                if block.note:
                    yield Text(block.note, style="dim")


def _text(cell: Cell) -> Text:
    return Text(cell.text)

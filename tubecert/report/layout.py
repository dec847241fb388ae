"""How reports for a terminal are laid out: parts with titles, indented; tables without lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final, Literal

from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from rich.console import RenderableType

VERDICTS: Final = {Verdict.CERTIFIED: "green", Verdict.REFUTED: "red", Verdict.UNDECIDED: "yellow"}


def indented(item: RenderableType) -> Padding:
    """What belongs to the line above."""
    return Padding(item, (0, 0, 0, 2), expand=False)


def titled(title: str, body: Iterable[RenderableType]) -> list[RenderableType]:
    """A part of a report, after an empty line."""
    return [Text(), Text(title, style="bold"), *map(indented, body)]


def kept_in(folder: str, files: Sequence[str]) -> Text:
    """What a command has written."""
    found = Text(f"{len(files)} files ", style="bold", no_wrap=True, overflow="ignore")
    return found.append(f"in {folder}: {', '.join(files)}", style="not bold")


def plain_table(*columns: str, wrapped: int | None = None) -> Table:
    """A table without lines; columns named >... are aligned to the right, only the one at `wrapped` wraps."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    for index, column in enumerate(columns):
        justify: Literal["left", "right"] = "right" if column.startswith(">") else "left"
        table.add_column(column.lstrip(">"), justify=justify, overflow="fold", no_wrap=index != wrapped)
    return table

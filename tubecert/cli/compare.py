"""`compare`: certificates in; what they say side by side, as a table, a page or data."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert import certificate
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.cli.targets import refused, spare
from tubecert.files import STDIN
from tubecert.library.comparing import FORMATS, REMEDY, compare, ending_of
from tubecert.printable import visible
from tubecert.report.comparison import page_of_comparison
from tubecert.report.layout import indented, plain_table, titled
from tubecert.report.page import Page, Table
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from rich.console import RenderableType


def run(paths: Sequence[str], format_: str, targets: Sequence[str], output: Output) -> None:
    """Compare, write what was asked for. Raises `TargetError` for a certificate that cannot be read."""
    if list(paths).count(STDIN) > 1:
        raise refused("- is given twice: one certificate can be on stdin", "give files")
    for target in targets:
        ending_of(target)
        certificate.check_target(target, REMEDY)
        spare(target, {f"certificate {path}": path for path in paths if path != STDIN})
    comparison = compare(*paths)
    for target in targets:
        comparison.save(target)
    if format_ == "text":
        terminal = Terminal.stdout(color=output.color)
        page = page_of_comparison(comparison.sides, all_of_it=output.verbose)
        written = [Text(f"page {visible(target)}", no_wrap=True, overflow="ignore") for target in targets]
        write_stdout(terminal.text(Text(page.summary) if output.quiet else [*_shown(page), Text(), *written]))
    else:
        write_stdout(FORMATS[f".{format_}"](comparison))


def _shown(page: Page) -> list[RenderableType]:
    """The page on a terminal."""
    parts: list[RenderableType] = [
        Text(f"{page.name}: {page.summary}", style="bold"),
        indented(Text(page.meaning)),
    ]
    for section in page.sections:
        tables = [block for block in section.blocks if isinstance(block, Table)]
        for table in tables:
            shown = plain_table(table.columns[0], *(f">{column}" for column in table.columns[1:]))
            for column in shown.columns[1:]:
                column.no_wrap = False
            for row in table.rows:
                shown.add_row(*(Text(cell.text) for cell in row))
            body: list[RenderableType] = [shown] if table.rows else []
            parts += titled(section.title, [*body, *([Text(table.note)] if table.note else [])])
    return parts

"""`compare`: certificates in; what they say side by side, as a table, a page or data."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rich.text import Text

from tubecert import certificate
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.cli.targets import refused, spare
from tubecert.files import STDIN
from tubecert.library.certification import read
from tubecert.printable import printable_json, visible
from tubecert.report import html, markdown
from tubecert.report.comparison import Comparison, page_of_comparison
from tubecert.report.layout import indented, plain_table, titled
from tubecert.report.page import Page, Table
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from rich.console import RenderableType

_REMEDY: Final = "give a file FILE.html, FILE.md, FILE.csv or FILE.json in a folder that exists"


def run(paths: Sequence[str], format_: str, targets: Sequence[str], output: Output) -> None:
    """Compare, write what was asked for. Raises `TargetError` for a certificate that cannot be read."""
    if list(paths).count(STDIN) > 1:
        raise refused("- is given twice: one certificate can be on stdin", "give files")
    for target in targets:
        if Path(target).suffix.lower() not in _WRITERS:
            raise refused(f"cannot write {target}: a comparison is a page or a table", _REMEDY)
        certificate.check_target(target, _REMEDY)
        spare(target, {f"certificate {path}": path for path in paths if path != STDIN})
    comparison = Comparison.of([(path, read(path).certificate) for path in paths])
    for target in targets:
        certificate.write_text(target, _WRITERS[Path(target).suffix.lower()](comparison), _REMEDY)
    if format_ == "text":
        terminal = Terminal.stdout(color=output.color)
        page = page_of_comparison(comparison, all_of_it=output.verbose)
        written = [Text(f"page {visible(target)}", no_wrap=True, overflow="ignore") for target in targets]
        write_stdout(terminal.text(Text(page.summary) if output.quiet else [*_shown(page), Text(), *written]))
    else:
        write_stdout(_WRITERS[f".{format_}"](comparison))


def _as_html(comparison: Comparison) -> str:
    return html.render_page(page_of_comparison(comparison))


def _as_markdown(comparison: Comparison) -> str:
    return markdown.render_page(page_of_comparison(comparison, all_of_it=False))


def _as_csv(comparison: Comparison) -> str:
    return comparison.csv()


def _as_json(comparison: Comparison) -> str:
    return printable_json(json.dumps(comparison.json(), indent=1, ensure_ascii=False)) + "\n"


_WRITERS: Final[Mapping[str, Callable[[Comparison], str]]] = {
    ".html": _as_html,
    ".htm": _as_html,
    ".md": _as_markdown,
    ".markdown": _as_markdown,
    ".csv": _as_csv,
    ".json": _as_json,
}


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

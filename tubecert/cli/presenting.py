"""What a command found, on stdout: a page for people, or data for programs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tubecert.cli import keeper
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.report.page import Page
    from tubecert.report.text import Rows


def present(output: Output, page: Page, closing: Rows = (), data: str | None = None) -> None:
    """Shows the page, then files and next commands (with `--quiet` its headline alone); or writes `data`.

    With `data` the headline is on stderr.
    """
    from tubecert.report.text import headline

    write_stdout(text_of(output, page, closing, data))
    if data is not None and not output.quiet:
        Terminal.stderr(color=output.color).show(headline(page))
    keeper.tell({"said": True})


def text_of(output: Output, page: Page, closing: Rows, data: str | None = None) -> str:
    """What `present` writes to stdout."""
    from tubecert.report.text import headline, screen

    if data is not None:
        return data
    shown = [headline(page)] if output.quiet else screen(page, closing, verbose=output.verbose)
    return Terminal.stdout(color=output.color).text(shown)

"""What a command found, on stdout: a report for people, or data for programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from rich.console import RenderableType


def present(
    output: Output,
    verdict: RenderableType,
    report: Callable[[], Sequence[RenderableType]],
    data: str | None = None,
) -> None:
    """Shows the report (with `--quiet` only the verdict); or writes `data`, with the verdict on stderr."""
    if data is None:
        terminal = Terminal.stdout(color=output.color)
        write_stdout(terminal.text(verdict if output.quiet else report()))
        return
    write_stdout(data)
    if not output.quiet:
        Terminal.stderr(color=output.color).show(verdict)

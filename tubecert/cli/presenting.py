"""What a command found, on stdout: a report for people, or data for programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from tubecert.cli import keeper
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
    write_stdout(text_of(output, verdict, report, data))
    if data is not None and not output.quiet:
        Terminal.stderr(color=output.color).show(verdict)
    keeper.tell({"said": True})


def text_of(
    output: Output,
    verdict: RenderableType,
    report: Callable[[], Sequence[RenderableType]],
    data: str | None = None,
) -> str:
    """What `present` writes to stdout."""
    if data is not None:
        return data
    return Terminal.stdout(color=output.color).text(verdict if output.quiet else report())

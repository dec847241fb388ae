"""Where text goes: a terminal with its width and colours, or a pipe with neither.

Whatever the text holds, nothing but our own colours steers the terminal, and no line is a command of a workflow.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from io import StringIO
from typing import TYPE_CHECKING, TextIO

from rich.color import ColorSystem
from rich.console import Console
from rich.segment import Segment

from tubecert.printable import harmless, visible

if TYPE_CHECKING:
    from rich.console import RenderableType

PIPE_WIDTH = 100
MOST_WIDTH = 120  # longer lines are hard to read
LEAST_WIDTH = 40


@dataclass(frozen=True, slots=True, kw_only=True)
class Terminal:
    """A stream and how to write to it."""

    stream: TextIO | None
    colored: bool
    width: int
    interactive: bool
    environment: Mapping[str, str] = field(default_factory=dict, repr=False)

    @classmethod
    def stdout(cls, *, color: str | None) -> Terminal:
        """Standard output."""
        return cls.of(sys.stdout, color, os.environ)

    @classmethod
    def stderr(cls, *, color: str | None) -> Terminal:
        """Standard error."""
        return cls.of(sys.stderr, color, os.environ)

    @classmethod
    def of(cls, stream: TextIO | None, color: str | None, environment: Mapping[str, str]) -> Terminal:
        """How to write to a stream: `color` is auto (or None), always or never."""
        interactive = bool(stream is not None and not stream.closed and stream.isatty())
        wanted = interactive and not environment.get("NO_COLOR") and environment.get("TERM") != "dumb"
        colored = color == "always" or (color != "never" and wanted)
        width = _asked_width(environment) or (_terminal_width(stream) if interactive else PIPE_WIDTH)
        return cls(
            stream=stream,
            colored=colored,
            width=min(width, MOST_WIDTH),
            interactive=interactive,
            environment=dict(environment),
        )

    def console(self, stream: TextIO | None = None) -> Console:
        """A console on the stream (or on another one, with the same looks)."""
        return Console(
            file=stream or self.stream or StringIO(),
            force_terminal=self.colored or self.interactive,
            color_system="standard" if self.colored else None,
            no_color=not self.colored,
            width=self.width,
            highlight=False,
            emoji=False,
            markup=False,
            legacy_windows=False,
            _environ={},
        )

    def text(self, renderables: RenderableType | Iterable[RenderableType]) -> str:
        """The text as it is to be written, without trailing spaces."""
        buffer = StringIO()
        console = self.console(buffer)
        if not isinstance(renderables, (list, tuple)):
            renderables = [renderables]  # type: ignore[list-item]
        colors = ColorSystem.STANDARD if self.colored else None
        for renderable in renderables:
            for line in Segment.split_lines(console.render(renderable, console.options)):
                buffer.write(_line(_harmless(line), colors) + "\n")
        return buffer.getvalue()

    def show(self, renderables: RenderableType | Iterable[RenderableType]) -> None:
        """Writes to the stream; a stream that is gone is no error."""
        if self.stream is None:
            return
        try:
            self.stream.write(self.text(renderables))
            self.stream.flush()
        except (OSError, ValueError):
            return


def _harmless(line: list[Segment]) -> list[Segment]:
    """The line with visible characters only; one that could be a command loses its colours and is none."""
    shown = [Segment(visible(segment.text), segment.style) for segment in line if not segment.control]
    text = "".join(segment.text for segment in shown)
    return shown if harmless(text) == text else [Segment(harmless(text))]


def _line(line: list[Segment], colors: ColorSystem | None) -> str:
    """A line of segments as text, blank ends removed."""
    kept = list(line)
    while kept and not kept[-1].text.rstrip():
        kept.pop()
    if kept:
        kept[-1] = Segment(kept[-1].text.rstrip(), kept[-1].style)
    return "".join(
        segment.style.render(segment.text, color_system=colors) if segment.style else segment.text
        for segment in kept
    )


def _asked_width(environment: Mapping[str, str]) -> int:
    """The width that COLUMNS asks for, 0 if it asks for none that could be."""
    text = environment.get("COLUMNS", "")[:9]
    asked = int(text) if text.isascii() and text.isdigit() else 0
    return max(asked, LEAST_WIDTH) if asked else 0


def _terminal_width(stream: TextIO | None) -> int:
    try:
        columns = os.get_terminal_size(stream.fileno()).columns if stream is not None else 0
    except (OSError, ValueError):
        columns = 0
    return columns or 80

"""What is being proven right now, on stderr, gone when it is done."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from tubecert.report.numbers import short

if TYPE_CHECKING:
    from tubecert.pipeline import Step
    from tubecert.report.terminal import Terminal


@contextlib.contextmanager
def shown(terminal: Terminal, *, wanted: bool) -> Iterator[Callable[[Step], None] | None]:
    """A callback that shows each step, or None where progress would only disturb (a pipe, a log)."""
    if not (wanted and terminal.interactive):
        yield None
        return
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    with Progress(*columns, console=terminal.console(), transient=True) as bar:
        task = bar.add_task("reading")
        yield lambda step: bar.update(task, description=describe(step))


def describe(step: Step) -> str:
    """A step in words: what, how many boxes, and how far its bounds are apart."""
    words = f"{step.name.replace('_', ' ')}: {step.boxes:,} {step.unit}"
    if math.isfinite(step.below) and math.isfinite(step.above):
        words += f", between {short(step.below)} and {short(step.above)}"
    return words

"""What is being proven right now, on stderr, gone when it is done."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from tubecert.report.numbers import short

if TYPE_CHECKING:
    from tubecert.pipeline import Step
    from tubecert.report.terminal import Terminal

_EVERY = 10.0  # s between lines of a log


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


@contextlib.contextmanager
def counted(
    terminal: Terminal, *, wanted: bool, clock: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[int, int, bool], None] | None]:
    """A callback for how many points of how many are done, and whether one was finished just now.

    On a terminal a bar, elsewhere (a log, a cluster's job) a line every ten seconds at most.
    """
    if not wanted:
        yield None
        return
    count = _Count(clock)
    if not terminal.interactive:
        yield (
            lambda done, total, fresh: (
                terminal.show(line) if (line := count.line(done, total, fresh)) else None
            )
        )
        return
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (BarColumn(), TextColumn("{task.description}"))
    with Progress(*columns, console=terminal.console(), transient=True) as bar:
        task = bar.add_task("reading")
        yield lambda done, total, fresh: bar.update(
            task, completed=done, total=total, description=count.words(done, total, fresh)
        )


class _Count:
    """Points that are done, and the time that the others will take if they take as long."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.clock, self.started, self.told = clock, clock(), clock()
        self.fresh = 0

    def line(self, done: int, total: int, fresh: bool) -> str:
        """A line for a log, empty where the last one is younger than ten seconds."""
        words = self.words(done, total, fresh)
        if fresh and done < total and self.clock() - self.told < _EVERY:
            return ""
        self.told = self.clock()
        return words

    def words(self, done: int, total: int, fresh: bool) -> str:
        """How far it is."""
        self.fresh += fresh
        words = f"{done} of {total} points"
        if not self.fresh or done == total:
            return words
        left = (self.clock() - self.started) / self.fresh * (total - done)
        return f"{words}, about {_duration(left)} left"


def _duration(seconds: float) -> str:
    """A time as one reads it."""
    if seconds < 100:
        return f"{math.ceil(seconds)} s"
    minutes = seconds / 60
    return f"{round(minutes)} min" if minutes < 100 else f"{minutes / 60:.1f} h"

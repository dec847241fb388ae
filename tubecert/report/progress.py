"""How far a command is, on stderr: a bar that goes away on a terminal, elsewhere a line every ten seconds."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final

from tubecert.printable import visible
from tubecert.progress import Phase, Progress, Step
from tubecert.words.progress import described

if TYPE_CHECKING:
    from tubecert.report.terminal import Terminal

EVERY: Final = 10.0  # s between lines of a log
_HARD: Final = 3.0  # times the mean: a piece that takes longer is not like those before it
_UNLIKE: Final = (Phase.GAINS,)  # these take longer than what was counted before them
Clock = Callable[[], float]


@dataclass(slots=True)
class Timed:
    """Adds to every step the seconds since it was made, and how long what is left will take.

    The estimate is for the phase: the pieces that are left take as long as those that were finished since it began. Of
    one that takes much longer nothing is known but that the others come after it.
    """

    shown: Progress
    clock: Clock = time.monotonic
    began: float = field(init=False)
    whole: int | None = None
    before: int = 0
    since: float = field(init=False)
    finished: float = field(init=False)
    last: int = 0

    def __post_init__(self) -> None:
        self.began = self.since = self.finished = self.clock()

    def __call__(self, step: Step) -> None:
        """A step, with its times."""
        now = self.clock()
        if step.of != self.whole or step.done < self.before:
            self.whole, self.before, self.since = step.of, step.done, now
        if step.done != self.last:
            self.last, self.finished = step.done, now
        fresh, left, hard = step.done - self.before, None, False
        alike = step.phase not in _UNLIKE
        if step.of is not None and fresh > 0 and step.done < step.of and alike:
            mean, others = (self.finished - self.since) / fresh, step.of - step.done - 1
            hard = now - self.finished > max(_HARD * mean, EVERY / 2)
            left = (mean * others or None) if hard else (now - self.since) / fresh * (step.of - step.done)
        self.shown(replace(step, seconds=now - self.began, left=left, least=hard and left is not None))


@dataclass(slots=True)
class Pieces:
    """Tells how many pieces of all are done, with the steps of the piece that is worked on."""

    shown: Progress
    phase: Phase
    of: int
    done: int = 0

    def __call__(self, step: Step) -> None:
        """A step of a piece."""
        self.shown(replace(step, phase=self.phase, done=self.done, of=self.of))

    def ready(self, place: int, result: object) -> None:
        """A piece is done."""
        del place, result
        self.done += 1
        self(Step(phase=self.phase))


def timed(progress: Progress | None) -> Progress | None:
    """The callback, given steps with their times."""
    return None if progress is None else Timed(progress)


@contextlib.contextmanager
def shown(terminal: Terminal, *, wanted: bool, clock: Clock = time.monotonic) -> Iterator[Progress | None]:
    """A callback that shows each step; None where nothing is wanted."""
    if not wanted:
        yield None
    elif terminal.interactive:
        with _bar(terminal) as bar:
            yield Timed(bar, clock)
    else:
        log = Log(terminal, clock)
        with log.beating():
            yield log.hear


@contextlib.contextmanager
def _bar(terminal: Terminal) -> Iterator[Progress]:
    """A bar where it is known how much there is, else something that turns; both go away."""
    from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Rich
    from rich.table import Column

    words = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    columns = (
        SpinnerColumn(),
        TimeElapsedColumn(),
        BarColumn(bar_width=12),
        TextColumn("{task.description}", table_column=words, markup=False),
    )
    with Rich(*columns, console=terminal.console(), transient=True, expand=True) as rich:
        task = rich.add_task("reading", total=None)
        yield lambda step: rich.update(
            task,
            description=visible(described(replace(step, seconds=0.0))),
            completed=step.done,
            total=step.of or None,
        )


class Log:
    """A line every ten seconds, also while nothing is told: whoever reads a log sees that work goes on."""

    def __init__(self, terminal: Terminal, clock: Clock = time.monotonic) -> None:
        self.terminal, self.clock = terminal, clock
        self.last = Step(phase=Phase.CERTIFICATION)
        self.began = self.written = self.told = clock()
        self.heard = False
        self.lock = threading.Lock()
        self.times = Timed(self._keep, clock)

    def hear(self, step: Step) -> None:
        """A step: what the next line says."""
        self.times(step)
        self.beat()

    def beat(self) -> None:
        """Writes a line if the last one, or the beginning, is ten seconds ago."""
        with self.lock:
            now = self.clock()
            if not self.heard or now - self.written < EVERY:
                return
            self.written = now
            passed = 0.0 if self.last.least else now - self.told
            left = None if self.last.left is None else self.last.left - passed
            still = None if left is None or left < 0 else left  # an estimate that was wrong is not repeated
            words = described(replace(self.last, seconds=now - self.began, left=still))
        self.terminal.show(cropped(visible(words), self.terminal.width))

    @contextlib.contextmanager
    def beating(self) -> Iterator[None]:
        """Beats from a thread of its own until the end."""
        over = threading.Event()

        def work() -> None:
            while not over.wait(EVERY / 10):
                self.beat()

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def _keep(self, step: Step) -> None:
        self.last, self.heard, self.told = step, True, self.clock()


def cropped(text: str, width: int) -> str:
    """One line, no longer than this."""
    return text if len(text) <= width else f"{text[: width - 3]}..."

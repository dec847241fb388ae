"""What a command tells: to who looks at it, and to who keeps it for an end that comes from outside."""

from __future__ import annotations

import contextlib
import inspect
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert.claims.family import Reason
from tubecert.cli import keeper
from tubecert.cli.guard import write_stdout
from tubecert.digits import exact, short
from tubecert.errors import ExitCode
from tubecert.printable import visible
from tubecert.progress import Phase, Progress, Step
from tubecert.report import progress
from tubecert.report.page import Page
from tubecert.report.terminal import Terminal
from tubecert.report.text import Rows, headline, screen
from tubecert.words.progress import came_to, described, next_step, out_of_reach

if TYPE_CHECKING:
    from tubecert.certificate.result import MetricFile
    from tubecert.cli.adapter import Output
    from tubecert.library.shown import Shown
    from tubecert.pipeline.synthesised import Row, Synthesised
    from tubecert.spec import Spec

_EVERY: Final = 0.2  # s between two of the same search
_CLAIMS: Final = (Phase.CERTIFICATION, Phase.GAINS)  # each name is one, and is done when the next begins


def answered(how: Output, function: Callable[..., Shown], asked: Mapping[str, object]) -> ExitCode:
    """What a function of the library gives, shown; the exit code."""
    with shown(how) as progress:
        more = {"progress": progress} if "progress" in inspect.signature(function).parameters else {}
        found = function(**asked, **more)
    return answer(how, found, found._closing())


def answer(how: Output, found: Shown, closing: Rows) -> ExitCode:
    """Shows what was found: its page, files and next commands, or its JSON; the exit code."""
    data = found._json() if how.json else None
    present(replace(how, quiet=how.quiet or (how.json and found.alone)), found._page(), closing, data)
    return found._exit_code


@contextlib.contextmanager
def shown(
    how: Output,
    kept: Callable[[Synthesised], None] | None = None,
    judged: Callable[[Synthesised], None] | None = None,
) -> Iterator[Told]:
    """A callback of progress: shown unless that is not wanted, and told; it hears what is found as well."""
    terminal = Terminal.stderr(color=how.color)
    with progress.shown(terminal, wanted=not (how.no_progress or how.quiet)) as report:
        yield Told(report, kept, judged)


@dataclass(slots=True)
class Told:
    """Passes steps on, and tells those that are new: where the command is, and what it found before.

    What else it hears (`asking.hears`): lines that it tells, too, and what a search has.
    """

    shown: Progress | None
    kept: Callable[[Synthesised], None] | None
    judged: Callable[[Synthesised], None] | None
    last: Step | None = None
    when: float = 0.0
    ended: set[tuple[Phase, str]] = field(default_factory=set)

    def found(self, line: str) -> None:
        """A line about what was found."""
        found(line)

    def __call__(self, step: Step) -> None:
        """A step."""
        if self.shown is not None:
            self.shown(step)
        before, self.last = self.last, step
        new = before is None or (before.phase, before.name) != (step.phase, step.name)
        now = time.monotonic()
        if not new and now - self.when < _EVERY:
            return
        self.when = now
        if before is not None and new and before.phase in _CLAIMS:
            key = before.phase, before.name
            if key not in self.ended:  # closer bounds of the same constants come later
                found(came_to(before))
            self.ended.add(key)
        keeper.tell({"at": visible(described(step)), "next": next_step(step.phase)})


class Search:
    """Hears what a search has after every attempt: tells what was tried and judged, and what would be left."""

    def __init__(self, will: Callable[[Synthesised], keeper.Will | None]) -> None:
        self.will = will
        self.attempts, self.rows = 0, set[tuple[object, ...]]()
        self.file: MetricFile | None = None

    def __call__(self, so_far: Synthesised) -> None:
        """What there is."""
        for attempt in so_far.attempts[self.attempts :]:
            found(f"rate {short(attempt.rate, 4)}, degree {attempt.degree}: {attempt.outcome.told()}")
        self.attempts = len(so_far.attempts)
        for row in so_far.rows:
            if (key := (row.rate, row.floor, row.degree)) not in self.rows:
                self.rows.add(key)
                found(_judged(row))
        if so_far.file is not self.file and (last := self.will(so_far)) is not None:
            self.file = so_far.file
            keeper.tell({"will": last})


def kept(will: Callable[[Synthesised], keeper.Will | None]) -> Search | None:
    """What hears a search; None where nobody keeps what is told."""
    return Search(will) if keeper.told_to() else None


def _judged(row: Row) -> str:
    """A metric, and what a certification with it came to."""
    words = f"metric of rate {exact(row.rate)}, degree {row.degree}"
    if row.verdict is None:
        return words
    if row.claim is None:
        return f"{words}: {row.verdict}"
    return f"{words}: {row.verdict}, {Reason(claim=row.claim, verdict=row.verdict).sentence}"


def warn_of_size(system: Spec, how: Output) -> None:
    """Says that a search is out of reach by its size, before it begins."""
    from tubecert.model import build
    from tubecert.synthesis.problem import beyond

    if how.quiet or (size := beyond(build(replace(system, metric=None)))) is None:
        return
    from rich.text import Text

    Terminal.stderr(color=how.color).show(Text.assemble(("warning: ", "yellow"), out_of_reach(size)))


def found(line: str) -> None:
    """A result, to be told if the command is ended."""
    keeper.tell({"found": visible(line)})


def present(how: Output, page: Page, closing: Rows, data: str | None = None) -> None:
    """Shows the page, then files and next commands (with `--quiet` its headline alone); or writes `data`.

    With `data` the headline is on stderr.
    """
    write_stdout(text_of(how, page, closing, data))
    if data is not None and not how.quiet:
        Terminal.stderr(color=how.color).show(headline(page))
    keeper.tell({"said": True})


def text_of(how: Output, page: Page, closing: Rows, data: str | None = None) -> str:
    """What `present` writes to stdout."""
    if data is not None:
        return data
    shown = [headline(page)] if how.quiet else screen(page, closing, verbose=how.verbose)
    return Terminal.stdout(color=how.color).text(shown)


def plan_of(file: str, system: Spec) -> Path | None:
    """The plan file of the specification in `file`, if it has one."""
    table = system.trajectory.table
    return None if table is None else Path(file).parent / table.file

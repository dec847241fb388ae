"""Who hears of a search, and when it has to come to an end: what is proven by then is what it comes out with.

A deadline cuts the list of what is tried and never a proof; the result says that it was cut.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Literal, SupportsFloat

from tubecert.progress import Progress, Step

if TYPE_CHECKING:
    from tubecert.pipeline.synthesised import Synthesised

Cut = Literal["deadline", "interrupted", "no_adaptation", "plan"]
"""What ended a search before its end: time, somebody, a tube that needs no adaptation, a plan that no metric serves."""


class OutOfTime(Exception):  # noqa: N818 - an end, no error
    """The deadline has passed."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """A time of the monotonic clock, in s; by default there is none."""

    at: float = inf

    @staticmethod
    def after(seconds: SupportsFloat | str | None) -> Deadline:
        """So many seconds from now; without a number there is none."""
        return Deadline() if seconds is None else Deadline(time.monotonic() + float(seconds))

    def check(self) -> None:
        """Raises `OutOfTime` once it has passed."""
        if time.monotonic() > self.at:
            raise OutOfTime


@dataclass(frozen=True, slots=True, kw_only=True)
class Listeners:
    """Who hears of a search, and until when it goes on.

    `progress` hears every step, `told` why there is no metric, before advice is looked for, `kept` what there is after
    every attempt. At the `deadline` what is proven by then is what comes out.
    """

    progress: Progress | None = None
    told: Callable[[Synthesised], None] | None = None
    kept: Callable[[Synthesised], None] | None = None
    deadline: Deadline = field(default_factory=Deadline)

    def __call__(self, step: Step) -> None:
        """Passes a step on; raises `OutOfTime` at the first one after the deadline."""
        self.deadline.check()
        if self.progress is not None:
            self.progress(step)


def cut_by(end: BaseException) -> Cut:
    """What ended a search: a deadline, or somebody who interrupted it."""
    return "deadline" if isinstance(end, OutOfTime) else "interrupted"

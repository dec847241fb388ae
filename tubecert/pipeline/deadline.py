"""When a search has to come to an end: what is proven by then is what it comes out with.

A deadline cuts the list of what is tried and never a proof; the result says that it was cut.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import inf
from typing import Literal

from tubecert.progress import Progress, Step

Cut = Literal["deadline", "interrupted", "no_adaptation", "plan"]
"""What ended a search before its end: time, somebody, a tube that needs no adaptation, a plan that no metric serves."""


class OutOfTime(Exception):  # noqa: N818 - an end, no error
    """The deadline has passed."""


@dataclass(frozen=True, slots=True)
class Deadline:
    """A time of the monotonic clock, in s; by default there is none."""

    at: float = inf

    @staticmethod
    def after(seconds: float) -> Deadline:
        """So many seconds from now."""
        return Deadline(time.monotonic() + seconds)

    def check(self) -> None:
        """Raises `OutOfTime` once it has passed."""
        if time.monotonic() > self.at:
            raise OutOfTime

    def watched(self, progress: Progress | None) -> Progress:
        """The same progress, which raises `OutOfTime` at the first step after it."""

        def told(step: Step) -> None:
            self.check()
            if progress is not None:
                progress(step)

        return told


def cut_by(end: BaseException) -> Cut:
    """What ended a search: a deadline, or somebody who interrupted it."""
    return "deadline" if isinstance(end, OutOfTime) else "interrupted"

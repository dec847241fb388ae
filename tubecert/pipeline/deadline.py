"""When a search has to come to an end: what is proven by then is what it comes out with.

A deadline cuts the list of what is tried and never a proof; the result says that it was cut.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from math import inf


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

"""When an examination has to end. What is not proven by then is undecided: time never confirms or contradicts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf

_END: ContextVar[float] = ContextVar("end", default=inf)


@contextmanager
def within(seconds: float | None) -> Iterator[None]:
    """What is examined in this context ends so many seconds from now; None: when it is done."""
    token = _END.set(inf if seconds is None else time.monotonic() + seconds)
    try:
        yield
    finally:
        _END.reset(token)


def time_is_up() -> bool:
    """Whether the end has passed."""
    return time.monotonic() > _END.get()

"""When an examination has to end, and who is told how far it is. Neither ever confirms or contradicts.

What is not proven by the end is undecided.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from math import inf

Told = Callable[
    [int, float], None
]  # how many boxes were examined of a claim, and which share of it is proven

_END: ContextVar[float] = ContextVar("end", default=inf)
_TOLD: ContextVar[Told | None] = ContextVar("told", default=None)


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


@contextmanager
def telling(told: Told | None) -> Iterator[None]:
    """`told` hears how far what is examined in this context is."""
    token = _TOLD.set(told)
    try:
        yield
    finally:
        _TOLD.reset(token)


def told() -> Told | None:
    """Who hears it."""
    return _TOLD.get()

"""A campaign as vectors of runs, one after the other or side by side; an interruption keeps what is finished.

Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise, takewhile
from typing import TypeVar

from tubecert.executor import Executor
from tubecert.progress import Phase, Progress, Step

R = TypeVar("R")


def vectors_of(count: int, first: int, size: int) -> list[range]:
    """Numbers of `count` runs: a vector of the `first` runs, then of `size` each; at least one vector."""
    return [range(a, b) for a, b in pairwise([0, *range(first, count, size), count])]


def tell(report: Progress | None, name: str, done: int, of: int) -> None:
    """How many runs of so many are done, to whom wants to know."""
    if report is not None:
        report(Step(phase=Phase.SIMULATION, name=name, done=done, of=of))


def finished(
    work: Callable[[range], R],
    vectors: Sequence[range],
    executor: Executor,
    report: Progress | None,
    name: str = "",
) -> list[R]:
    """What work makes of all vectors; of an interruption what comes before the first one that is missing, if any."""
    found: dict[int, R] = {}
    count = sum(map(len, vectors))

    def ready(place: int, made: R) -> None:
        found[place] = made
        tell(report, name, sum(len(vectors[each]) for each in found), count)

    tell(report, name, 0, count)
    try:
        executor.map(work, vectors, ready)
    except KeyboardInterrupt:
        if 0 not in found:
            raise
    return [found[place] for place in takewhile(found.__contains__, range(len(vectors)))]

"""Lanes in time: N runs as one vector (n, N), integrated twice, the second time in steps half as long.

What acts on the lanes and what is to be seen of them is the driver's business; the engine knows neither samples nor
tubes. Trusted: no.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Protocol

import numpy as np

from tubecert.enclosure.interval import Array


class Driver(Protocol):
    """What acts on the lanes. Between the corners of `steps` its slope is smooth."""

    def start(self) -> Array:
        """The first states (n, N)."""
        ...

    def steps(self) -> Iterator[tuple[float, float]]:
        """Where each step begins, and how long it is, in s."""
        ...

    def instant(self, t: float, x: Array) -> None:
        """A step begins at t with the states x (n, N)."""
        ...

    def at(self, t: float, x: Array) -> Array:
        """x' (n, N) within the step."""
        ...

    def seen(self, t: float, x: Array, error: Array) -> None:
        """The step has ended at t; `error` (n, N) is what the integration is known to be wrong by."""
        ...


def march(coarse: Driver, fine: Driver, count: int) -> None:
    """Integrates both drivers, who play the same runs, by `count` steps of RK4 in each step, and twice as many.

    The difference of the two is what `fine` is told as its error: about 15 times what the fourth order leaves.
    """
    x, y = coarse.start(), fine.start()
    with np.errstate(all="ignore"):  # a run that diverges has left its tube before
        for t, length in fine.steps():
            coarse.instant(t, x)
            fine.instant(t, y)
            x = integrated(coarse.at, t, x, length, count)
            y = integrated(fine.at, t, y, length, 2 * count)
            error = np.abs(y - x)
            coarse.seen(t + length, x, error)
            fine.seen(t + length, y, error)


def integrated(
    slope: Callable[[float, Array], Array], t: float, x: Array, length: float, count: int
) -> Array:
    """The states (n, N) a `length` later, by `count` steps of the classical Runge-Kutta method."""
    h = length / count
    for i in range(count):
        s = t + i * h
        a = slope(s, x)
        b = slope(s + h / 2, x + h / 2 * a)
        c = slope(s + h / 2, x + h / 2 * b)
        d = slope(s + h, x + h * c)
        x = x + h / 6 * (a + 2 * (b + c) + d)
    return x

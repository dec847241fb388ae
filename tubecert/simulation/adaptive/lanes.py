"""Runs as lanes of one vector, from start to end: the steps of the loops, and what is seen of every lane.

Arrays have the lanes last.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.plans import stepped

if TYPE_CHECKING:
    from tubecert.simulation.adaptive.continuous import Continuous

_CHUNK: Final = 64  # steps whose peaks are taken at once


class Found(NamedTuple):
    """What N lanes leave behind.

    `seen` (K, .., N) at the output times, nan where they did not come; `peak` (-inf where there is none), `peak_time`
    (N,) by name; `least` and `greatest` (m, N) of the inputs; why (0: it was not) and when in s a lane was `stopped`,
    `ended` (N,). `error` (N,) is twice the largest difference of states to the run with steps twice as long, or an
    eighth of the difference before: mostly far above the true one; inf where it is not known, or the lane failed.
    `unresolved` (N,) is the first output time at which that difference exceeds the tolerance, nan where it never does;
    `steps` (N,) how many there were.
    """

    seen: dict[str, Array]
    peak: dict[str, Array]
    peak_time: dict[str, Array]
    least: Array
    greatest: Array
    stopped: NDArray[np.int64]
    ended: Array
    error: Array
    unresolved: Array
    steps: NDArray[np.int64]


def combined(parts: Sequence[Found], how: Callable[..., Array]) -> Found:
    """One for several, array by array: `how` takes those of all of them, with the lanes last."""
    fields: list[Any] = [
        {name: how(*(own[name] for own in each)) for name in each[0]}
        if isinstance(each[0], dict)
        else how(*each)
        for each in zip(*parts, strict=True)
    ]
    return Found(*fields)


def of_some(found: Found, lanes: NDArray[np.intp] | slice) -> Found:
    """That of some lanes."""
    return combined([found], lambda part: part[..., lanes])


def follow(system: Continuous) -> Found:
    """All steps of some lanes, from their start on.

    A step takes the slopes `at` its four stages, and after the first of them what is seen at that `instant`; then what
    goes on beside the slopes, the exact flows, in `step`.
    """
    x, length = system.start(), system.grid.length.tolist()
    record = _Record(system)
    with np.errstate(all="ignore"):
        for step in range(len(length)):
            slope = system.at(step, 0, x)
            record.see(slope)
            if step < len(length) - 1:
                x = stepped(partial(system.at, step), x, length[step], slope) + system.step(step)
            if record.all_stopped(step):
                break
        return record.closed()


class _Record:
    """What is left behind so far, and the rows of the steps since peaks were last taken."""

    def __init__(self, system: Continuous) -> None:
        self._system, self._start, self._outputs = system, system.grid.start, system.grid.outputs
        self._rows, self._alive, self._first = list[dict[str, Array]](), list[NDArray[np.bool_]](), 0
        self._found: Found | None = None
        self._ended = np.full(len(system.stopped), np.nan)

    def see(self, slope: Array) -> None:
        """Keeps what is seen of the lanes that have come to a step."""
        self._rows.append(self._system.instant(slope))
        self._alive.append(self._system.stopped == 0)
        if len(self._rows) == _CHUNK:
            self._take()

    def all_stopped(self, step: int) -> bool:
        """Whether no lane goes on beyond a step; when they were stopped is kept."""
        stopped = self._system.stopped != 0
        if not stopped.any():
            return False
        self._ended[stopped & np.isnan(self._ended)] = self._start[step]
        return bool(stopped.all())

    def _take(self) -> None:
        """Peaks of the rows so far, and those of them that are at output times."""
        rows = {name: np.stack([row[name] for row in self._rows]) for name in self._rows[0]}
        alive, sizes = np.stack(self._alive), self._system.sizes(rows)
        if self._found is None:
            self._found = self._nothing(rows, sizes)
        found, t = self._found, self._start[self._first : self._first + len(alive)]
        lanes = np.arange(alive.shape[1])
        for name, size in sizes.items():
            best = np.argmax(np.where(alive, size, -np.inf), axis=0)
            value, peak = np.where(alive, size, -np.inf)[best, lanes], found.peak[name]
            higher = value > peak
            peak[higher], found.peak_time[name][higher] = value[higher], t[best[higher]]
        live = alive[:, None]
        np.minimum(found.least, np.where(live, rows["u"], np.inf).min(axis=0), out=found.least)
        np.maximum(found.greatest, np.where(live, rows["u"], -np.inf).max(axis=0), out=found.greatest)
        low, high = np.searchsorted(self._outputs, [self._first, self._first + len(alive)])
        own = self._outputs[low:high] - self._first
        for name, seen in found.seen.items():
            part = rows[name][own]
            seen[low:high] = np.where(alive[own] if part.ndim == 2 else live[own], part, np.nan)
        self._first += len(alive)
        self._rows.clear()
        self._alive.clear()

    def _nothing(self, rows: Mapping[str, Array], sizes: Mapping[str, Array]) -> Found:
        K, N, inputs = len(self._outputs), len(self._system.stopped), rows["u"].shape[1:]
        return Found(
            seen={name: np.full((K, *rows[name].shape[1:]), np.nan) for name in self._system.kept},
            peak={name: np.full(N, -np.inf) for name in sizes},
            peak_time={name: np.zeros(N) for name in sizes},
            least=np.full(inputs, np.inf),
            greatest=np.full(inputs, -np.inf),
            stopped=self._system.stopped,
            ended=self._ended,
            error=np.full(N, np.inf),
            unresolved=np.full(N, np.nan),
            steps=np.full(N, len(self._start) - 1),
        )

    def closed(self) -> Found:
        """All that was found."""
        if self._rows:
            self._take()
        assert self._found is not None
        return self._found

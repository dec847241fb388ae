"""Many states moved over a segment at once, by RK4: what plans of a family are drawn with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.compiled import compiled, entry
from tubecert.simulate.program import Program, execute


class Segment(NamedTuple):
    """From `begin` on, `length` s: u* on a line from `now` to `then` (N, m), and x*' misses f + B u* by `p` (N, n)."""

    begin: float
    length: float
    now: Array
    then: Array
    p: Array


class Trial(NamedTuple):
    """Working memory: that of the program, and `rates` (4, n)."""

    memory: Array
    rates: Array


def trial(memory: Array, n: int) -> Trial:
    """Fresh working memory of a program of n outputs."""
    return Trial(memory.copy(), np.zeros((4, n)))


@entry
def walk(drift: Program, segment: Segment, trial: Trial, path: Array) -> None:
    """Fills path (N, steps + 1, n), whose first points are the starts; the program is f + B u of (x, u, t)."""
    count, n = path.shape[1] - 1, path.shape[2]
    dt = segment.length / count
    for lane in range(path.shape[0]):
        for k in range(count):
            _rates(drift, segment, lane, k, count, trial, path[lane, k])
            rates = trial.rates
            for i in range(n):
                slope = rates[0, i] + 2 * rates[1, i] + 2 * rates[2, i] + rates[3, i]
                path[lane, k + 1, i] = path[lane, k, i] + dt / 6 * slope


@compiled
def _rates(drift: Program, segment: Segment, lane: int, k: int, count: int, trial: Trial, x: Array) -> None:
    """The four rates of a step of RK4 from x on."""
    memory, n, m = trial.memory, x.shape[0], segment.now.shape[1]
    dt = segment.length / count
    for stage in range(4):
        share = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        for i in range(n):
            memory[i] = x[i] + (share * dt * trial.rates[stage - 1, i] if stage else 0.0)
        beside = memory[n:]  # u, then t
        for j in range(m):
            change = segment.then[lane, j] - segment.now[lane, j]
            beside[j] = segment.now[lane, j] + change * (k + share) / count
        beside[m] = segment.begin + (k + share) * dt
        execute(drift.steps, drift.steps.shape[0], memory)
        for i in range(n):
            trial.rates[stage, i] = memory[drift.outputs[i]] + segment.p[lane, i]

"""Steps are halved until the error estimate of every lane is small enough: two whole runs are compared. Trusted: no.

Only whole runs tell the error: between two switches of a feedback a loop may amplify what was lost in one step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.simulation.lanes import Found, System, combined, follow, of_some

Places = NDArray[np.intp]
_LEVELS: Final = 7  # of steps: the last ones are 2^6 times shorter than the first
_AGREEING: Final = 0.02  # of the horizon: two levels that stop a lane this near to each other are believed
_LIVED: Final = 16  # steps that a lane must have come: what stops it earlier may be nothing but their length
_PATIENCE: Final = 2  # levels over which the change of a run must fall to less than half (theory: to 1/256)
_DOUBTFUL: Final = 5  # the level from which on a run that does not converge is given up
_ENOUGH: Final = 5.0  # tolerances that an error may be told to be: it is mostly far below
_LUCK: Final = 2.0  # times a change an error may be, where a feedback has kinks ...
_BEFORE: Final = 1 / 8  # ... and times the change before


class Vector(Protocol):
    """N lanes that can be run in the steps of any level, each with twice as many as the one before."""

    N: int
    times: Array

    def system(self, lanes: Places, level: int) -> System:
        """Some of the lanes at a level."""
        ...

    def apart(self, lanes: Places, finer: Found, coarser: Found) -> tuple[Array, Array]:
        """How far states of lanes are apart at the output times (K, N), and what else is, in shares of what may be."""
        ...


class Resolved(NamedTuple):
    """What N lanes found in their last steps, of which there were so many, (N,).

    `error` (N,) is twice the largest difference of states to the run with steps twice as long, or an eighth of the
    difference before: mostly far above the true one; inf for a lane that failed. `unresolved` (N,) is the first output
    time at which that difference exceeds the tolerance, nan where it never does.
    """

    found: Found
    error: Array
    unresolved: Array
    steps: NDArray[np.int64]


def proposed(vector: Vector) -> Resolved:
    """All lanes in the longest steps; their error is not known: inf."""
    system = vector.system(np.arange(vector.N), 0)
    error, never = np.full(vector.N, np.inf), np.full(vector.N, np.nan)
    return Resolved(follow(system), error, never, np.full(vector.N, len(system.steps.start) - 1))


def resolved(vector: Vector, tolerance: float) -> Resolved:
    """All lanes, level after level of those that are not done.

    What is told of a lane's error is at most five tolerances, or it cannot be integrated so far. It is given up as soon
    as halving its steps no longer helps, which is so where the loop itself amplifies every difference.
    """
    best, lanes = proposed(vector), np.arange(vector.N)
    changes = np.full((_LEVELS, vector.N), np.inf)
    failed = np.zeros((_LEVELS, vector.N), dtype=bool)
    failed[0] = best.found.stopped > 0
    for level in range(1, _LEVELS):
        system, whole = vector.system(lanes, level), len(lanes) == vector.N
        coarser, finer = best.found if whole else of_some(best.found, lanes), follow(system)
        best = best._replace(found=finer if whole else combined([best.found, finer], _put(lanes)))
        best.steps[lanes] = len(system.steps.start) - 1
        apart, beside = vector.apart(lanes, finer, coarser)
        change = np.nan_to_num(apart.max(axis=0), nan=np.inf)
        failed[level, lanes], changes[level, lanes] = finer.stopped > 0, change
        told = np.maximum(_LUCK * change, changes[level - 1, lanes] * _BEFORE if level > 1 else 0.0)
        best.error[lanes] = np.where(failed[level, lanes], np.inf, told)
        beyond = ~(apart <= tolerance)
        first = vector.times[np.argmax(beyond, axis=0)]
        best.unresolved[lanes] = np.where(beyond.any(axis=0), first, np.nan)
        agree = np.abs(finer.ended - coarser.ended) <= _AGREEING * vector.times[-1]
        agree &= failed[level - 1, lanes] & (np.searchsorted(system.steps.start, finer.ended) >= _LIVED)
        near = (told <= _ENOUGH * tolerance) & (beside <= 1)
        done = np.where(failed[level, lanes], agree, near)
        if level >= _DOUBTFUL:
            done |= _hopeless(changes[: level + 1, lanes], failed[: level + 1, lanes])
        lanes = lanes[~done]
        if not len(lanes):
            break
    return best


def _put(lanes: Places) -> Callable[[Array, Array], Array]:
    """What replaces some lanes of an array by those of another."""

    def put(whole: Array, part: Array) -> Array:
        whole = whole.copy()
        whole[..., lanes] = part
        return whole

    return put


def _hopeless(changes: Array, failed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether smaller steps do not help: a change that stays, or a lane that is stopped at every level."""
    now, then = changes[-1], changes[-1 - _PATIENCE]
    stays = np.isfinite(now) & np.isfinite(then) & (now > 0.5 * then)
    return np.asarray(stays | failed[-1 - _PATIENCE :].all(axis=0))

"""Whether the tube keeps away from obstacles: boxes about the plan against discs and polygons.

A plan, and the boxes of a family, are connected: if no box about it meets an edge, all of it lies on one side, and one
point tells on which. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.sampled_loop.cells import Cells, cells_of
from tubecert.sampled_loop.record import Cleared
from tubecert.sampled_loop.setting import Loop
from tubecert.spec import Obstacle
from tubecert.verdict import Verdict

_WINDOWS: Final = 2048


def cleared(loop: Loop, W: Array, starts: Sequence[int]) -> tuple[Cleared, ...]:
    """Every obstacle of the specification, against the tube W (g, n) of stages that begin at samples `starts`."""
    if not loop.spec.obstacles:
        return ()
    cells = cells_of(loop, _WINDOWS)
    widths = _widths(loop, cells, W, starts)
    found = []
    for index, obstacle in enumerate(loop.spec.obstacles):
        pair = [loop.model.states.index(name) for name in obstacle.states]
        box = cells.x[:, pair] + Interval(-widths[:, pair], widths[:, pair])
        away = _apart(obstacle, box)
        found.append(Cleared(index=index, verdict=Verdict.CERTIFIED if away else Verdict.UNDECIDED))
    return tuple(found)


def _widths(loop: Loop, cells: Cells, W: Array, starts: Sequence[int]) -> Array:
    """The widest stage that may last in each cell, (N, n): the plan's time is that of the loop, unless it repeats."""
    if loop.afterwards == "repeat" or not np.isfinite(cells.t.hi).all():
        return np.repeat(W.max(axis=0)[None], len(cells), axis=0)
    Ts = loop.sample_time
    begins = np.array([fraction_bounds(Ts * k)[0] for k in starts])
    ends = np.array([*(fraction_bounds(Ts * k)[1] for k in starts[1:]), np.inf])
    last = cells.t.hi.max() if loop.afterwards == "rest" else np.inf
    later = np.where(cells.t.hi >= last, np.inf, cells.t.hi)
    meets = (begins[None] <= later[:, None]) & (ends[None] >= cells.t.lo[:, None])
    return np.asarray(np.max(np.where(meets[:, :, None], W[None], 0.0), axis=1))


def _apart(obstacle: Obstacle, box: Interval) -> bool:
    """Whether boxes (N, 2) about what is connected are proven not to meet an obstacle."""
    if obstacle.radius is not None:
        centre = Interval(*np.array([fraction_bounds(c) for c in obstacle.center]).T)
        square = (box - centre).sanitised().mignitude ** 2 * (1 - 1e-14)
        return bool(
            (square[:, 0] + square[:, 1] > fraction_bounds(obstacle.radius**2)[1] * (1 + 1e-14)).all()
        )
    corners = [Interval(*np.array([fraction_bounds(c) for c in corner]).T) for corner in obstacle.polygon]
    missed = (_missed(a, b, box).all() for a, b in pairwise([*corners, corners[0]]))
    return all(missed) and not obstacle.contains(*map(Fraction, box.mid[0]))


def _missed(a: Interval, b: Interval, box: Interval) -> NDArray[np.bool_]:
    """Whether the edge from a to b misses boxes (N, 2): separated along an axis, or by the line through it."""
    low, high = np.minimum(a.lo, b.lo), np.maximum(a.hi, b.hi)
    axis = ((box.lo > high) | (box.hi < low)).any(axis=1)
    side = (b[0] - a[0]) * (box[:, 1] - a[1]) - (b[1] - a[1]) * (box[:, 0] - a[0])
    return np.asarray(axis | (side.lo > 0) | (side.hi < 0))

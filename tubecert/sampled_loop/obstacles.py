"""Whether the tube keeps away from obstacles: boxes about the plan against discs and polygons. Trusted: yes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval, fraction_bounds
from tubecert.sampled_loop.cells import Cells, cells_of
from tubecert.sampled_loop.record import Cleared
from tubecert.sampled_loop.setting import Loop
from tubecert.spec.types import Obstacle
from tubecert.verdict import Verdict

_WINDOWS: Final = 2048
Truths = NDArray[np.bool_]


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
        away = bool(np.all(_apart(obstacle, box)))
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


def _apart(obstacle: Obstacle, box: Interval) -> Truths:
    """Whether boxes (N, 2) are proven not to meet an obstacle, (N,)."""
    if obstacle.radius is not None:
        centre = Interval(*np.array([fraction_bounds(c) for c in obstacle.center]).T)
        away = (box - centre).sanitised().mignitude
        square = away * away
        distance = np.sqrt(square[:, 0] + square[:, 1]) * (1 - 1e-14)
        return np.asarray(distance > fraction_bounds(obstacle.radius)[1])
    corners = [Interval(*np.array([fraction_bounds(c) for c in corner]).T) for corner in obstacle.polygon]
    apart = _outside(corners, box)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        apart = apart & _missed(a, b, box)
    return apart


def _missed(a: Interval, b: Interval, box: Interval) -> Truths:
    """Whether the edge from a to b misses boxes: separated along an axis, or by the line through it."""
    low, high = np.minimum(a.lo, b.lo), np.maximum(a.hi, b.hi)
    axis = ((box.lo > high) | (box.hi < low)).any(axis=1)
    side = (b[0] - a[0]) * (box[:, 1] - a[1]) - (b[1] - a[1]) * (box[:, 0] - a[0])
    return np.asarray(axis | (side.lo > 0) | (side.hi < 0))


def _outside(corners: Sequence[Interval], box: Interval) -> Truths:
    """Whether a point of each box is outside the polygon: a ray to the right meets its edges an even number of times.

    An edge counts if it spans the height of the point in the half-open sense; where an edge cannot be told to lie left
    or right, or a corner to lie above or below, nothing is proven. If no edge meets a box, the box is on one side.
    """
    x, y = 0.5 * (box.lo[:, 0] + box.hi[:, 0]), 0.5 * (box.lo[:, 1] + box.hi[:, 1])
    odd, known = np.zeros(len(x), dtype=bool), np.ones(len(x), dtype=bool)
    px, py = Interval.exact(x), Interval.exact(y)
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        known &= (a.lo[1] > y) | (a.hi[1] <= y)
        rises, falls = (a.hi[1] <= y) & (b.lo[1] > y), (b.hi[1] <= y) & (a.lo[1] > y)
        side = (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0])
        left, right = side.lo > 0, side.hi < 0
        known &= ~(rises | falls) | left | right
        odd ^= (rises & left) | (falls & right)
    return np.asarray(known & ~odd)

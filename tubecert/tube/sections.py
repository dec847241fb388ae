"""What the tube is at one time: the ball of radius rho around x*(t), or an ellipsoid cut to half-widths.

A section cuts boxes of some of the states to what its projection to them can reach, and pulls points into it. Both are
proven: whatever is cut off lies outside, whatever is called inside lies inside. Trusted: yes.
Implements: (omega_norm_ball); theory 1a.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tubecert.coordinates import Coordinates, Rows
from tubecert.enclosure.interval import Array, Interval, fraction_bounds, sqrt
from tubecert.enclosure.outward import down, up
from tubecert.expression.matrix import is_positive_semidefinite

Cut = tuple[Array, Array, NDArray[np.bool_]]
# of a projection's factor, given away until the rest is proven
_SHARES = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2, 0.3)
_SLACK = 2e-14  # relative: sums of at most 80 terms, and one difference of them
_INNER = 1 - 1e-9


class Section(Protocol):
    """The tube at one time, relative to the plan's `centre`; columns are those of the states `which`."""

    def cut(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> Cut:
        """Boxes (N, k) cut to what can be reached, and which of them may meet the section."""
        ...

    def pull(self, which: list[int], points: Array, centre: Interval) -> tuple[Array, NDArray[np.bool_]]:
        """Points (N, k) moved towards the centre where need be, and which of them are proven inside."""
        ...

    def crosses(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> NDArray[np.bool_]:
        """Whether boxes reach beyond the section, (N,); it only steers a search."""
        ...


class Ball:
    """|x - x*| <= rho."""

    def __init__(self, rho: float) -> None:
        self.rho = rho

    def cut(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> Cut:
        """Every coordinate, by the gaps between box and plan in all others."""
        del which
        # squared gaps between box and plan, rounded down, coordinate by coordinate
        gap = np.maximum(0.0, np.maximum(down(lo - centre.hi), down(centre.lo - hi)))
        square = np.maximum(0.0, down(gap * gap))
        square = np.where(np.isfinite(square), square, 0.0)
        # the gaps in all other coordinates: sums of at most 32 terms, each a bound, 32 u < 90 u <= 1e-14
        others = square @ (1.0 - np.eye(lo.shape[1]))
        room = up(up(np.square(self.rho)) - down(others * (1 - 1e-14)))
        alive = np.all(room >= 0, axis=1)
        # a root and a product are rounded, 2 u; 1e-15 > 9 u
        reach = up(np.sqrt(up(np.maximum(room, 0.0))) * (1 + 1e-15))
        return np.maximum(lo, down(centre.lo - reach)), np.minimum(hi, up(centre.hi + reach)), alive

    def pull(self, which: list[int], points: Array, centre: Interval) -> tuple[Array, NDArray[np.bool_]]:
        """Along the radius."""
        del which
        offset = points - centre.mid
        length = np.sqrt(np.sum(offset * offset, axis=1, keepdims=True))
        blur = np.sum(centre.hi - centre.lo + 1e-15 * centre.magnitude, axis=1, keepdims=True)
        reach = np.maximum(self.rho * _INNER - 2 * blur, 0.0)
        scale = np.minimum(1.0, reach / np.maximum(length, 1e-300))
        moved = centre.mid + scale * offset
        distance = (Interval.exact(moved) - centre) ** 2
        # a sum of at most 32 terms that are bounds already, as in `cut`
        total = distance.hi.sum(axis=1) * (1 + 1e-14)
        return moved, total <= down(np.square(self.rho))

    def crosses(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> NDArray[np.bool_]:
        """By the farthest corner."""
        del which
        far = np.maximum(np.abs(hi - centre.lo), np.abs(lo - centre.hi))
        crossing: NDArray[np.bool_] = np.sum(far * far, axis=1) > np.square(self.rho)
        return crossing


class Ellipsoid:
    """|S (x - x*)| <= rho and |x_i - x*_i| <= sides_i, floats; `sides` (n,) may be infinite.

    Of a function of some states, the sides of the others are left out: what is proven of it holds on a larger set,
    which a search can close in on, unlike the projection of the intersection. For some of the states, R with |R y| <=
    |S x| for every x with these components y stands for S: then |R y| <= rho contains the projection, and but for a
    share of 1e-10 it is no larger.
    """

    def __init__(self, coordinates: Coordinates, rho: float, sides: tuple[float, ...]) -> None:
        self._coordinates, self._rho, self._sides = coordinates, rho, np.array(sides)

    @cached_property
    def _extent(self) -> Array:
        """What |x_i - x*_i| can be, (n,)."""
        spread = self._coordinates.spread
        widest = [
            float((sqrt(Interval.of(row[i])) * Interval.exact(self._rho)).hi) for i, row in enumerate(spread)
        ]
        extent: Array = np.minimum(self._sides, np.array(widest))
        return extent

    def cut(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> Cut:
        """First to the half-widths, then by each row of R: what the others leave of rho, and of the row's own range."""
        if not which:
            return lo, hi, np.ones(len(lo), dtype=bool)
        extent = self._extent[which]
        offset = Interval(lo, hi) - centre
        y = Interval(np.maximum(offset.lo, -extent), np.minimum(offset.hi, extent))
        alive = np.all(y.lo <= y.hi, axis=1)
        y = Interval(np.minimum(y.lo, extent), np.maximum(y.hi, -extent))  # what is empty, too, stays finite
        R = factor(self._coordinates, tuple(which))
        terms, rest = _rows(R, y)
        gap = np.maximum(0.0, down(np.square(rest.mignitude)))
        others = gap @ (1.0 - np.eye(len(which)))
        room = up(up(np.square(self._rho)) - down(others * (1 - _SLACK)))
        alive &= np.all(room >= 0, axis=1)
        reach = up(np.sqrt(up(np.maximum(room, 0.0))) * (1 + 1e-15))
        for k in range(len(which)):
            for j in range(len(which)):
                if R.lo[k, j] * R.hi[k, j] > 0:
                    remaining = Interval(
                        _without(rest.lo[:, k], terms.lo[:, k, j], terms[:, k], -1),
                        _without(rest.hi[:, k], terms.hi[:, k, j], terms[:, k], 1),
                    )
                    found = (Interval(-reach[:, k], reach[:, k]) - remaining) / R[k, j]
                    y.lo[:, j] = np.fmax(y.lo[:, j], found.lo)
                    y.hi[:, j] = np.fmin(y.hi[:, j], found.hi)
        alive &= np.all(y.lo <= y.hi, axis=1)
        return np.maximum(lo, down(centre.lo + y.lo)), np.minimum(hi, up(centre.hi + y.hi)), alive

    def pull(self, which: list[int], points: Array, centre: Interval) -> tuple[Array, NDArray[np.bool_]]:
        """Into the half-widths, then along the radius; the other states are chosen such that |S x| is least."""
        if not which:
            return points, np.ones(len(points), dtype=bool)
        sides = self._sides[which] * _INNER
        offset = np.clip(points - centre.mid, -sides, sides)
        whole = self.completed(which, offset)
        blur = np.sum(centre.hi - centre.lo + 1e-15 * centre.magnitude, axis=1, keepdims=True)
        S = np.array(self._coordinates.rows, dtype=float)
        length = np.sqrt(np.sum((whole @ S.T) ** 2, axis=1, keepdims=True))
        reach = np.maximum(self._rho * _INNER - 2 * blur * np.abs(S).sum(), 0.0)
        whole = np.minimum(1.0, reach / np.maximum(length, 1e-300)) * whole
        moved = centre.mid + whole[:, which]
        lo, hi = whole.copy(), whole.copy()
        blurred = Interval.exact(moved) - centre
        lo[:, which], hi[:, which] = blurred.lo, blurred.hi
        y = Interval(lo, hi)
        _, z = _rows(enclosed(self._coordinates.rows), y)
        total = up(np.square(z.magnitude)).sum(axis=1) * (1 + _SLACK)
        inside = (total <= down(np.square(self._rho))) & np.all(
            y[:, which].magnitude <= self._sides[which], axis=1
        )
        return moved, inside

    def crosses(self, which: list[int], lo: Array, hi: Array, centre: Interval) -> NDArray[np.bool_]:
        """By the largest values of the rows of R, and by the half-widths."""
        if not which:
            return np.zeros(len(lo), dtype=bool)
        offset = Interval(lo, hi) - centre
        _, z = _rows(factor(self._coordinates, tuple(which)), offset)
        beyond = np.any(offset.magnitude > self._sides[which], axis=1)
        crossing: NDArray[np.bool_] = beyond | (np.sum(z.magnitude**2, axis=1) > self._rho**2)
        return crossing

    def completed(self, which: list[int], y: Array) -> Array:
        """The x (N, n) of least |S x| with the components y (N, k); a proposal."""
        spread = np.array(self._coordinates.spread, dtype=float)
        scale = np.sqrt(np.diag(spread))
        ratio = spread / np.outer(scale, scale)
        C = ratio[:, which] @ np.linalg.pinv(ratio[np.ix_(which, which)])
        C = np.asarray(C * scale[:, None] / scale[which])
        C[which] = np.eye(len(which))
        return np.asarray(y @ C.T)


def _rows(R: Interval, y: Interval) -> tuple[Interval, Interval]:
    """R_kj y_j, (N, K, k), and their sums over j, (N, K)."""
    terms = R[None] * Interval(y.lo[:, None, :], y.hi[:, None, :])
    size = terms.magnitude.sum(axis=2) * _SLACK
    return terms, Interval(down(terms.lo.sum(axis=2) - size), up(terms.hi.sum(axis=2) + size))


def _without(total: Array, own: Array, terms: Interval, sign: int) -> Array:
    """A sum of ends without one of its terms: the difference, less what was rounded."""
    slack = terms.magnitude.sum(axis=1) * (2 * _SLACK)
    return up(total - own + slack) if sign > 0 else down(total - own - slack)


def enclosed(rows: Rows) -> Interval:
    """A rational matrix, rounded outward."""
    ends = np.array([[fraction_bounds(value) for value in row] for row in rows])
    return Interval(ends[..., 0], ends[..., 1])


@lru_cache(maxsize=256)
def factor(coordinates: Coordinates, which: tuple[int, ...]) -> Interval:
    """R (K, k) with |R y| <= |S x| for all x with the components y = x[which]: S itself for all states."""
    n = len(coordinates.rows)
    if len(which) == n:
        return enclosed(tuple(tuple(row[i] for i in which) for row in coordinates.rows))
    R = _proposed(coordinates, which)
    for share in _SHARES:
        rows = R * (1 - share)
        if np.all(np.isfinite(rows)) and _below(coordinates, which, rows):
            return Interval.exact(rows)
    return Interval.exact(np.zeros((len(which), len(which))))


def _proposed(coordinates: Coordinates, which: tuple[int, ...]) -> Array:
    """A factor of the inverse of the spread's block, in floats: R'R = (spread_VV)^-1."""
    block = np.array([[float(coordinates.spread[i][j]) for j in which] for i in which])
    scale = np.sqrt(np.diag(block))
    values, vectors = np.linalg.eigh(block / np.outer(scale, scale))
    with np.errstate(all="ignore"):
        return np.asarray((vectors / np.sqrt(values)).T / scale)


def _below(coordinates: Coordinates, which: tuple[int, ...], R: Array) -> bool:
    """Whether S'S - [R'R 0; 0 0] >= 0, in exact arithmetic."""
    rows = [[Fraction(float(value)) for value in row] for row in R]
    rest = [list(row) for row in coordinates.gram]
    for p, i in enumerate(which):
        for q, j in enumerate(which):
            rest[i][j] -= sum((row[p] * row[q] for row in rows), Fraction(0))
    return is_positive_semidefinite(tuple(tuple(row) for row in rest))

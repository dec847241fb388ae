"""Enclosures of matrix functions over boxes that converge quadratically.

With c the centre and r the radii of a box X, d = x - c, and second derivatives G_ij(X) within H_ij -+ D_ij, every x in
X has elementwise
    G(x) = G(c) + sum_i d_i G_i(c) + sum_{i<j} d_i d_j H_ij + sum_i r_i^2/4 H_ii + R,
    |R| <= sum_i r_i^2/4 |H_ii| + 1/2 sum_ij r_i r_j D_ij,
because d_i^2/2 lies in r_i^2/4 -+ r_i^2/4. The part without R is affine in each d_i (the others fixed), so a convex
function of it is largest at one of the sign vertices. Variables in which
every entry is affine (the others fixed) are not expanded at all: there the vertices of the box are exact.
A norm (|x|, in h only) has a generalised gradient but no second derivative: such functions are enclosed to first order,
and functions that contain the gradient itself by their natural interval extension. A table's function has a Lipschitz
gradient, its derivative is expanded to first order, its second derivative not at all (theory 1b).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import midrad
from tubecert.enclosure.tape import Tape
from tubecert.enclosure.vertices import Balls
from tubecert.expression import ZERO, Expression, derivatives, free_symbols, topological

Matrix = Sequence[Sequence[Expression]]
MOST_VERTICES = 8  # variables expanded into vertices; more are bounded by their slopes
_LEAST_RADIUS = 1e-140  # a larger radius is a valid one, and the product of two must not underflow


@dataclass(frozen=True, slots=True)
class Expansion:
    """One batch of boxes: N boxes, V vertices, K matrices; vertex v belongs to the end v mod A of the affine variables.

    `mid[k]`: the affine part of matrix k at the vertices, shape (N, V, p_k, q_k);
    `rad[k]`, `size[k]`: its radius at each of the A ends, and a bound of |mid[k]|, shape (N, A, p_k, q_k);
    `rest[k]`: bound of |R| elementwise, split by the variable that causes it, shape (d, N, A, p_k, q_k);
    `signs`: shape (V, d), -1, 0 or 1 for each variable of the function (0: not expanded into vertices).
    """

    mid: list[Array]
    rad: list[Array]
    size: list[Array]
    rest: list[Array]
    signs: Array

    def of(self, boxes: NDArray[np.intp]) -> Expansion:
        """Those of some boxes."""
        mid, rad, size = ([a[boxes] for a in each] for each in (self.mid, self.rad, self.size))
        return Expansion(mid, rad, size, [rest[:, boxes] for rest in self.rest], self.signs)

    def filled(self, k: int) -> Array:
        """The radius of matrix k with the rest of every variable in it, (N, A, p, q)."""
        # a sum over at most 80 variables: 80 u < 90 u <= 1e-14
        return np.asarray((self.rad[k] + self.rest[k].sum(axis=0)) * (1 + 1e-14))

    def balls(self) -> list[Balls]:
        """The matrices as they are known at the vertices, with all that varies in their radii."""
        parts = zip(self.mid, self.size, map(self.filled, range(len(self.mid))), strict=True)
        return [Balls(mid, size, rad) for mid, size, rad in parts]

    def over_vertices(self, by_end: Array) -> Array:
        """What is known at the ends, (N, A, ...), at the vertices, (N, V, ...)."""
        repeats = len(self.signs) // by_end.shape[1]
        return np.tile(by_end, (1, repeats, *(1 for _ in by_end.shape[2:])))


class MatrixFunction:
    """Matrices of expressions in `variables`, with tapes for values, slopes and curvature.

    `order` limits the order of the expansion (2: vertex form, 1: mean value form, 0: natural extension). In `fixed`
    variables nothing is expanded: they are data, known up to a rounding, and enter with their whole range.
    """

    def __init__(
        self, matrices: Sequence[Matrix], order: int = 2, fixed: frozenset[str] = frozenset()
    ) -> None:
        entries = [e for matrix in matrices for row in matrix for e in row]
        self.shapes = [(len(matrix), len(matrix[0])) for matrix in matrices]
        self.variables = tuple(sorted(free_symbols(entries)))
        nodes = topological(entries)
        self._order = min([order, *map(_smoothness, nodes)])
        # of tables alone: how entries depend on other variables is not touched by their knots
        self._steady = self._order == 2 or (
            self._order == 1 and order == 2 and all(node.op != "norm" for node in nodes)
        )
        free = tuple(v for v in self.variables if v not in fixed)
        self._fixed = [i for i, v in enumerate(self.variables) if v in fixed]
        first = {v: derivatives(entries, v) for v in free} if self._order else {}
        self._affine, self._curved = self._classify(free, first)
        self._values = _Table(entries, self.variables)
        self._slopes = _Table([e for v in self._curved for e in first.get(v, [])], self.variables)
        curvature = []
        if self._order == 2:
            for i, v in enumerate(self._curved):
                for w in self._curved[i:]:
                    curvature += derivatives(first[v], w)
        self._curvature = _Table(curvature, self.variables)

    @property
    def size(self) -> int:
        """About how much work a box is: numbers that are computed for it."""
        entries = sum(p * q for p, q in self.shapes)
        vertices = 1 << min(len(self._curved), MOST_VERTICES)
        return vertices * entries * (1 + len(self._curved))

    @staticmethod
    def _of(points: Array, lo: Array, hi: Array, fixed: list[int]) -> Interval:
        """The points, with the whole range of the fixed variables."""
        if not fixed:
            return Interval.exact(points)
        low, high = points.copy(), points.copy()
        low[:, fixed], high[:, fixed] = lo[:, fixed], hi[:, fixed]
        return Interval(low, high)

    def _classify(
        self, free: tuple[str, ...], first: dict[str, list[Expression]]
    ) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Variables in which every entry is affine, and the others."""
        if not self._steady:
            return (), free
        affine = tuple(v for v in free if all(e is ZERO for e in derivatives(first[v], v)))[:MOST_VERTICES]
        return affine, tuple(v for v in free if v not in affine)

    @property
    def is_zero(self) -> bool:
        """Whether every entry is the constant 0."""
        return all(e is ZERO for e in self._values.outputs)

    def at(self, lo: Array, hi: Array) -> list[Interval]:
        """Enclosures over thin boxes (points), a list over matrices of shape (N, p, q)."""
        return self._unpack(self._values.run(Interval(lo, hi)), self.shapes)

    def floats(self, points: Array) -> list[Array]:
        """Float values at points of shape (N, d), each (N, p, q)."""
        return _split(self._values.run_floats(points), self.shapes)

    def expand(self, lo: Array, hi: Array) -> Expansion:
        """Enclose the function over N boxes; `lo` and `hi` have shape (N, d)."""
        if self._order == 0:
            return self._natural(lo, hi)
        count, dim = lo.shape
        column = {v: i for i, v in enumerate(self.variables)}
        centre = np.clip(0.5 * lo + 0.5 * hi, lo, hi)
        radius = np.maximum(np.nextafter(np.maximum(hi - centre, centre - lo), np.inf), _LEAST_RADIUS)
        corners = [column[v] for v in self._affine]
        curved = [column[v] for v in self._curved]
        # all combinations of ends of the affine variables, stacked as (A N, d)
        choices = list(product((-1.0, 1.0), repeat=len(corners)))
        point = np.repeat(centre[None], len(choices), axis=0)
        box_lo, box_hi = np.repeat(lo[None], len(choices), axis=0), np.repeat(hi[None], len(choices), axis=0)
        for a, choice in enumerate(choices):
            for sign, i in zip(choice, corners, strict=True):
                end = lo[:, i] if sign < 0 else hi[:, i]
                point[a, :, i] = box_lo[a, :, i] = box_hi[a, :, i] = end
        point, box_lo, box_hi = (x.reshape(len(choices) * count, dim) for x in (point, box_lo, box_hi))
        expanded = curved[: max(0, MOST_VERTICES - len(corners))] if self._steady else []
        flips = np.array(list(product((-1.0, 1.0), repeat=len(expanded))))
        thin = self._of(point, box_lo, box_hi, self._fixed)
        base = self._unpack(self._values.run(thin), self.shapes)
        here, second = self._derivatives(thin, box_lo, box_hi, len(curved))
        stacked_radius = np.tile(radius, (len(choices), 1))
        mids, rads, sizes, rests = [], [], [], []
        for k, value in enumerate(base):
            mid, rad = midrad(value)
            rest = np.zeros((dim, *mid.shape))
            steps: list[Array] = []
            bends: list[tuple[int, int, Array]] = []  # of two variables in `expanded`, at the vertex (1, 1)
            shifts: list[Array] = []
            for j, i in enumerate(curved):
                r = stacked_radius[:, i][:, None, None]
                slope_mid, slope_rad = midrad(here[j][k])
                if i in expanded:
                    steps.append(r * slope_mid)
                    # the product r * slope_mid is rounded once: by u of itself, u = 2**-53 < 1.2e-16
                    if second:
                        rad = rad + r * (slope_rad + 4e-16 * np.abs(slope_mid))
                    else:  # a slope over the whole box
                        rad = rad + r * (4e-16 * np.abs(slope_mid))
                        rest[i] += r * slope_rad
                else:
                    rest[i] += r * (np.abs(slope_mid) + slope_rad)
                for j2, i2 in enumerate(curved if second else []):
                    pair_mid, pair_rad = _known(second[min(j, j2)][max(j, j2) - min(j, j2)][k])
                    area = r * stacked_radius[:, i2][:, None, None]
                    if i == i2 and i in expanded:
                        shifts.append(0.25 * area * pair_mid)
                        rest[i] += area * (0.25 * np.abs(pair_mid) + 0.5 * pair_rad)
                    elif i in expanded and i2 in expanded:
                        rest[i] += 0.5 * area * pair_rad
                        if j < j2:
                            bends.append((j, j2, area * pair_mid))
                    else:
                        rest[i] += 0.5 * area * (np.abs(pair_mid) + pair_rad)
            mid = mid + sum(shifts, start=np.zeros(()))
            lifted = mid[None] + sum(
                (flips[:, s][:, None, None, None] * step[None] for s, step in enumerate(steps)),
                start=np.zeros((len(flips), 1, 1, 1)),
            )
            for s, s2, bend in bends:
                lifted = lifted + (flips[:, s] * flips[:, s2])[:, None, None, None] * bend[None]
            parts = [np.abs(part) for part in (mid, *steps, *shifts, *(bend for _, _, bend in bends))]
            # k parts, each a product rounded at most twice, are added with at most k - 1 roundings: the error is below
            # (k + 1) u (1 + 2 k u) times the sum of their magnitudes (Higham 2002, eq. 4.4); 4e-16 > 3.6 u
            size = sum(parts[1:], start=parts[0])
            slack = 4e-16 * (len(parts) + 2) * size
            mids.append(_fold(lifted, len(choices)))
            # at most 8 variables are expanded: 8 additions, 4 roundings in each term, this sum and product, 14 u; 36 u
            rads.append(_fold(((rad + slack) * (1 + 4e-15))[None], len(choices)))
            # a sum of at most 45 parts, here and at the vertices: 90 u < 2e-14
            sizes.append(_fold((size * (1 + 2e-14))[None], len(choices)))
            # 5 roundings in each term and an addition for each of at most 80 variables: 86 u < 90 u <= 1e-14
            rests.append(_fold((rest * (1 + 1e-14))[:, None], len(choices)))
        signs = np.zeros((len(flips) * len(choices), dim))
        for v, (flip, choice) in enumerate(product(flips, choices)):
            signs[v, expanded], signs[v, corners] = flip, choice
        return Expansion(mids, rads, sizes, rests, signs)

    def _derivatives(
        self, thin: Interval, box_lo: Array, box_hi: Array, curved: int
    ) -> tuple[list[list[Interval]], list[list[list[Interval]]]]:
        """Slopes by variable (over the box where there is no curvature), and curvature by pair."""
        if not curved:
            return [], []
        where = thin if self._order == 2 else Interval(box_lo, box_hi)
        slopes = self._unpack(self._slopes.run(where), self.shapes * curved)
        k = len(self.shapes)
        here = [slopes[j * k : (j + 1) * k] for j in range(curved)]
        if self._order < 2:
            return here, []
        pairs = curved * (curved + 1) // 2
        flat = self._unpack(self._curvature.run(Interval(box_lo, box_hi)), self.shapes * pairs)
        second, start = [], 0
        for j in range(curved):
            second.append([flat[(start + s) * k : (start + s + 1) * k] for s in range(curved - j)])
            start += curved - j
        return here, second

    def _natural(self, lo: Array, hi: Array) -> Expansion:
        mids, rads = zip(
            *((mid[:, None], rad[:, None]) for mid, rad in map(midrad, self.at(lo, hi))), strict=True
        )
        rests = [np.zeros((lo.shape[1], *mid.shape)) for mid in mids]
        signs = np.zeros((1, lo.shape[1]))
        return Expansion(list(mids), list(rads), [np.abs(mid) for mid in mids], rests, signs)

    @staticmethod
    def _unpack(values: Interval, shapes: Sequence[tuple[int, int]]) -> list[Interval]:
        return [
            Interval(lo, hi)
            for lo, hi in zip(_split(values.lo, shapes), _split(values.hi, shapes), strict=True)
        ]


def _smoothness(node: Expression) -> int:
    """How often a node may be differentiated in an expansion: twice if nothing stands against it."""
    if node.op == "table":
        return max(0, 2 - node.lookup.order)
    return {"direction": 0, "norm": 1}.get(node.op, 2)


class _Table:
    """A tape that evaluates each distinct expression once and returns them all."""

    def __init__(self, outputs: list[Expression], variables: tuple[str, ...]) -> None:
        self.outputs = outputs
        distinct = list(dict.fromkeys(outputs))
        place = {e: i for i, e in enumerate(distinct)}
        self._index = np.array([place[e] for e in outputs], dtype=np.intp)
        self._tape = Tape(distinct, variables)

    def run(self, x: Interval) -> Interval:
        """Enclosures at N boxes (N, d): shape (outputs, N)."""
        columns = [x[:, i] if x.lo is not x.hi else Interval.exact(x.lo[:, i]) for i in range(x.lo.shape[1])]
        return self._tape.run(columns, (x.lo.shape[0],))[self._index]

    def run_floats(self, x: Array) -> Array:
        """Float values at N points (N, d): shape (outputs, N)."""
        return self._tape.run_floats(list(x.T), (x.shape[0],))[self._index]


def _split(values: Array, shapes: Sequence[tuple[int, int]]) -> list[Array]:
    """Rows of `values` (entries, N) as matrices (N, p, q)."""
    result, start = [], 0
    for p, q in shapes:
        block = values[start : start + p * q]
        result.append(np.ascontiguousarray(block.T).reshape(-1, p, q))
        start += p * q
    return result


def _known(values: Interval) -> tuple[Array, Array]:
    """Midpoint and radius; midpoint 0 where a range is not bounded."""
    mid, rad = midrad(values)
    known = np.isfinite(mid) & np.isfinite(rad)
    return np.where(known, mid, 0.0), np.where(known, rad, np.inf)


def _fold(values: Array, choices: int) -> Array:
    """(..., F, A N, p, q) -> (..., N, F A, p, q)."""
    *more, flips, stacked, p, q = values.shape
    count = stacked // choices
    turned = np.moveaxis(values.reshape(*more, flips, choices, count, p, q), -3, len(more))
    return np.ascontiguousarray(turned).reshape(*more, count, flips * choices, p, q)

"""A sufficient test for unique minimising geodesics in the tube, from the Christoffel symbols of the metric.

With G >= |Gamma(x)| and L >= |dGamma(x)| over O(rho), as multilinear maps between Euclidean spaces,
    G rho + L rho^2/8 < 1
makes the geodesic of length below dbar = sqrt(a) rho from x*(t) to any state unique, free of conjugate points,
and hence the minimiser. In: a model and the tube as a domain. Out: the value of the test, proven on both sides.
Implements: theory (5.1) and (5.2). Trusted: yes.

From W alone: with M = W^-1, W_i = dW/dx_i and D_i = W_i M, S_i = M W_i M, the symbols are
    Gamma^k_ij = (-(D_i)_kj - (D_j)_ki + sum_l W_kl (S_l)_ij)/2,
and their derivatives need dM/dx_m = -S_m only. Multilinear norms are hard to compute; the spectral norm of
any unfolding of a tensor into a matrix is an upper bound, and the least of several is bounded over boxes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product as choices
from typing import Final

import numpy as np

from tubecert.coordinates import Fields
from tubecert.enclosure.branch_and_bound import Effort, Supremum, supremum
from tubecert.enclosure.constant import Constant
from tubecert.enclosure.domain import Domain
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues_midrad,
    midrad,
    product,
    spectral_norm_midrad,
    whitening,
)
from tubecert.enclosure.objective import Estimate, Target
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO

Ball = tuple[Array, Array]  # midpoints and radii

_FINE: Final = 2e-3
_BUDGET: Final = 8_000  # boxes: the test is sufficient only, it need not be sharp
_ENTRIES: Final = 2_000_000  # of tensors held at once
_SLACK: Final = 1e-14  # relative: 90 u, covers sums of at most 80 terms in floats (Higham 2002, eq. 3.5)


@dataclass(frozen=True, slots=True, kw_only=True)
class GeodesicTest:
    """The value of G rho + L rho^2/8 and whether it is proven to be below 1.

    `symbols` encloses G and `slope` L (`slope` is None where G alone fails the test).
    """

    value: Constant
    symbols: Constant
    slope: Constant | None

    @property
    def holds(self) -> bool:
        """Whether minimising geodesics in the tube are proven to be unique."""
        return self.value.above < 1


def unique_geodesics(fields: Fields, tube: Domain, rho: float, effort: Effort) -> GeodesicTest:
    """Evaluate the test over a tube of radius `rho`, both in the coordinates of the fields; a constant metric passes.

    Its value is 0 then.
    """
    if not _moving(fields):
        nothing = Constant.exactly(0.0)
        return GeodesicTest(value=nothing, symbols=nothing, slope=nothing)
    # what matters is the sum against 1: a five-hundredth of that for either part is fine enough
    G = _bounded(SymbolNorm(fields, order=0), tube, _FINE / rho, effort)
    if G.below * rho * (1 - _SLACK) >= 1:
        return GeodesicTest(
            value=Constant(below=G.below * rho * (1 - _SLACK), above=np.inf), symbols=G, slope=None
        )
    L = _bounded(SymbolNorm(fields, order=1), tube, 8 * _FINE / rho**2, effort)
    radius = Interval.exact(rho)
    value = Interval(G.below, G.above) * radius + Interval(L.below, L.above) * radius**2 / 8
    return GeodesicTest(
        value=Constant(below=float(value.lo), above=float(value.sanitised().hi)), symbols=G, slope=L
    )


def _bounded(objective: SymbolNorm, tube: Domain, absolute: float, effort: Effort) -> Constant:
    coarse = Effort(
        gap=0.02,
        absolute=absolute,
        budget=min(effort.budget, _BUDGET),
        cheap=0,
        progress=effort.progress,
    )
    found = supremum(objective, tube, coarse)
    return Constant(below=min(objective.attained(found), found.above), above=found.above)


def _moving(fields: Fields) -> list[int]:
    """The components of z on which the metric depends."""
    return [i for i, w in enumerate(fields.W_x) if any(e is not ZERO for row in w for e in row)]


class SymbolNorm:
    """An upper bound of |Gamma| (`order` 0) or |dGamma| (`order` 1): the least norm of several unfoldings.

    It is at most a power of sqrt(n) above the norm itself; `attained` tells what the norm itself reaches.
    """

    def __init__(self, fields: Fields, *, order: int) -> None:
        self._n, self._order = len(fields.states), order
        self._moving = _moving(fields)
        first = [fields.W_x[i] for i in self._moving]
        slopes = [fields.slopes(w) for w in first] if order else []
        second = [slope[m] for m in self._moving for slope in slopes]
        self._function = MatrixFunction([fields.W, *first, *second], order=0)
        self.variables = self._function.variables
        self._lengths = fields.lengths(self.variables)
        self._slope = None if order else SymbolNorm(fields, order=1)

    def tensor(self, lo: Array, hi: Array) -> Ball:
        """Gamma, shape (N, n, n, n) for k, i, j; or dGamma with a fourth axis over the moving states."""
        values = [midrad(value) for value in self._function.at(lo, hi)]
        count = len(self._moving)
        W, first = values[0], _stack(values[1 : 1 + count])
        M = _inverse(W)
        D = product(first, _expand(M))  # D_i = W_i M, axis 1 is i
        S = product(_expand(M), D)
        columns = W[0][:, :, self._moving], W[1][:, :, self._moving]
        if not self._order:
            return self._assemble(D, _weighted_forms(columns, S))
        second = [_stack(values[1 + count * (m + 1) : 1 + count * (m + 2)]) for m in range(count)]
        slopes = []
        for m in range(count):
            Dm, Sm = (_take(ball, m) for ball in (D, S))
            W_im_M = product(second[m], _expand(M))
            D_slope = _sum((1.0, W_im_M), (-1.0, product(D, Dm)))
            turned = product(Sm, D)
            S_slope = _sum((1.0, product(_expand(M), W_im_M)), (-1.0, turned), (-1.0, _transposed(turned)))
            W_m = _take(first, m)
            moved = W_m[0][:, 0][:, :, self._moving], W_m[1][:, 0][:, :, self._moving]
            forms = _sum((1.0, _weighted_forms(moved, S)), (1.0, _weighted_forms(columns, S_slope)))
            slopes.append(self._assemble(D_slope, forms))
        return np.stack([mid for mid, _ in slopes], axis=-1), np.stack([rad for _, rad in slopes], axis=-1)

    def _assemble(self, D: Ball, forms: Ball) -> Ball:
        """(-(D_i)_kj - (D_j)_ki + sum_l W_kl (S_l)_ij)/2 from D_i and the last term."""
        n = self._n
        shape = (len(D[0]), n, n, n)
        mid, rad = np.zeros(shape), np.zeros(shape)
        mid[:, :, self._moving], rad[:, :, self._moving] = (np.moveaxis(part, 1, 2) for part in D)
        return _sum((-0.5, (mid, rad)), (-0.5, _transposed((mid, rad))), (0.5, forms))

    def _unfolded(self, lo: Array, hi: Array) -> Interval:
        """The least spectral norm of the unfoldings over boxes, (N,)."""
        size = self._n**3 * (len(self._moving) ** 2 if self._order else 1)
        chunk = max(1, _ENTRIES // size)
        parts = [self._least_norm(lo[i : i + chunk], hi[i : i + chunk]) for i in range(0, len(lo), chunk)]
        return Interval(np.concatenate([p.lo for p in parts]), np.concatenate([p.hi for p in parts]))

    def _least_norm(self, lo: Array, hi: Array) -> Interval:
        mid, rad = self.tensor(lo, hi)
        # k is axis 1, i and j are 2 and 3 (symmetric), the direction of the derivative is 4
        rows: Sequence[tuple[int, ...]] = ((1,), (3,), (4,), (1, 4), (1, 3)) if self._order else ((1,), (3,))
        norms = [spectral_norm_midrad(_unfold(mid, axes), _unfold(rad, axes)) for axes in rows]
        return Interval(np.min([x.lo for x in norms], axis=0), np.min([x.hi for x in norms], axis=0))

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The bound over boxes; every variable counts by its width.

        For Gamma the smaller of the direct bound and of |Gamma(c)| + |x - c| sup |dGamma|, c the centre.
        """
        width, centre = hi - lo, np.clip(0.5 * lo + 0.5 * hi, lo, hi)
        value = self._unfolded(lo, hi).hi
        if self._slope is not None:
            reach = np.nextafter(np.maximum(hi - centre, centre - lo), np.inf)
            across = reach @ self._lengths  # |S y| by components, for every |y_i| <= reach_i
            length = np.sqrt(np.sum(across * across, axis=1)) * (1 + _SLACK)
            steep = length * self._slope._unfolded(lo, hi).hi
            value = np.fmin(value, (self._unfolded(centre, centre).hi + steep) * (1 + _SLACK))
        return Estimate(np.where(np.isnan(value), np.inf, value), centre, width, width)

    def lower(self, lo: Array, hi: Array) -> Array:
        """The same bound at points, from below."""
        return self._unfolded(lo, hi).lo

    def attained(self, found: Supremum) -> float:
        """What the norm itself is at least, at the point that was found: |T(v, w, ...)|/(|v| |w| ...)."""
        if any(name not in found.at for name in self.variables):
            return 0.0
        point = np.array([[found.at[name] for name in self.variables]])
        with np.errstate(all="ignore"):
            mid, rad = self.tensor(point, point)
        if not np.isfinite(mid).all():
            return 0.0
        vectors = alternating(mid[0])
        error = rad[0] + 1e-12 * np.abs(mid[0])
        value = abs(contracted(mid[0], vectors)) - contracted(error, [np.abs(v) for v in vectors]) * (
            1 + 1e-12
        )
        scale = float(np.prod([np.linalg.norm(v) for v in vectors])) * (1 + 1e-12)
        return max(0.0, float(value / scale) * (1 - 1e-12))


def _inverse(W: Ball) -> Ball:
    """An enclosure of W^-1 (N, n, n): T'(I + R)T, T from the midpoint, |R| from the spectrum of T W T'."""
    t = whitening(W[0])
    scaled = eigenvalues_midrad(*congruence(t, *W))
    least, largest = scaled.lo[:, 0], scaled.hi[:, -1]
    least = np.where(least > 0, least, np.nan)
    off = np.maximum(1.0 / least - 1.0, 1.0 - 1.0 / largest) * (1 + _SLACK) + _SLACK
    off = np.where(np.isnan(off), np.inf, np.maximum(off, _SLACK))
    n = t.shape[-1]
    inner = np.broadcast_to(np.eye(n), t.shape), np.broadcast_to(off[:, None, None], t.shape)
    return congruence(np.swapaxes(t, -1, -2), *inner)


def _weighted_forms(columns: Ball, S: Ball) -> Ball:
    """sum_l W_kl (S_l)_ij, shape (N, n, n, n), from columns l of W (N, n, s) and S (N, s, n, n)."""
    N, s, n = S[0].shape[:3]
    flat = S[0].reshape(N, s, n * n), S[1].reshape(N, s, n * n)
    mid, rad = product(columns, flat)
    return mid.reshape(N, -1, n, n), rad.reshape(N, -1, n, n)


def _sum(*terms: tuple[float, Ball]) -> Ball:
    """sum_k w_k (mid_k +- rad_k), the roundings put into the radius."""
    mid = sum((w * m for w, (m, _) in terms), start=np.zeros(()))
    size = sum((abs(w) * np.abs(m) for w, (m, _) in terms), start=np.zeros(()))
    rad = sum((abs(w) * r for w, (_, r) in terms), start=np.zeros(()))
    return np.asarray(mid), np.asarray(rad * (1 + _SLACK) + 1e-15 * len(terms) * size + 1e-300)


def _stack(balls: Sequence[Ball]) -> Ball:
    return np.stack([mid for mid, _ in balls], axis=1), np.stack([rad for _, rad in balls], axis=1)


def _expand(ball: Ball) -> Ball:
    return ball[0][:, None], ball[1][:, None]


def _take(ball: Ball, index: int) -> Ball:
    """One matrix of a stack, kept as a stack of one."""
    return ball[0][:, index : index + 1], ball[1][:, index : index + 1]


def _transposed(ball: Ball) -> Ball:
    return np.swapaxes(ball[0], -1, -2), np.swapaxes(ball[1], -1, -2)


def _unfold(tensor: Array, rows: tuple[int, ...]) -> Array:
    """The tensors (N, ...) as matrices, the axes `rows` against all others."""
    others = tuple(axis for axis in range(1, tensor.ndim) if axis not in rows)
    height = int(np.prod([tensor.shape[axis] for axis in rows]))
    turned = np.transpose(tensor, (0, *rows, *others))
    return np.ascontiguousarray(turned).reshape(len(tensor), height, -1)


def contracted(tensor: Array, vectors: Sequence[Array], keep: int | None = None) -> Array:
    """The tensor applied to one vector per axis, except the axis `keep`: a `tensordot`, without what that looks up."""
    for axis in reversed(range(tensor.ndim)):
        if axis != keep:
            others = (*range(axis), *range(axis + 1, tensor.ndim))
            shape = tuple(tensor.shape[other] for other in others)
            rows = tensor.transpose(*others, axis).reshape(-1, tensor.shape[axis])
            tensor = np.dot(rows, vectors[axis].reshape(-1, 1)).reshape(shape)
    return tensor


def alternating(tensor: Array) -> list[Array]:
    """Unit vectors that make |T(v, w, ...)| large, a proposal: alternating maximisation from axes."""
    best, value = [np.eye(size)[0] for size in tensor.shape], -1.0
    for start in choices(*(range(size) for size in tensor.shape[1:])):
        vectors = [
            np.ones(tensor.shape[0]),
            *(np.eye(size)[i] for size, i in zip(tensor.shape[1:], start, strict=True)),
        ]
        reached = 0.0
        for _ in range(20):
            for axis in range(tensor.ndim):
                image = contracted(tensor, vectors, axis)
                reached = float(np.linalg.norm(image))
                if reached > 0:
                    vectors[axis] = image / reached
        if reached > value:
            best, value = list(vectors), reached
        if np.prod(tensor.shape[1:]) > 100:  # one start from the best axis is enough for large tensors
            break
    return best

"""What branch and bound maximises: convex functions of matrix functions, bounded above on boxes, below at points.

Everything here is rigorous except `Estimate.corner`, `caused` and `spread`, which only steer the search.

The length of a vector in the metric, sqrt(v' W^-1 v), without an inverse or a factor of W.

With any T: v' W^-1 v = (Tv)' (T W T')^-1 (Tv), between |Tv|^2/lmax(T W T') and |Tv|^2/lmin(T W T'); T is proposed in
floats such that T W T' is nearly the identity. Being linear in v, the bound stays sharp where v nearly vanishes.

Whether the columns of a matrix B(x) are independent on a box, without minors or B'B.

If |I - R B| < 1 for any matrix R, then R B is invertible (by its Neumann series), so B v = 0 for v = 0 only. R is
proposed in floats, box by box: the pseudo-inverse in its middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues_midrad,
    finite,
    midrad,
    norm_bound,
    product,
    spectral_norm,
    spectral_norm_midrad,
    whitening,
)
from tubecert.enclosure.outward import up
from tubecert.enclosure.taylor import Expansion, Matrix, MatrixFunction


@dataclass(frozen=True, slots=True)
class Target:
    """What a search asks of its boxes.

    A box that is shown to stay at or below `enough` need not be looked at again; of one that stays at or below `floor`,
    a value that the supremum is known to reach, it does not matter how far it stays below.
    """

    enough: float
    floor: float = -np.inf


@dataclass(frozen=True, slots=True)
class Estimate:
    """Bounds over N boxes in d variables.

    `upper` (N,): proven; `corner` (N, d): a point of the box that looks large; `caused` (N, d): how much of the
    overestimate each variable causes; `spread` (N, d): how much the value varies along each variable.
    """

    upper: Array
    corner: Array
    caused: Array
    spread: Array


class Objective(Protocol):
    """A function of `variables` to be maximised."""

    variables: tuple[str, ...]

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """Bounds from above over boxes; one that can be shown to stay below what is enough is given such a bound."""
        ...

    def lower(self, lo: Array, hi: Array) -> Array:
        """Bounds from below that hold for every point of the (thin) boxes; -inf where nothing is known."""
        ...


def size_of(objective: Objective) -> int:
    """About how much work a box of an objective is, against others; it decides nothing that is proven."""
    function = getattr(objective, "_function", None)
    return function.size if isinstance(function, MatrixFunction) else 1


class SumOfNorms:
    """sum_k |G_k(x)| in the spectral norm (of a column: the Euclidean norm)."""

    def __init__(self, matrices: Sequence[Matrix], fixed: frozenset[str] = frozenset()) -> None:
        self._function = MatrixFunction(matrices, fixed=fixed)
        self.variables = self._function.variables
        self.is_zero = self._function.is_zero

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """Norm of the affine part at its vertices plus the norm of the rest."""
        e = self._function.expand(lo, hi)
        value = np.zeros(e.mid[0].shape[:2])
        caused = np.zeros((lo.shape[1], len(lo)))
        for k, (mid, rest) in enumerate(zip(e.mid, e.rest, strict=True)):
            value = (
                value
                + spectral_norm_midrad(mid, np.zeros_like(mid)).hi
                + e.over_vertices(norm_bound(e.filled(k)))
            )
            caused += norm_bound(rest.max(axis=2))
        # additions only, of bounds: one for each variable in a rest and two for each matrix, below 90 u <= 1e-14
        return estimate_of(value * (1 + 1e-14), caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Norms at points, rounded down: additions only, below 90 u <= 1e-14 (Higham 2002, eq. 3.5)."""
        total = sum((spectral_norm(g).lo for g in self._function.at(lo, hi)), start=np.zeros(len(lo)))
        return np.asarray(total * (1 - 1e-14))


@dataclass(frozen=True, slots=True, kw_only=True)
class Kinks:
    """Where an h with absolute values |a_k| has kinks: `arguments` a, (K, 1), and its Jacobian for choices of signs.

    In `branches` every |a_k| is s_k a_k, s in {-1, 1}^K; None: nothing is known of that one, as it is defined nowhere.
    """

    arguments: Matrix
    branches: Mapping[tuple[int, ...], Matrix | None]


class _Branches:
    """|dh/dx| branch by branch: smooth, so that its bound is as close as the square of a box is small.

    Only the branches that there are on a part of the box that is not flat count: a Lipschitz constant is that of almost
    every point. (Where a_k vanishes on more than that, its slope does, too, and either sign is right.)
    """

    def __init__(self, kinks: Kinks) -> None:
        self._arguments = MatrixFunction([kinks.arguments])
        self._norms = [
            (signs, None if own is None else SumOfNorms([own])) for signs, own in kinks.branches.items()
        ]
        norms = [norm for _, norm in self._norms if norm is not None]
        used = {*self._arguments.variables}.union(*(norm.variables for norm in norms))
        self.variables = tuple(sorted(used))

    def upper(self, variables: tuple[str, ...], lo: Array, hi: Array, target: Target) -> Estimate:
        """The largest branch of every box; corners are centres, as the Jacobian is not known on a kink."""
        value, caused, spread = np.zeros(len(lo)), np.zeros(lo.shape), np.zeros(lo.shape)
        columns = np.array([variables.index(v) for v in self._arguments.variables], dtype=np.intp)
        (inside,) = self._arguments.at(lo[:, columns], hi[:, columns])
        low, high = inside.lo[:, :, 0], inside.hi[:, :, 0]
        known = ~(np.isnan(low) | np.isnan(high))
        there = {1: (high > 0) | (low >= 0) | ~known, -1: (low < 0) | (high <= 0) | ~known}
        for signs, norm in self._norms:
            rows = np.flatnonzero(np.all([there[s][:, k] for k, s in enumerate(signs)], axis=0))
            if not len(rows):
                continue
            if norm is None:
                value[rows] = np.inf
                continue
            columns = np.array([variables.index(v) for v in norm.variables], dtype=np.intp)
            own = norm.upper(lo[rows][:, columns], hi[rows][:, columns], target)
            larger = ~(own.upper <= value[rows])
            value[rows[larger]] = own.upper[larger]
            caused[np.ix_(rows[larger], columns)] = own.caused[larger]
            spread[np.ix_(rows[larger], columns)] = own.spread[larger]
        return Estimate(value, 0.5 * (lo + hi), caused, spread)


class Lipschitz:
    """|dh/dx| for an h with norms in it: the norm of the generalised Jacobian.

    Beside the natural extension of the Jacobian, a structural bound is used that stays tight where a norm vanishes.
    Level k is (J_k, [G_k1, ...]): the Jacobian of the arguments of the k-th norm with the norms before it held fixed,
    and its derivatives by those norms; the last level is h itself. A norm is 1-Lipschitz in its arguments, so
    L_k = |J_k| + sum_j |G_kj| L_j bounds the Lipschitz constant of level k. With `kinks` there is a third bound.
    """

    def __init__(
        self, jacobian: Matrix, levels: Sequence[tuple[Matrix, Sequence[Matrix]]], kinks: Kinks | None = None
    ) -> None:
        self._branches = None if kinks is None else _Branches(kinks)
        self._gains = [len(gains) for _, gains in levels]
        self._function = MatrixFunction([jacobian, *(m for own, gains in levels for m in (own, *gains))])
        more = () if self._branches is None else self._branches.variables
        self.variables = tuple(sorted({*self._function.variables, *more}))
        self._columns = [self.variables.index(v) for v in self._function.variables]

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The smallest of the natural bound, the structural one and that by branches."""
        matrices = self._function.at(lo[:, self._columns], hi[:, self._columns])
        natural, *rest = (spectral_norm(g).hi for g in matrices)
        bounds: list[Array] = []
        for count in self._gains:
            own, gains, rest = rest[0], rest[1 : 1 + count], rest[1 + count :]
            bounds.append(sum((g * b for g, b in zip(gains, bounds, strict=True)), start=own) * (1 + 1e-14))
        value = np.fmin(natural, bounds[-1])
        width = hi - lo
        whole = Estimate(np.where(np.isnan(value), np.inf, value), 0.5 * (lo + hi), width, width)
        return whole if self._branches is None else self._closer(whole, self._branches, (lo, hi), target)

    def _closer(
        self, whole: Estimate, branches: _Branches, box: tuple[Array, Array], target: Target
    ) -> Estimate:
        """The bound by branches, where it is the smaller one; there it is known what to split."""
        own = branches.upper(self.variables, *box, target)
        better = own.upper < whole.upper
        by_branch = better[:, None] & (own.caused > 0).any(axis=1, keepdims=True)
        return Estimate(
            np.where(better, own.upper, whole.upper),
            whole.corner,
            np.where(by_branch, own.caused, whole.caused),
            np.where(by_branch, own.spread, whole.spread),
        )

    def lower(self, lo: Array, hi: Array) -> Array:
        """The norm of the Jacobian at points; where a norm vanishes its gradient is unknown, and so is the value."""
        return spectral_norm(self._function.at(lo[:, self._columns], hi[:, self._columns])[0]).lo


def estimate_of(value: Array, caused: Array, e: Expansion, lo: Array, hi: Array) -> Estimate:
    """Reduce values at vertices (N, V) to boxes; `caused` is (d, N)."""
    value = np.where(np.isnan(value), np.inf, value)
    best = np.argmax(value, axis=1)
    signs = e.signs[best]
    corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
    finite = np.where(np.isfinite(value), value, 0.0)
    spread = _variation(finite, e)
    # a variable that is not expanded into vertices varies the value by what it causes
    return Estimate(value.max(axis=1), corner, caused.T, spread + caused.T)


def edges(signs: Array, i: np.intp) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The vertices at the two ends of every edge along variable i."""
    order = np.lexsort((signs[:, i], *np.delete(signs, i, axis=1).T))
    return order[::2], order[1::2]


def _variation(values: Array, e: Expansion) -> Array:
    """How much the value changes along each variable, (N, d), from values at vertices (N, V).

    Half the mean difference across the variable, and a part of the relative change of the matrices themselves: a norm
    is the same at opposite vertices of a box about the origin, which must be split all the same.
    """
    variation = np.zeros((len(values), e.signs.shape[1]))
    size = 0.1 * np.abs(values).max(axis=1)
    for i in np.flatnonzero(e.signs.any(axis=0)):
        low, high = edges(e.signs, i)
        variation[:, i] = np.abs(values[:, high] - values[:, low]).sum(axis=1) / len(e.signs)
        for mid in e.mid:
            change = norm_bound(np.abs(mid[:, high] - mid[:, low]).mean(axis=1))
            whole = norm_bound(np.abs(mid).max(axis=1))
            variation[:, i] += size * change / np.where(whole > 0, whole, 1.0)
    return variation


class MetricNorm:
    """|Theta v| for a column v(x) and a dual metric W(x) > 0, where Theta' Theta = W^-1."""

    def __init__(self, v: Matrix, W: Matrix, fixed: frozenset[str] = frozenset()) -> None:
        self._function = MatrixFunction([v, W], fixed=fixed)
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """|T v| at the vertices plus what the rest adds, over the root of the least eigenvalue of T W T'."""
        e = self._function.expand(lo, hi)
        v, W = e.mid
        t = whitening(W.mean(axis=1))[:, None]
        spread = [e.over_vertices(e.filled(k)) for k in range(2)]
        least = _least(t, W, spread[1])
        length = spectral_norm_midrad(*product((t, np.zeros_like(t)), (v, spread[0]))).hi
        value = (Interval.exact(length) / sqrt(Interval.exact(least))).hi
        value = np.where(np.isnan(value), np.inf, value)
        best = np.argmax(value, axis=1)
        signs = e.signs[best]
        corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
        of_v, of_W = (
            np.tile(norm_bound(rest), len(e.signs) // rest.shape[2])
            for rest in (np.abs(t) @ e.rest[0], e.rest[1])
        )
        caused = (of_v + length * of_W).max(axis=2).T
        caused = np.where(np.isfinite(caused), caused, np.finfo(float).max)
        return Estimate(value.max(axis=1), corner, caused, caused)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Lengths at points, rounded down."""
        v, W = (midrad(g) for g in self._function.at(lo, hi))
        t = whitening(W[0])
        most = eigenvalues_midrad(*congruence(t, *W)).hi[..., -1]
        length = spectral_norm_midrad(*product((t, np.zeros_like(t)), v)).lo
        value = (Interval.exact(length) / sqrt(Interval.exact(most))).lo
        return np.where(np.isnan(value), -np.inf, np.maximum(value, 0.0))


def _least(t: Array, mid: Array, rad: Array) -> Array:
    """A lower bound of the eigenvalues of T W T'; NaN where none is positive."""
    least = eigenvalues_midrad(*congruence(t, mid, rad)).lo[..., 0]
    return np.where(least > 0, least, np.nan)


class Dependence:
    """|I - R B(x)| with an R of its own for every box: below 1 where the columns of B are independent.

    It proves; a value of 1 or more says nothing about B, so that it never refutes.
    """

    def __init__(self, matrix: Matrix) -> None:
        self._function = MatrixFunction([matrix])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The norm is convex in B: that of the affine part at its vertices, plus what the rest adds."""
        e = self._function.expand(lo, hi)
        R = _left_inverse(e.mid[0].mean(axis=1))[:, None]
        exact = np.zeros_like(R)
        mid, rad = product((R, exact), (e.mid[0], e.over_vertices(e.rad[0])))
        departure = np.eye(R.shape[-2]) - mid
        rad = up(rad + 2.0**-52 * np.abs(departure))  # the subtraction is rounded once, by half of that
        rest, slack = product((np.abs(R), exact), (e.rest[0].sum(axis=0), np.zeros_like(e.rad[0])))
        added = e.over_vertices(norm_bound(up(rest + slack)))
        value = up(spectral_norm_midrad(departure, rad).hi + added)
        caused = norm_bound(np.abs(R[None]) @ e.rest[0]).max(axis=2)
        return estimate_of(value, caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Nothing is known from below."""
        return np.full(len(lo), -np.inf)


def _left_inverse(middle: Array) -> Array:
    """Floats R with R B close to the identity: a proposal, 0 where there is none."""
    ok = finite(middle)[..., None, None]
    inverse = np.linalg.pinv(np.where(ok, middle, 0.0))
    return np.where(finite(inverse)[..., None, None], inverse, 0.0)

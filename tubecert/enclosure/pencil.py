"""Eigenvalues of matrix pencils (N(x), D(x)), D > 0, as objectives: the least tau with N <= tau D, and sums of such.

A guess tau is tested at the vertices of a box, after a congruence T that makes D nearly the identity: with
T (N - tau D) T' <= e I and T D T' between l I and g I, l > 0,
    N <= (tau + e/l) D if e >= 0,    N <= (tau + e/g) D if e <= 0.
Everything here is rigorous except the guesses, the congruence, and what steers the search.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues_midrad,
    finite,
    midrad,
    norm_bound,
    quadratic_form,
    whitening,
)
from tubecert.enclosure.objective import Estimate, Objective, Target, edges, estimate_of
from tubecert.enclosure.taylor import Expansion, Matrix, MatrixFunction
from tubecert.expression import ONE, Expression
from tubecert.expression.matrix import identity

_CLOSE = 0.5  # |T D T' - I| up to which Weyl's bound of its eigenvalues is good enough
_EXACT = 4e-15  # relative: what weights at a point may be rounded below the exact ones

Ball = tuple[Array, Array]  # midpoints and radii of matrices


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """N and D as sums sum_k w_k M_k over matrices M_k, with weights that depend on further variables.

    `ends(lo, hi)`: for every matrix, numerators first, an array (N, E) of weights >= 0, or (N, E, n, n) of weights of
    its entries. If N <= tau D holds, tau >= 0, for the sums with each of the E ends, it holds over the whole range of
    the variables. At a point, they are within 4e-15 of the exact ones, or those of D are 0.
    `loss(lo, hi)`: how much of D is lost by that, relative, for each variable (N, d); it only steers the search.
    """

    variables: tuple[str, ...]
    ends: Callable[[Array, Array], Sequence[Array]]
    loss: Callable[[Array, Array], Array]


class Pencil:
    """The largest eigenvalue of the pencil (N(x), D(x)), D > 0: the least tau with N <= tau D."""

    _weights: Weights | None = None
    _top = 1  # so many of the matrices are numerators

    def __init__(
        self, numerator: Matrix, denominator: Matrix, *, fixed: frozenset[str] = frozenset()
    ) -> None:
        self._function = MatrixFunction([numerator, denominator], fixed=fixed)
        self._own = self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """`target` where N <= target D is proven at once, else the bound that the excess over it gives."""
        own = len(self._own)
        e = self._function.expand(lo[:, :own], hi[:, :own])
        rad, top = _filled(e), self._top
        weights = self._ends(lo, hi)
        ends = weights[0].shape[1]
        numerator = _weighted(weights[:top], e.mid[:top], rad[:top])
        denominator = _weighted(weights[top:], e.mid[top:], rad[top:])
        t = self._frame(hi, e.mid)
        known = bool(np.all(np.isfinite(target)))
        tested = np.reshape(target, (-1, 1)) if known else _guess(t, numerator)
        excess, above = _bound(t, numerator, denominator, tested)
        value = above.max(axis=1)
        if known:
            # a T that is singular proves nothing: 0 is an eigenvalue then, and its bound is rounded above 0
            value = np.where((excess <= 0).all(axis=1), np.fmin(target, value), value)
        if self._weights is not None:
            value = np.maximum(value, 0.0)
        # of the ends of the weights, the worst counts for the search
        excess, above = (x.reshape(len(lo), ends, -1).max(axis=1) for x in (excess, above))
        estimate = estimate_of(above, self._caused(t, e, target, weights), e, lo[:, :own], hi[:, :own])
        worst = np.argmax(np.where(np.isnan(excess), -np.inf, excess) if known else above, axis=1)
        corner = np.where(e.signs[worst] > 0, hi[:, :own], lo[:, :own])
        corner = np.where(e.signs[worst] == 0, 0.5 * (lo + hi)[:, :own], corner)
        loss = np.zeros((len(lo), 0))
        if self._weights is not None:
            loss = np.reshape(_scale(target), (-1, 1)) * self._weights.loss(lo[:, own:], hi[:, own:])
        return Estimate(
            value,
            np.concatenate([corner, 0.5 * (lo + hi)[:, own:]], axis=1),
            np.concatenate([estimate.caused, loss], axis=1),
            np.concatenate([estimate.spread, loss], axis=1),
        )

    def lower(self, lo: Array, hi: Array) -> Array:
        """Rayleigh quotient of a proposed eigenvector, rounded down."""
        own = len(self._own)
        mids, rads = zip(
            *(midrad(g[:, None]) for g in self._function.at(lo[:, :own], hi[:, :own])), strict=True
        )
        weights, top = [w[:, :1] for w in self._ends(lo, hi)], self._top
        numerator = _first(_weighted(weights[:top], mids[:top], rads[:top]))
        denominator = _first(_weighted(weights[top:], mids[top:], rads[top:]))
        t = whitening(denominator[0])
        v = np.einsum("nji,nj->ni", t, _eigenvectors(t, numerator[0])[..., -1])
        quotient = quadratic_form(v, *numerator) / quadratic_form(v, *denominator)
        lower = quotient.lo - _EXACT * np.abs(quotient.lo)
        return np.where(np.isnan(lower), -np.inf, lower) if self._weights is None else np.fmax(lower, 0.0)

    def _ends(self, lo: Array, hi: Array) -> list[Array]:
        """Weights of the matrices, each (N, E)."""
        if self._weights is None:
            return [np.ones((len(lo), 1))] * 2
        own = len(self._own)
        return list(self._weights.ends(lo[:, own:], hi[:, own:]))

    def _frame(self, hi: Array, mids: list[Array]) -> Array:
        """A congruence that makes the denominator, weighted as at the upper ends, nearly the identity."""
        mid, _ = _weighted(self._ends(hi, hi)[self._top :], mids[self._top :], mids[self._top :])
        return whitening(mid.mean(axis=1))[:, None]

    def _caused(self, t: Array, e: Expansion, target: Target, weights: list[Array]) -> Array:
        """How much each variable's rest adds to the excess, (d, N)."""
        caused = np.zeros((e.signs.shape[1], len(t)))
        for k, weight in enumerate(weights):
            scale = 1.0 if k < self._top else _scale(target)
            caused += scale * weight.reshape(len(t), -1).max(axis=1) * _whitened_rest(t, e, k)
        return caused


class WeightedPencil(Pencil):
    """A pencil whose N and D are weighted sums of matrices.

    The weights answer for tau >= 0 only, so the value is the largest eigenvalue or 0, whichever is larger.
    """

    def __init__(
        self, numerators: Sequence[Matrix], denominators: Sequence[Matrix], weights: Weights
    ) -> None:
        self._function = MatrixFunction([*numerators, *denominators])
        self._own = self._function.variables
        self._top = len(numerators)
        self._weights = weights
        self.variables = (*self._own, *weights.variables)


class FirstFinite:
    """Two bounds of one function: the second, in variables of the first, where the first is infinite."""

    def __init__(self, first: Objective, second: Objective) -> None:
        if not set(second.variables) <= set(first.variables):
            raise ValueError("the second objective has other variables")
        self._first, self._second = first, second
        self.variables = first.variables
        self._order = [first.variables.index(v) for v in second.variables]

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The first bound, or the second."""
        found = self._first.upper(lo, hi, target)
        missing = np.isinf(found.upper)
        if missing.any():
            own = target[missing] if isinstance(target, np.ndarray) and target.ndim else target
            other = self._second.upper(lo[missing][:, self._order], hi[missing][:, self._order], own)
            found.upper[missing] = other.upper
        return found

    def lower(self, lo: Array, hi: Array) -> Array:
        """Values of the first."""
        return self._first.lower(lo, hi)


class Definite(Pencil):
    """-lmin(S), for the question whether S(x) > 0: the congruence makes S itself nearly the identity.

    Without it, boxes would have to be so small that S varies by less than its least eigenvalue.
    """

    def __init__(self, matrix: Matrix) -> None:
        negative = [[-e for e in row] for row in matrix]
        super().__init__(negative, identity(len(matrix)))

    def _frame(self, hi: Array, mids: list[Array]) -> Array:
        return whitening(-mids[0].mean(axis=1))[:, None]


class SumOfPencils:
    """sum_i max |lambda| of the pencils (N_i(x), D(x)): with D = W^2, sum_i |W^-1 N_i W^-1|."""

    def __init__(self, numerators: Sequence[Matrix], denominator: Matrix) -> None:
        self._function = MatrixFunction([denominator, *numerators])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """For each i a value is guessed at the vertices, and bounded by what +-N_i exceed it."""
        e = self._function.expand(lo, hi)
        filled = _filled(e)
        denominator = e.mid[0], filled[0]
        t = whitening(e.mid[0].mean(axis=1))[:, None]
        total = np.zeros(e.mid[0].shape[:2])
        caused = np.zeros((lo.shape[1], len(lo)))
        by_denominator = _whitened_rest(t, e, 0)
        for i, (mid, rad) in enumerate(zip(e.mid[1:], filled[1:], strict=True), start=1):
            tau = np.maximum(_guess(t, (mid, rad)), _guess(t, (-mid, rad)))
            both = [_bound(t, (sign * mid, rad), denominator, tau)[1] for sign in (1.0, -1.0)]
            value = np.maximum(np.maximum(*both), 0.0).max(axis=1)
            total = total + value[:, None]
            caused += _whitened_rest(t, e, i) + np.where(np.isfinite(value), value, 0.0) * by_denominator
        total = np.where(np.isnan(total), np.inf, total)
        # where D is not proven positive definite, only what varies D helps, however much the N_i vary
        caused = np.where(np.isinf(total[:, 0]), by_denominator + _whitened_variation(t, e, 0), caused)
        # a sum of one term per state (at most 80) of numbers that are bounds already: 80 u < 90 u <= 1e-14
        return estimate_of(total * (1 + 1e-14), caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Quotients |v' N_i v| / v' D v of proposed eigenvectors, rounded down and summed."""
        values = [midrad(g) for g in self._function.at(lo, hi)]
        t = whitening(values[0][0])
        total = np.zeros(len(lo))
        for mid, rad in values[1:]:
            vectors = _eigenvectors(t, mid)
            best = np.zeros(len(lo))
            for end in (0, -1):
                v = np.einsum("nji,nj->ni", t, vectors[..., end])
                quotient = quadratic_form(v, mid, rad) / quadratic_form(v, *values[0])
                best = np.fmax(best, np.where(np.isnan(quotient.lo), 0.0, quotient.mignitude))
            total = total + best
        return total * (1 - 1e-14)  # as in `upper`: below 90 u


def scalar(e: Expression, fixed: frozenset[str] = frozenset()) -> Pencil:
    """The value of one expression, as the pencil (e, 1)."""
    return Pencil([[e]], [[ONE]], fixed=fixed)


# -- bounds at the vertices ------------------------------------------------------------------------------------


def _bound(t: Array, numerator: Ball, denominator: Ball, tau: Target) -> tuple[Array, Array]:
    """(e, tau'): T (N - tau D) T' <= e I and N <= tau' D at every vertex, each (N, V); inf where nothing is proven."""
    level = np.broadcast_to(np.asarray(tau, dtype=float), numerator[0].shape[:2])
    scale = level[..., None, None]
    mid = numerator[0] - scale * denominator[0]
    size = np.abs(numerator[0]) + np.abs(scale) * np.abs(denominator[0])
    # mid: a product and a difference, 2 u of `size`, which is itself short by 2 u at most; 4e-16 > 3.6 u. The radii:
    # one addition for each variable in `_filled` (at most 80) and 4 roundings here, below 90 u <= 1e-14
    rad = (numerator[1] + np.abs(scale) * denominator[1]) * (1 + 1e-14) + 4e-16 * size
    excess = eigenvalues_midrad(*congruence(t, mid, rad)).hi[..., -1]
    least, greatest = _range(t, denominator)
    step = excess / np.where(excess > 0, least, greatest)
    # a quotient and a sum are rounded, 2 u of their magnitudes; 1e-15 > 9 u, and the last sum goes to the next float
    above = np.nextafter(level + step + 1e-15 * (np.abs(level) + np.abs(step)), np.inf)
    proven = (least > 0) & np.isfinite(above)
    return np.where(np.isnan(excess), np.inf, excess), np.where(proven, above, np.inf)


def _range(t: Array, denominator: Ball) -> tuple[Array, Array]:
    """Bounds of the eigenvalues of T D T' from below and above, (N, V)."""
    mid, rad = congruence(t, *denominator)
    # the difference is rounded once, by u of itself; the sum with `rad` by less than the room left in `congruence`
    # the difference from I is rounded once, by u of itself; 1e-15 > 9 u
    departure = norm_bound(np.abs(mid - np.eye(mid.shape[-1])) * (1 + 1e-15) + rad)
    least, greatest = np.nextafter(1 - departure, -np.inf), np.nextafter(1 + departure, np.inf)
    far = ~(departure < _CLOSE)
    if far.any():
        values = eigenvalues_midrad(mid[far], rad[far])
        least[far], greatest[far] = values.lo[..., 0], values.hi[..., -1]
    return least, greatest


def _guess(t: Array, numerator: Ball) -> Array:
    """The largest eigenvalue of T N T' in floats, (N, V)."""
    scaled = t @ numerator[0] @ np.swapaxes(t, -1, -2)
    return np.asarray(np.linalg.eigvalsh(np.where(finite(scaled)[..., None, None], scaled, 0.0))[..., -1])


def _eigenvectors(t: Array, mid: Array) -> Array:
    """Eigenvectors of T S T' in floats, 0 where S is not finite."""
    scaled = t @ mid @ np.swapaxes(t, -1, -2)
    scaled = np.where(finite(scaled)[..., None, None], 0.5 * (scaled + np.swapaxes(scaled, -1, -2)), 0.0)
    return np.linalg.eigh(scaled)[1]


def _filled(e: Expansion) -> list[Array]:
    """Radii with the rest of every variable in them."""
    return [rad + rest.sum(axis=0) for rad, rest in zip(e.rad, e.rest, strict=True)]


def _first(ball: Ball) -> Ball:
    return ball[0][:, 0], ball[1][:, 0]


def _weighted(weights: Sequence[Array], mids: Sequence[Array], rads: Sequence[Array]) -> Ball:
    """sum_k w_k (mid_k +- rad_k) for every end of the weights, (N, E V, n, n), with the roundings in the radius."""
    if len(mids) == 1 and weights[0].shape == (len(mids[0]), 1) and np.all(weights[0] == 1.0):
        return mids[0], rads[0]
    zero = np.zeros(())
    by_end = [w[:, :, None] if w.ndim == 4 else w[:, :, None, None, None] for w in weights]
    mid = sum((w * m[:, None] for w, m in zip(by_end, mids, strict=True)), start=zero)
    size = sum((w * np.abs(m)[:, None] for w, m in zip(by_end, mids, strict=True)), start=zero)
    rad = sum((w * r[:, None] for w, r in zip(by_end, rads, strict=True)), start=zero)
    shape = (len(mids[0]), -1, *mids[0].shape[2:])
    # K products and K - 1 additions: K u of `size` (Higham 2002, eq. 3.5), K <= 7 for 1e-15 > 9 u; of radii, 90 u
    assert len(mids) <= 7
    return np.asarray(mid).reshape(shape), np.asarray(rad * (1 + 1e-14) + 1e-15 * size).reshape(shape)


# -- what steers the search ------------------------------------------------------------------------------------


def _scale(target: Target) -> Target:
    return np.abs(target) if np.all(np.isfinite(target)) else 1.0


def _whitened_rest(t: Array, e: Expansion, k: int) -> Array:
    """The size of T R_k T' by variable, (d, N)."""
    abs_t = np.abs(t[:, 0])
    return norm_bound(abs_t @ e.rest[k].max(axis=2) @ np.swapaxes(abs_t, -1, -2))


def _whitened_variation(t: Array, e: Expansion, k: int) -> Array:
    """How much T G_k T' varies between the vertices, by variable, (d, N)."""
    variation = np.zeros((e.signs.shape[1], len(t)))
    for i in np.flatnonzero(e.signs.any(axis=0)):
        low, high = edges(e.signs, i)
        step = t @ (e.mid[k][:, high] - e.mid[k][:, low]) @ np.swapaxes(t, -1, -2)
        variation[i] = norm_bound(np.abs(step)).mean(axis=1)
    return variation

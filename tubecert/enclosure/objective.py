"""What branch and bound maximises: convex functions of matrix functions, bounded above on boxes, below at points.

Everything here is rigorous except `Estimate.corner`, `caused` and `spread`, which only steer the search.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import (
    congruence,
    eigenvalues,
    eigenvalues_midrad,
    finite,
    midrad,
    norm_bound,
    quadratic_form,
    spectral_norm,
    spectral_norm_midrad,
    whitening,
)
from tubecert.enclosure.taylor import Expansion, Matrix, MatrixFunction
from tubecert.expression import Expression


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

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """Bounds from above over boxes; a box that can be shown to stay below `target` is given such a bound."""
        ...

    def lower(self, lo: Array, hi: Array) -> Array:
        """Bounds from below that hold for every point of the (thin) boxes; -inf where nothing is known."""
        ...


class SumOfNorms:
    """sum_k |G_k(x)| in the spectral norm (of a column: the Euclidean norm)."""

    def __init__(self, matrices: Sequence[Matrix], fixed: frozenset[str] = frozenset()) -> None:
        self._function = MatrixFunction(matrices, fixed=fixed)
        self.variables = self._function.variables
        self.is_zero = self._function.is_zero

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """Norm of the affine part at its vertices plus the norm of the rest."""
        e = self._function.expand(lo, hi)
        value = np.zeros(e.mid[0].shape[:2])
        caused = np.zeros((lo.shape[1], *value.shape))
        for mid, rad, rest in zip(e.mid, e.rad, e.rest, strict=True):
            value = value + spectral_norm_midrad(mid, rad).hi + norm_bound(rest.sum(axis=0))
            caused += norm_bound(rest)
        return _estimate(value * (1 + 1e-14), caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Norms at points, rounded down."""
        total = sum((spectral_norm(g).lo for g in self._function.at(lo, hi)), start=np.zeros(len(lo)))
        return np.asarray(total * (1 - 1e-14))


class Lipschitz:
    """|dh/dx| for an h with norms in it: the norm of the generalised Jacobian.

    Beside the natural extension of the Jacobian, a structural bound is used that stays tight where a norm vanishes.
    Level k is (J_k, [G_k1, ...]): the Jacobian of the arguments of the k-th norm with the norms before it held fixed,
    and its derivatives by those norms; the last level is h itself. A norm is 1-Lipschitz in its arguments, so
    L_k = |J_k| + sum_j |G_kj| L_j bounds the Lipschitz constant of level k.
    """

    def __init__(self, jacobian: Matrix, levels: Sequence[tuple[Matrix, Sequence[Matrix]]]) -> None:
        self._gains = [len(gains) for _, gains in levels]
        self._function = MatrixFunction([jacobian, *(m for own, gains in levels for m in (own, *gains))])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """The smaller of the natural and the structural bound."""
        natural, *rest = (spectral_norm(g).hi for g in self._function.at(lo, hi))
        bounds: list[Array] = []
        for count in self._gains:
            own, gains, rest = rest[0], rest[1 : 1 + count], rest[1 + count :]
            bounds.append(sum((g * b for g, b in zip(gains, bounds, strict=True)), start=own) * (1 + 1e-14))
        value = np.fmin(natural, bounds[-1])
        width = hi - lo
        return Estimate(np.where(np.isnan(value), np.inf, value), 0.5 * (lo + hi), width, width)

    def lower(self, lo: Array, hi: Array) -> Array:
        """The norm of the Jacobian at points; where a norm vanishes its gradient is unknown, and so is the value."""
        return spectral_norm(self._function.at(lo, hi)[0]).lo


class LeastInputGain:
    """-lmin(B' M B) with M = W^-1, to be maximised.

    With any T: B'MB = (TB)'(TWT')^-1(TB), between lmin((TB)'(TB))/lmax(TWT') and lmin((TB)'(TB))/lmin(TWT').
    """

    def __init__(self, B: Matrix, W: Matrix) -> None:
        self._function = MatrixFunction([W, B])
        self.variables = self._function.variables

    def _range(self, lo: Array, hi: Array) -> Interval:
        w, b = self._function.at(lo, hi)
        mid, rad = midrad(w)
        t = whitening(mid)
        scaled = eigenvalues_midrad(*congruence(t, mid, rad))
        n = t.shape[-1]
        image = [sum((b[:, j] * t[:, i, j, None] for j in range(n)), start=Interval(0.0)) for i in range(n)]
        gram_lo = np.empty((len(lo), b.shape[-1], b.shape[-1]))
        gram_hi = gram_lo.copy()
        for p in range(b.shape[-1]):
            for q in range(b.shape[-1]):
                entry = sum((row[:, p] * row[:, q] for row in image), start=Interval(0.0))
                gram_lo[:, p, q], gram_hi[:, p, q] = entry.lo, entry.hi
        least = eigenvalues(Interval(gram_lo, gram_hi))[..., 0]
        positive = Interval(np.where(scaled.lo[:, 0] > 0, scaled.lo[:, 0], np.nan), scaled.hi[:, -1])
        return (Interval(np.maximum(least.lo, 0.0), least.hi) / positive).sanitised()

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """Minus the smallest value over the box."""
        value = -np.maximum(self._range(lo, hi).lo, 0.0)
        width = hi - lo
        return Estimate(value, 0.5 * (lo + hi), width, width)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Minus the value at points."""
        return -self._range(lo, hi).hi


Weights = Callable[[Array, Array], Sequence[Array]]


class Pencil:
    """The largest eigenvalue of the pencil (N(x), D(x)), D > 0: the least tau with N <= tau D.

    D may be a combination sum_k w_k D_k with weights w_k >= 0 that depend on further variables of the box (`extra`:
    from 0 to the number given). `weights(lo, hi)` must return weights that give, for the whole box, a *lower* bound of
    D in the Loewner order. That bounds N <= tau D for tau >= 0 only, so with weights the value is the largest
    eigenvalue or 0, whichever is larger.
    A target tau is tested directly: N - tau D <= 0 after a congruence that makes D nearly the identity.
    """

    def __init__(
        self,
        numerator: Matrix,
        denominators: Sequence[Matrix],
        *,
        extra: Mapping[str, float] | None = None,
        weights: Weights | None = None,
        fixed: frozenset[str] = frozenset(),
    ) -> None:
        self._function = MatrixFunction([numerator, *denominators], fixed=fixed)
        self._own = self._function.variables
        self.variables = (*self._own, *(extra or {}))
        self._largest = np.array(list((extra or {}).values()))
        self._weights = weights
        self._count = len(denominators)

    def _combine(self, lo: Array, hi: Array) -> list[Array]:
        """Weights of the denominators, each (N,)."""
        if self._weights is None:
            return [np.ones(len(lo))] * self._count
        first = len(self._own)
        return list(self._weights(lo[:, first:], hi[:, first:]))

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """`target` where N <= target D is proven, else a bound from separate bounds of N and D."""
        own = len(self._own)
        e = self._function.expand(lo[:, :own], hi[:, :own])
        weights = self._combine(lo, hi)
        numerator = e.mid[0], e.rad[0] + e.rest[0].sum(axis=0)
        denominator = _weighted(
            weights, e.mid[1:], [r + s.sum(axis=0) for r, s in zip(e.rad, e.rest, strict=True)][1:]
        )
        t = self._frame(hi, e.mid[1:])
        above = _pencil_bound(t, numerator, denominator)
        excess = (
            _excess(t, numerator, denominator, target)
            if np.isfinite(target)
            else np.full(above.shape, np.inf)
        )
        corner = np.argmax(
            np.where(np.isnan(excess), -np.inf, excess) if np.isfinite(target) else above, axis=1
        )
        value = np.where(np.max(excess, axis=1) <= 0, np.fmin(target, above.max(axis=1)), above.max(axis=1))
        value = value if self._weights is None else np.maximum(value, 0.0)
        caused = np.zeros((lo.shape[1], *above.shape))
        scale = abs(target) if np.isfinite(target) else 1.0
        for k, rest in enumerate(e.rest):
            factor = 1.0 if k == 0 else scale * weights[k - 1][:, None]
            abs_t = np.abs(t)
            caused[:own] += factor * norm_bound(abs_t @ rest @ np.swapaxes(abs_t, -1, -2))
        estimate = _estimate(above, caused[:own], e, lo[:, :own], hi[:, :own])
        points = np.where(e.signs[corner] > 0, hi[:, :own], lo[:, :own])
        points = np.where(e.signs[corner] == 0, 0.5 * (lo + hi)[:, :own], points)
        middle = 0.5 * (lo + hi)[:, own:]
        extent = scale * _ratio(lo[:, own:], hi[:, own:], self._largest)
        return Estimate(
            np.where(np.isnan(value), np.inf, value),
            np.concatenate([points, middle], axis=1),
            np.concatenate([estimate.caused, extent], axis=1),
            np.concatenate([estimate.spread, extent], axis=1),
        )

    def lower(self, lo: Array, hi: Array) -> Array:
        """Rayleigh quotient of a proposed eigenvector, rounded down."""
        own = len(self._own)
        values = [midrad(g) for g in self._function.at(lo[:, :own], hi[:, :own])]
        numerator = values[0]
        weights = self._combine(lo, hi)
        denominator = _weighted(weights, [m for m, _ in values[1:]], [r for _, r in values[1:]])
        t = whitening(denominator[0])
        scaled = t @ numerator[0] @ np.swapaxes(t, -1, -2)
        bad = ~finite(scaled)
        scaled = np.where(bad[:, None, None], 0.0, 0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
        _, vectors = np.linalg.eigh(scaled)
        v = np.einsum("nji,nj->ni", t, vectors[..., -1])
        quotient = quadratic_form(v, *numerator) / quadratic_form(v, *denominator)
        # the weights may be rounded below the exact ones
        lower = quotient.lo - 1e-15 * np.abs(quotient.lo)
        return np.where(np.isnan(lower), -np.inf, lower) if self._weights is None else np.fmax(lower, 0.0)

    def _frame(self, hi: Array, denominators: list[Array]) -> Array:
        """A congruence that makes the denominator, weighted as at the upper ends, nearly the identity."""
        mid, _ = _weighted(self._combine(hi, hi), denominators, denominators)
        return whitening(mid.mean(axis=1))[:, None]


class SumOfPencils:
    """sum_i max |lambda| of the pencils (N_i(x), D(x)): with D = W^2, sum_i |W^-1 N_i W^-1|."""

    def __init__(self, numerators: Sequence[Matrix], denominator: Matrix) -> None:
        self._function = MatrixFunction([denominator, *numerators])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: float) -> Estimate:
        """For each i a value is guessed at the vertices, then +-N_i <= tau D is proven, inflated if needed."""
        e = self._function.expand(lo, hi)
        filled = [rad + rest.sum(axis=0) for rad, rest in zip(e.rad, e.rest, strict=True)]
        denominator = e.mid[0], filled[0]
        t = whitening(e.mid[0].mean(axis=1))[:, None]
        total = np.zeros(e.mid[0].shape[:2])
        caused = np.zeros((lo.shape[1], *total.shape))
        for mid, rad, rest in zip(e.mid[1:], filled[1:], e.rest[1:], strict=True):
            both = [_pencil_value(t, (sign * mid, rad), denominator) for sign in (1.0, -1.0)]
            total = total + np.maximum(*both).max(axis=1)[:, None]
            abs_t = np.abs(t)
            caused += norm_bound(abs_t @ rest @ np.swapaxes(abs_t, -1, -2))
            level = np.abs(both[0]) * norm_bound(abs_t @ e.rest[0] @ np.swapaxes(abs_t, -1, -2))
            caused += np.where(np.isfinite(level), level, 0.0)
        return _estimate(total * (1 + 1e-14), caused, e, lo, hi)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Quotients |v' N_i v| / v' D v of proposed eigenvectors, rounded down and summed."""
        values = [midrad(g) for g in self._function.at(lo, hi)]
        t = whitening(values[0][0])
        total = np.zeros(len(lo))
        for mid, rad in values[1:]:
            scaled = t @ mid @ np.swapaxes(t, -1, -2)
            bad = ~finite(scaled)
            scaled = np.where(bad[:, None, None], 0.0, 0.5 * (scaled + np.swapaxes(scaled, -1, -2)))
            _, vectors = np.linalg.eigh(scaled)
            best = np.zeros(len(lo))
            for end in (0, -1):
                v = np.einsum("nji,nj->ni", t, vectors[..., end])
                quotient = quadratic_form(v, mid, rad) / quadratic_form(v, *values[0])
                best = np.fmax(best, np.where(np.isnan(quotient.lo), 0.0, quotient.mignitude))
            total = total + best
        return total * (1 - 1e-14)


def scalar(e: Expression, fixed: frozenset[str] = frozenset()) -> Pencil:
    """The value of one expression, as the pencil (e, 1)."""
    from tubecert.expression import ONE

    return Pencil([[e]], [[[ONE]]], fixed=fixed)


def _weighted(weights: Sequence[Array], mids: Sequence[Array], rads: Sequence[Array]) -> tuple[Array, Array]:
    """sum_k w_k (mid_k +- rad_k) with the roundings put into the radius."""
    if len(mids) == 1 and np.all(weights[0] == 1.0):
        return mids[0], rads[0]
    shape = (-1, *(1,) * (mids[0].ndim - 1))
    mid = sum((w.reshape(shape) * m for w, m in zip(weights, mids, strict=True)), start=np.zeros(()))
    size = sum((w.reshape(shape) * np.abs(m) for w, m in zip(weights, mids, strict=True)), start=np.zeros(()))
    rad = sum((w.reshape(shape) * r for w, r in zip(weights, rads, strict=True)), start=np.zeros(()))
    return np.asarray(mid), np.asarray(rad * (1 + 1e-14) + 1e-15 * size)


def _excess(
    t: Array, numerator: tuple[Array, Array], denominator: tuple[Array, Array], tau: float | Array
) -> Array:
    """Upper bound of lmax(T (N - tau D) T'): where it is <= 0, N <= tau D is proven; (N, V)."""
    tau = np.asarray(tau)[..., None, None] if np.ndim(tau) else np.asarray(tau)
    mid = numerator[0] - tau * denominator[0]
    size = np.abs(numerator[0]) + np.abs(tau) * np.abs(denominator[0])
    rad = (numerator[1] + np.abs(tau) * denominator[1]) * (1 + 1e-14) + 4e-16 * size
    top = eigenvalues_midrad(*congruence(t, mid, rad)).hi[..., -1]
    return np.where(np.isnan(top), np.inf, top)


def _pencil_bound(t: Array, numerator: tuple[Array, Array], denominator: tuple[Array, Array]) -> Array:
    """Upper bound of the pencil's largest eigenvalue from separate bounds of T N T' and T D T'; (N, V)."""
    top = eigenvalues_midrad(*congruence(t, *numerator)).hi[..., -1]
    scaled = eigenvalues_midrad(*congruence(t, *denominator))
    least = scaled.lo[..., 0]
    quotient = np.where(top >= 0, top / np.where(least > 0, least, np.nan), top / scaled.hi[..., -1])
    quotient = np.where(least > 0, quotient + 1e-15 * np.abs(quotient), np.inf)
    return np.where(np.isnan(quotient), np.inf, quotient)


def _pencil_value(t: Array, numerator: tuple[Array, Array], denominator: tuple[Array, Array]) -> Array:
    """Upper bound of the largest eigenvalue, at least 0, by guessing tau and proving it; (N, V)."""
    above = np.maximum(_pencil_bound(t, numerator, denominator), 0.0)
    scaled = congruence(t, numerator[0], numerator[1])
    guess = np.maximum(np.linalg.eigvalsh(np.where(np.isfinite(scaled[0]), scaled[0], 0.0))[..., -1], 0.0)
    slack = norm_bound(scaled[1]) + guess * norm_bound(congruence(t, *denominator)[1])
    for inflation in (1.0, 2.0):
        tau = guess + inflation * slack
        tau = np.where(np.isfinite(tau), tau, 0.0)
        proven = _excess(t, numerator, denominator, tau) <= 0
        above = np.where(proven, np.minimum(above, tau), above)
    return above


def _estimate(value: Array, caused: Array, e: Expansion, lo: Array, hi: Array) -> Estimate:
    """Reduce values at vertices (N, V) to boxes."""
    value = np.where(np.isnan(value), np.inf, value)
    best = np.argmax(value, axis=1)
    signs = e.signs[best]
    corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
    finite = np.where(np.isfinite(value), value, 0.0)
    spread = _variation(finite, e)
    # a variable that is not expanded into vertices varies the value by what it causes
    cause = caused.max(axis=2).T if caused.size else np.zeros(lo.shape)
    return Estimate(value.max(axis=1), corner, cause, spread + cause)


def _variation(values: Array, e: Expansion) -> Array:
    """How much the value changes along each variable, (N, d), from values at vertices (N, V).

    Half the mean difference across the variable, and a part of the relative change of the matrices themselves: a norm
    is the same at opposite vertices of a box about the origin, which must be split all the same.
    """
    variation = np.zeros((len(values), e.signs.shape[1]))
    size = 0.1 * np.abs(values).max(axis=1)
    for i in np.flatnonzero(e.signs.any(axis=0)):
        order = np.lexsort((e.signs[:, i], *np.delete(e.signs, i, axis=1).T))
        low, high = order[::2], order[1::2]  # the two ends of every edge along i
        variation[:, i] = np.abs(values[:, high] - values[:, low]).sum(axis=1) / len(e.signs)
        for mid in e.mid:
            change = norm_bound(np.abs(mid[:, high] - mid[:, low]).mean(axis=1))
            whole = norm_bound(np.abs(mid).max(axis=1))
            variation[:, i] += size * change / np.where(whole > 0, whole, 1.0)
    return variation


def _ratio(lo: Array, hi: Array, largest: Array) -> Array:
    """Relative width of positive ranges; of those that reach 0 the part of the whole range [0, largest].

    A part that shrinks: a range at 0 would otherwise be halved for ever where only other variables can help.
    """
    return np.where(lo > 0, (hi - lo) / np.where(lo > 0, lo, 1.0), hi / largest)

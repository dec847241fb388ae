"""Eigenvalues of matrix pencils (N(x), D(x)), D > 0, as objectives: the least tau with N <= tau D, and sums of such.

A tau is tested at the vertices of a box, after a congruence T that makes D nearly the identity: see `vertices`.
Everything here is rigorous except the proposals, the congruence, and what steers the search.

The pencil (N(x), D(x)) on the null space of B(x)': what C2 is about when B depends on the state.

Above, Finsler's lemma: N - s B B' <= tau D for some s >= 0 gives v'Nv <= tau v'Dv for all v with B'v = 0; s may differ
from box to box, and is only proposed in floats. Below: a Rayleigh quotient of a vector proven to lie in the null space.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import exceeds, finite, midrad, norm_bound, product, quadratic_form, whitening
from tubecert.enclosure.objective import Estimate, Objective, Target, edges, estimate_of
from tubecert.enclosure.taylor import Expansion, Matrix, MatrixFunction
from tubecert.enclosure.vertices import Balls, Vertices, spectrum
from tubecert.expression import ONE, Expression
from tubecert.expression.matrix import identity

_EXACT = 4e-15  # relative: what weights at a point may be rounded below the exact ones


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
        """The floor where N < floor D is proven at once, elsewhere about the least bound, or what is enough."""
        own, top = len(self._own), self._top
        e, weights = self._function.expand(lo[:, :own], hi[:, :own]), self._ends(lo, hi)
        halves = (slice(top), slice(top, None))
        vertices = Vertices(self._frame(hi, e), *(_weighted(weights[k], e.balls()[k]) for k in halves))
        # weights answer for no tau below 0
        floor = target.floor if self._weights is None else max(target.floor, 0.0)
        low = vertices.below(np.full(len(lo), floor))
        estimate = Estimate(
            np.where(low, floor, np.inf), 0.5 * (lo + hi), np.zeros(lo.shape), np.zeros(lo.shape)
        )
        left = np.flatnonzero(~low)
        if len(left):
            ends = lo[left], hi[left]
            parts = vertices.of(left), e.of(left), [w[left] for w in weights]
            closer = self._closer(ends, *parts, target.enough)
            for column in ("upper", "corner", "caused", "spread"):
                getattr(estimate, column)[left] = getattr(closer, column)
        return estimate

    def _closer(
        self,
        box: tuple[Array, Array],
        vertices: Vertices,
        e: Expansion,
        weights: Sequence[Array],
        enough: float,
    ) -> Estimate:
        """Bounds near the least ones, and how each variable takes part in them."""
        (lo, hi), own = box, len(self._own)
        known = np.isfinite(enough)
        excess, above = vertices.proposed(np.full((len(lo), 1), enough) if known else vertices.guess())
        wanted = above.max(axis=1)
        if known:
            wanted = np.where((excess <= 0).all(axis=1), np.fmin(enough, wanted), wanted)
        if self._weights is not None:
            wanted = np.maximum(wanted, 0.0)
        value = vertices.proven(wanted, enough)
        # of the ends of the weights, the worst counts for the search
        shape = len(lo), -1, weights[0].shape[1], e.rad[0].shape[1]
        excess, above = (x.reshape(shape).max(axis=2).reshape(len(lo), -1) for x in (excess, above))
        scale = abs(enough) if known else 1.0
        estimate = estimate_of(
            above, self._caused(vertices.t, e, scale, weights), e, lo[:, :own], hi[:, :own]
        )
        worst = np.argmax(np.where(np.isnan(excess), -np.inf, excess) if known else above, axis=1)
        corner = np.where(e.signs[worst] > 0, hi[:, :own], lo[:, :own])
        corner = np.where(e.signs[worst] == 0, 0.5 * (lo + hi)[:, :own], corner)
        loss = np.zeros((len(lo), 0))
        if self._weights is not None:
            loss = scale * self._weights.loss(lo[:, own:], hi[:, own:])
        return Estimate(
            value,
            np.concatenate([corner, 0.5 * (lo + hi)[:, own:]], axis=1),
            np.concatenate([estimate.caused, loss], axis=1),
            np.concatenate([estimate.spread, loss], axis=1),
        )

    def lower(self, lo: Array, hi: Array) -> Array:
        """Rayleigh quotient of a proposed eigenvector, rounded down."""
        own = len(self._own)
        weights, top = [w[:, :1] for w in self._ends(lo, hi)], self._top
        at = (midrad(g[:, None]) for g in self._function.at(lo[:, :own], hi[:, :own]))
        balls = [Balls(mid, np.abs(mid), rad) for mid, rad in at]
        numerator, denominator = (
            (whole.mid[:, 0], whole.rad[:, 0])
            for whole in (_weighted(weights[:top], balls[:top]), _weighted(weights[top:], balls[top:]))
        )
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

    def _frame(self, hi: Array, e: Expansion) -> Array:
        """A congruence that makes the denominator, weighted as at the upper ends, nearly the identity."""
        weights = self._ends(hi, hi)[self._top :]
        middle = [mid.mean(axis=1, keepdims=True) for mid in e.mid[self._top :]]
        return whitening(_mixed(weights, middle, 1).mean(axis=1))[:, None]

    def _caused(self, t: Array, e: Expansion, scale: float, weights: Sequence[Array]) -> Array:
        """How much each variable's rest adds to the excess, (d, N); `scale`: what the denominator counts."""
        caused = np.zeros((e.signs.shape[1], len(t)))
        for k, weight in enumerate(weights):
            own = 1.0 if k < self._top else scale
            caused += own * weight.reshape(len(t), -1).max(axis=1) * _whitened_rest(t, e, k)
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
            other = self._second.upper(lo[missing][:, self._order], hi[missing][:, self._order], target)
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

    def _frame(self, hi: Array, e: Expansion) -> Array:
        return whitening(-e.mid[0].mean(axis=1))[:, None]


class SumOfPencils:
    """sum_i max |lambda| of the pencils (N_i(x), D(x)): with D = W^2, sum_i |W^-1 N_i W^-1|."""

    def __init__(self, numerators: Sequence[Matrix], denominator: Matrix) -> None:
        self._function = MatrixFunction([denominator, *numerators])
        self.variables = self._function.variables

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """For each i a value is guessed at the vertices, and proven of +-N_i."""
        e = self._function.expand(lo, hi)
        denominator, *numerators = e.balls()
        t = whitening(e.mid[0].mean(axis=1))[:, None]
        total = np.zeros(len(lo))
        caused = np.zeros((lo.shape[1], len(lo)))
        by_denominator = _whitened_rest(t, e, 0)
        for i, numerator in enumerate(numerators, start=1):
            both = [Vertices(t, own, denominator) for own in (numerator, -numerator)]
            tau = np.maximum(*(each.guess() for each in both))
            wanted = np.maximum(*(each.proposed(tau)[1] for each in both)).max(axis=1)
            value = np.maximum(*(each.proven(np.maximum(wanted, 0.0)) for each in both))
            total = total + value
            caused += _whitened_rest(t, e, i) + np.where(np.isfinite(value), value, 0.0) * by_denominator
        total = np.where(np.isnan(total), np.inf, total)
        # where D is not proven positive definite, only what varies D helps, however much the N_i vary
        caused = np.where(np.isinf(total), by_denominator + _whitened_variation(t, e, 0), caused)
        # a sum of one term per state (at most 80) of numbers that are bounds already: 80 u < 90 u <= 1e-14
        return estimate_of(np.tile(total[:, None] * (1 + 1e-14), len(e.signs)), caused, e, lo, hi)

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


# -- sums of matrices with weights -----------------------------------------------------------------------------


def _eigenvectors(t: Array, mid: Array) -> Array:
    """Eigenvectors of T S T' in floats, 0 where S is not finite."""
    scaled = t @ mid @ np.swapaxes(t, -1, -2)
    scaled = np.where(finite(scaled)[..., None, None], 0.5 * (scaled + np.swapaxes(scaled, -1, -2)), 0.0)
    return np.linalg.eigh(scaled)[1]


def _weighted(weights: Sequence[Array], balls: Sequence[Balls]) -> Balls:
    """sum_k w_k B_k at F E A vertices, for B_k at F A of them, with the roundings in the radius.

    K products and K - 1 additions: K u of the size (Higham 2002, eq. 3.5), K <= 7 for 1e-15 > 9 u; of radii, 90 u.
    """
    assert len(balls) <= 7
    if len(balls) == 1 and weights[0].size == len(weights[0]) and np.all(weights[0] == 1.0):
        return balls[0]
    ends = balls[0].rad.shape[1]
    mid, size, rad = (
        _mixed(weights, of, ends)
        for of in ([b.mid for b in balls], [b.size for b in balls], [b.rad for b in balls])
    )
    return Balls(mid, size * (1 + 1e-14), rad * (1 + 1e-14) + 1e-15 * size)


def _mixed(weights: Sequence[Array], arrays: Sequence[Array], ends: int) -> Array:
    """sum_k w_k a_k, (N, F E A, n, n), for a_k (N, F A, n, n) at A ends, w_k (N, E) or, by entries, (N, E, n, n)."""
    count, _, *shape = arrays[0].shape
    total = np.zeros(())
    for w, a in zip(weights, arrays, strict=True):
        by_entry = w.reshape(count, 1, w.shape[1], 1, *(w.shape[2:] or (1, 1)))
        total = total + by_entry * a.reshape(count, -1, 1, ends, *shape)
    return total.reshape(count, -1, *shape)


# -- what steers the search ------------------------------------------------------------------------------------


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


class ProjectedPencil:
    """sup over x of the least tau with v'N v <= tau v'D v whenever B'v = 0; D > 0, B of full column rank `inputs`.

    `BBt` is B B', `projector` a matrix whose columns lie in the null space of B' (such as I - B B^+).
    """

    def __init__(
        self, numerator: Matrix, denominator: Matrix, BBt: Matrix, projector: Matrix, *, inputs: int
    ) -> None:
        self._function = MatrixFunction([numerator, denominator, BBt])
        self._projector = MatrixFunction([projector])
        self._inputs = inputs
        self.variables = tuple(sorted({*self._function.variables, *self._projector.variables}))

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """`target` where Finsler's condition is proven over the box, inf elsewhere."""
        tau = target.enough
        own = [self.variables.index(v) for v in self._function.variables]
        e = self._function.expand(lo[:, own], hi[:, own])
        centre = [mid.mean(axis=1) for mid in e.mid]
        t = whitening(centre[1])[:, None]
        s = _multiplier(centre, tau, self._inputs)[:, None, None, None]
        mid = e.mid[0] - tau * e.mid[1] - s * e.mid[2]
        size, rad = (of[0] + abs(tau) * of[1] + s * of[2] for of in (e.size, [e.filled(k) for k in range(3)]))
        # mid: two products, two differences, 4 u of `size` (itself short by 4 u); 1e-15 > 9 u. Radii as in `pencil`
        rad = rad * (1 + 1e-14) + 1e-15 * size
        scaled, off = Balls(mid, size * (1 + 1e-15), rad).within(t)
        spread = e.over_vertices(norm_bound(off))
        proven = exceeds(-scaled, spread).all(axis=1)
        excess = spectrum(scaled)[..., -1] + spread
        worst = np.argmax(np.where(np.isnan(excess), -np.inf, excess), axis=1)
        signs = np.zeros(lo.shape)
        signs[:, own] = e.signs[worst]
        corner = np.where(signs > 0, hi, np.where(signs < 0, lo, 0.5 * (lo + hi)))
        caused = np.zeros(lo.shape)
        abs_t = np.abs(t)
        for k, weight in ((0, 1.0), (1, abs(tau)), (2, s[..., 0, 0])):
            scaled = abs_t @ e.rest[k] @ np.swapaxes(abs_t, -1, -2)
            caused[:, own] += (weight * scaled.sum(axis=(-2, -1))).max(axis=2).T
        caused = np.where(np.isfinite(caused), caused, np.finfo(float).max)
        return Estimate(np.where(proven, tau, np.inf), corner, caused, caused)

    def lower(self, lo: Array, hi: Array) -> Array:
        """Rayleigh quotients of proposed vectors, projected onto the null space with intervals."""
        own = [self.variables.index(v) for v in self._function.variables]
        needed = [self.variables.index(v) for v in self._projector.variables]
        N, D, _ = (midrad(g) for g in self._function.at(lo[:, own], hi[:, own]))
        P = midrad(self._projector.at(lo[:, needed], hi[:, needed])[0])
        best = np.full(len(lo), -np.inf)
        Pt = np.swapaxes(P[0], -1, -2)
        reduced = Pt @ N[0] @ P[0]
        weight = Pt @ D[0] @ P[0]
        rank = P[0].shape[-1]
        frame = whitening(weight + 1e-9 * np.trace(weight, axis1=-2, axis2=-1)[:, None, None] * np.eye(rank))
        scaled = frame @ reduced @ np.swapaxes(frame, -1, -2)
        ok = finite(scaled)
        _, vectors = np.linalg.eigh(np.where(ok[:, None, None], scaled, 0.0))
        for k in range(rank):  # some of these belong to the range of B' and project to nothing
            y = np.einsum("nji,nj->ni", frame, vectors[..., k])[..., None]
            v = product(P, (y, np.zeros_like(y)))
            vt = np.swapaxes(v[0], -1, -2), np.swapaxes(v[1], -1, -2)
            top, bottom = (product(vt, product(S, v)) for S in (N, D))
            quotient = _interval(top) / _interval(bottom)
            best = np.fmax(best, np.where(np.isnan(quotient.lo) | ~ok, -np.inf, quotient.lo))
        return best


def _interval(scalar: tuple[Array, Array]) -> Interval:
    mid, rad = scalar[0][..., 0, 0], scalar[1][..., 0, 0]
    return Interval(np.nextafter(mid - rad, -np.inf), np.nextafter(mid + rad, np.inf))


def _multiplier(centre: list[Array], target: float, inputs: int) -> Array:
    """A proposal for s: with R, N bases of the range and null space, the Schur complement of N - s B B' - tau D.

    The mean of a box's vertices is not quite of the rank of B: its largest eigenvalues are taken for the range.
    """
    t = whitening(centre[1])
    tt = np.swapaxes(t, -1, -2)
    form, gram = t @ centre[0] @ tt - target * np.eye(t.shape[-1]), t @ centre[2] @ tt
    ok = finite(form) & finite(gram)
    form, gram = np.where(ok[:, None, None], form, 0.0), np.where(ok[:, None, None], gram, 0.0)
    d, v = np.linalg.eigh(gram)
    form = np.swapaxes(v, -1, -2) @ form @ v
    result = np.zeros(len(form))
    for row in range(len(form)):
        in_range = np.arange(len(d[row])) >= len(d[row]) - inputs
        null = form[row][np.ix_(~in_range, ~in_range)]
        mixed = form[row][np.ix_(~in_range, in_range)]
        own = form[row][np.ix_(in_range, in_range)]
        room = max(-np.linalg.eigvalsh(null)[-1], 1e-12) if null.size else 1.0
        needed = (
            2 * np.linalg.norm(mixed) ** 2 / room + max(0.0, np.linalg.eigvalsh(own)[-1]) if own.size else 0.0
        )
        result[row] = 1.1 * needed / max(d[row][in_range].min(initial=1.0), 1e-300)
    return result

"""Geodesics of a metric from the plan to many states at once: Chebyshev polynomials of the least energy.

gamma(s) = (1 - s) p + s q + sum_k a_k phi_k(s) with phi_k = T_k less its values at the ends; the energy int
gamma_s' M gamma_s ds is taken by Clenshaw-Curtis. A step takes the Hessian of a constant metric, whose inverse is at
hand because the metric is given as W; that converges fast from the curve of the moment before. Where it does not,
Newton's method with line search starts from the segment. Source: K. Leung, I. R. Manchester, Nonlinear stabilization
via control contraction metrics: a pseudospectral approach for computing geodesics, ACC 2017.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, Expression, free_symbols
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel

FOUND, NOT_POSITIVE, NOT_FOUND, UNRESOLVED = range(4)
REASONS: Final = {
    NOT_POSITIVE: "the metric is not positive definite between plan and state",
    NOT_FOUND: "no geodesic from the plan to the state was found",
    UNRESOLVED: "the geodesic needs a polynomial of a higher degree",
}
_EXTRA_NODES: Final = 2
_LAST: Final = 1e-11  # of the energy: what a step gains that is not taken; covectors are wrong by its root
_QUICK: Final = 8  # steps with the constant Hessian
_MOST: Final = 40  # of Newton's steps
_HALVINGS: Final = 12
_APART: Final = 1e-6  # of the span: how far gradients are taken apart for the Hessian
_FLAT: Final = 1e-9  # of the largest curvature: no less is divided by
_UNEVEN: Final = 0.05  # how far the squared speed may vary along the curve, of the energy
_ROUNDING: Final = 1e-12
_LONGER: Final = 1e-9  # by how much a geodesic may be longer than the segment
_WATCHED: Final = 64  # calls between two comparisons with the segment


class Geodesic(NamedTuple):
    """Of N lanes: why there is none (0: there is), its energy d^2, and M gamma_s at both ends (n, N).

    `a` (n, degree - 1, N) are the coefficients.
    """

    status: NDArray[np.int64]
    energy: Array
    start: Array
    end: Array
    a: Array


class _Curve(NamedTuple):
    """Of polynomials: energy (N,), gradient by the coefficients (n, K, N), the variation of the squared speed (N,).

    `m` (n, Q, N) is M gamma_s at the nodes; `W` (n, n, N) is that of the middle.
    """

    energy: Array
    gradient: Array
    uneven: Array
    m: Array
    W: Array


class Geodesics:
    """Those of N lanes; `a` (n, K, N) are the coefficients of the last ones, from which the next start."""

    def __init__(self, model: ControlAffineModel, degree: int, lanes: int) -> None:
        used = free_symbols(e for row in model.W for e in row)
        n, self._calls = len(model.states), 0
        moving = [i for i, name in enumerate(model.states) if name in used]
        self.a = np.zeros((n, degree - 1, lanes))
        self._triangle = np.tril_indices(n)
        slopes = [(i, place, e) for i in moving for place, e in enumerate(_lower(model.W_x[i])) if e != ZERO]
        self._tape = Tape([*_lower(model.W), *(e for _, _, e in slopes)], model.states)
        self._slopes = [(i, [place for j, place, _ in slopes if j == i]) for i in moving]
        if moving:
            self._s, self._weight, self._phi, self._slope = _polynomials(degree)
            self._softness = np.linalg.inv(2 * (self._slope * self._weight) @ self._slope.T)
        else:
            self._M = np.linalg.inv(self._full(self._tape.run_floats([np.zeros(())] * n, ())))

    def connect(self, p: Array, q: Array) -> Geodesic:
        """From p (n, 1) or (n, N) to q (n, N)."""
        span = q - p
        if not self._slopes:
            m = self._M @ span
            status = np.zeros(q.shape[1], dtype=np.int64)
            return Geodesic(status, np.einsum("in,in->n", span, m), m, m, self.a)
        found = self._descended(p, span, self.a, newton=False)
        self._calls += 1
        if self._calls % _WATCHED == 1:
            straight = self._expand(p, span, np.zeros_like(self.a)).energy
            found.status[found.energy > straight * (1 + _LONGER)] = NOT_FOUND
        left = np.flatnonzero(found.status)
        if len(left):
            own = self._newton(_some(p, left), span[:, left], self.a[:, :, left])
            for whole, part in zip(found, own, strict=True):
                whole[..., left] = part
        self.a = found.a
        return found

    def _newton(self, p: Array, span: Array, before: Array) -> Geodesic:
        """By Newton's method, from the segment or the curve before, whichever is shorter."""
        straight, warm = (self._expand(p, span, a).energy for a in (np.zeros_like(before), before))
        found = self._descended(p, span, np.where(warm <= straight, before, 0.0), newton=True)
        found.status[~np.isfinite(straight)] = NOT_POSITIVE
        for part in found[1:]:
            part[..., found.status != FOUND] = 0.0
        return found

    def _descended(self, p: Array, span: Array, a: Array, newton: bool) -> Geodesic:
        """Steps until the energy falls no more: with the Hessian of a constant metric, or its own and line search."""
        found, lanes, share = None, np.arange(span.shape[1]), np.ones(1)
        for _ in range(_MOST if newton else _QUICK):
            curve = self._expand(p, span, a)
            if newton:
                step = self._newton_step(p, span, a, curve.gradient)
                share = self._share(p, span, (a, step, curve.energy))
            else:
                pulled = np.einsum("ijn,jkn->ikn", curve.W, curve.gradient)
                step = np.einsum("kl,iln->ikn", self._softness, pulled)
            gain, finite = np.einsum("ikn,ikn->n", curve.gradient, step), np.isfinite(curve.energy)
            a = a - share * step
            done = (gain <= _LAST * curve.energy) & finite & (share == 1)
            own = _settled(curve, a)
            if found is None:  # mostly of all lanes
                found = own
                found.status[~done] = NOT_FOUND
            else:
                for whole, part in zip(found, own, strict=True):
                    whole[..., lanes[done]] = part[..., done]
            left = ~done & finite & (share > 0)
            if not left.any():
                break
            lanes, p, span, a = lanes[left], _some(p, left), span[:, left], a[:, :, left]
        assert found is not None
        return found

    def _newton_step(self, p: Array, span: Array, a: Array, gradient: Array) -> Array:
        """H^-1 gradient, for a Hessian from differences of gradients; curvatures count without their sign."""
        n, K, N = a.shape
        R, size = n * K, _APART * np.sqrt((span**2).sum(axis=0))
        apart = np.eye(R).reshape(n, K, R, 1) * size
        moved = (a[:, :, None] + apart).reshape(n, K, R * N)
        wide = np.repeat(span[:, None], R, axis=1).reshape(n, R * N)
        starts = np.repeat(np.broadcast_to(p, span.shape)[:, None], R, axis=1).reshape(n, R * N)
        slopes = self._expand(starts, wide, moved).gradient.reshape(R, R, N) - gradient.reshape(R, 1, N)
        H = np.nan_to_num(np.moveaxis(slopes / size, -1, 0))
        curvature, Q = np.linalg.eigh((H + H.transpose(0, 2, 1)) / 2)
        curvature = np.abs(curvature)
        curvature = np.maximum(curvature, _FLAT * curvature[:, -1:])
        along = np.matmul(Q.transpose(0, 2, 1), gradient.reshape(R, N).T[..., None])
        return np.asarray(np.matmul(Q, along / curvature[..., None])[..., 0].T.reshape(n, K, N))

    def _share(self, p: Array, span: Array, line: tuple[Array, Array, Array]) -> Array:
        """The share of a step (N,) that does not raise the energy: 1, 1/2, 1/4 ..; 0 if none is found."""
        a, step, energy = line
        share = np.ones(len(energy))
        for _ in range(_HALVINGS):
            worse = ~(self._expand(p, span, a - share * step).energy <= energy * (1 + _ROUNDING))
            if not worse.any():
                return share
            share[worse] /= 2
        return np.where(worse, 0.0, share)

    def _expand(self, p: Array, span: Array, a: Array) -> _Curve:
        n, Q, N = len(p), len(self._s), span.shape[1]
        x = p[:, None] + span[:, None] * self._s[:, None] + np.matmul(self._phi.T, a)
        v = span[:, None] + np.matmul(self._slope.T, a)
        values = self._tape.run_floats_silenced(list(x), (Q, N))
        first, second = self._triangle
        m = _solved(_factored(values[: len(first)], n), v)
        density = np.einsum("iqn,iqn->qn", v, m)
        gradient = 2 * np.matmul(self._slope * self._weight, m)
        at = len(first)
        for i, places in self._slopes:
            pull = np.zeros((Q, N))
            for place, slope in zip(places, values[at : at + len(places)], strict=True):
                j, k = first[place], second[place]
                pull += slope * m[j] * m[k] * (1.0 if j == k else 2.0)
            gradient[i] -= (self._phi * self._weight) @ pull
            at += len(places)
        uneven = density.max(axis=0) - density.min(axis=0)
        return _Curve(self._weight @ density, gradient, uneven, m, self._full(values[: len(first), Q // 2]))

    def _full(self, lower: Array) -> Array:
        """The symmetric matrices (n, n, ..) of lower triangles."""
        n = int(self._triangle[0][-1]) + 1
        W = np.empty((n, n, *lower.shape[1:]))
        W[self._triangle] = lower
        W[self._triangle[::-1]] = lower
        return W


def _settled(curve: _Curve, a: Array) -> Geodesic:
    """The lanes as if they were done; `a` is one step further, for the next time."""
    resolved = curve.uneven <= _UNEVEN * curve.energy
    return Geodesic(np.where(resolved, FOUND, UNRESOLVED), curve.energy, curve.m[:, 0], curve.m[:, -1], a)


def _some(p: Array, lanes: NDArray[np.intp] | NDArray[np.bool_]) -> Array:
    """The plan of some lanes, where it is not that of all."""
    return p if p.shape[1] == 1 else p[:, lanes]


def _lower(W: Matrix) -> list[Expression]:
    return [row[j] for i, row in enumerate(W) for j in range(i + 1)]


def _factored(W: Array, n: int) -> dict[tuple[int, int], Array]:
    """The Cholesky factors of lower triangles, entry by entry; nan where W is not positive definite."""
    L = dict[tuple[int, int], Array]()
    for i in range(n):
        for j in range(i + 1):
            total = W[i * (i + 1) // 2 + j]
            for k in range(j):
                total = total - L[i, k] * L[j, k]
            L[i, j] = np.sqrt(total) if i == j else total / L[j, j]
    return L


def _solved(L: dict[tuple[int, int], Array], v: Array) -> Array:
    """m with L L'm = v, (n, ..)."""
    m, n = np.empty_like(v), len(v)
    for i in range(n):
        total = v[i]
        for k in range(i):
            total = total - L[i, k] * m[k]
        m[i] = total / L[i, i]
    for i in reversed(range(n)):
        total = m[i]
        for k in range(i + 1, n):
            total = total - L[k, i] * m[k]
        m[i] = total / L[i, i]
    return m


def _polynomials(degree: int) -> tuple[Array, Array, Array, Array]:
    """Nodes (Q,) on [0, 1], Clenshaw-Curtis weights (Q,), phi_k and their slopes (K, Q) for k = 2 .. degree."""
    from numpy.polynomial import chebyshev

    last = degree + _EXTRA_NODES - 1
    z = -np.cos(np.pi * np.arange(last + 1) / last)
    moments = np.array([0.0 if k % 2 else 2.0 / (1 - k * k) for k in range(last + 1)])
    weight = np.linalg.solve(chebyshev.chebvander(z, last).T, moments) / 2
    basis = [chebyshev.Chebyshev.basis(k) for k in range(2, degree + 1)]
    phi = [T(z) - (z if k % 2 else 1.0) for k, T in enumerate(basis, 2)]
    slopes = [2 * (T.deriv()(z) - k % 2) for k, T in enumerate(basis, 2)]
    return (z + 1) / 2, weight, np.array(phi), np.array(slopes)

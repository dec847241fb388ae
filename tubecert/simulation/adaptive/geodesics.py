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
from tubecert.expression import ZERO, Expression, free_symbols, symbol
from tubecert.model import ControlAffineModel
from tubecert.simulation.adaptive.loops import of_some, put

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
_TOGETHER: Final = 32  # lanes whose Hessians are taken at once: each is as dear as many curves
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
    """Of polynomials: energy (N,), its gradient by the coefficients (n, K, N), the squared speed (Q, N).

    `m` (n, Q, N) is M gamma_s at the nodes; `W` (n, n, N) is that of the middle.
    """

    energy: Array
    gradient: Array
    density: Array
    m: Array
    W: Array


class Geodesics:
    """Those of N lanes, at stages of Runge-Kutta steps one after the other.

    `a` (n, K, N) are the coefficients of the last ones, from which the next start. At every second stage time has gone
    on by half a step: there the coefficients go on as they did half a step before, three stages ago.
    """

    def __init__(self, model: ControlAffineModel, degree: int, lanes: int) -> None:
        n, used = len(model.states), free_symbols(e for row in model.W for e in row)
        self._moving, self._calls = [i for i, name in enumerate(model.states) if name in used], 0
        self.a = np.zeros((n, degree - 1, lanes))
        self._before = [self.a] * 2
        v, m = ([f"{of}#{i}" for i in range(n)] for of in "vm")
        slopes, bent = dict[str, Expression](), list[Expression]()
        for i in self._moving:
            entries = {
                f"W#{i}{j}{k}": (j, k) for j in range(n) for k in range(j + 1) if model.W_x[i][j][k] != ZERO
            }
            slopes |= {name: model.W_x[i][j][k] for name, (j, k) in entries.items()}
            terms = [
                symbol(name) * (1 + (j != k)) * symbol(m[j]) * symbol(m[k])
                for name, (j, k) in entries.items()
            ]
            bent.append(sum(terms, start=ZERO))
        rows = [e for row, ahead in zip(model.W, v, strict=True) for e in (*row, symbol(ahead))]
        self._tape = Tape([*rows, *slopes.values()], (*model.states, *v))
        self._bent = Tape(bent, (*slopes, *m))
        if self._moving:
            self._weight, self._basis, self._along, self._across = _polynomials(degree)
            slope = self._basis[len(self._weight) :, 1:]
            self._softness = np.linalg.inv(self._along @ slope)
        else:
            W = Tape([e for row in model.W for e in row], ()).run_floats([], ())
            self._M = np.linalg.inv(W.reshape(n, n))

    def connect(self, p: Array, q: Array) -> Geodesic:
        """From p (n, 1) or (n, N) to q (n, N)."""
        span = q - p
        if not self._moving:
            m = self._M @ span
            status = np.zeros(q.shape[1], dtype=np.int64)
            return Geodesic(status, np.einsum("in,in->n", span, m), m, m, self.a)
        ahead = 2 * self.a - self._before[0] if self._calls % 2 else self.a
        found = self._descended(p, span, ahead, newton=False)
        self._calls += 1
        if self._calls % _WATCHED == 1:
            straight = self._expand(p, span, np.zeros_like(self.a)).energy
            found.status[found.energy > straight * (1 + _LONGER)] = NOT_FOUND
        if found.status.any():
            left = np.flatnonzero(found.status)
            for some in np.array_split(left, -(-len(left) // _TOGETHER)):
                put(found, some, self._newton(_some(p, some), span[:, some], self.a[:, :, some]))
        self._before, self.a = [self._before[1], self.a], found.a
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
        found, lanes = None, np.arange(span.shape[1])
        share: Array | float = 1.0
        for _ in range(_MOST if newton else _QUICK):
            curve = self._expand(p, span, a)
            if newton:
                step = self._newton_step(p, span, a, curve.gradient)
                share = self._share(p, span, (a, step, curve.energy))
            else:
                step = self._softness @ np.einsum("ijn,jkn->ikn", curve.W, curve.gradient)
            gain = np.einsum("ikn,ikn->n", curve.gradient, step)
            a = a - share * step
            done = (gain <= _LAST * curve.energy) & (share == 1)
            uneven = curve.density.max(axis=0) - curve.density.min(axis=0)
            resolved = (uneven <= _UNEVEN * curve.energy) & (curve.energy < np.inf)
            status = np.where(resolved, FOUND, UNRESOLVED)
            own = Geodesic(status, curve.energy, curve.m[:, 0], curve.m[:, -1], a)  # as if all were done
            if found is None:
                found = own
                found.status[~done] = NOT_FOUND
            else:
                put(found, lanes[done], of_some(own, np.flatnonzero(done)))
            if done.all() or not (left := ~done & (share > 0)).any():
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
        n, Q, N = len(p), len(self._weight), span.shape[1]
        both = self._basis @ np.concatenate([span[:, None], a], axis=1)
        x, v = p[:, None] + both[:, :Q], both[:, Q:]
        values = self._tape.run_floats_silenced([*x, *v], (Q, N))
        rows, slopes = values[: n * n + n].reshape(n, n + 1, Q, N), values[n * n + n :]
        middle = rows[:, :n, Q // 2].copy()
        m, positive = _solved(rows)
        density = np.where(positive, np.einsum("iqn,iqn->qn", v, m), np.nan)
        gradient = self._along @ m
        gradient[self._moving] -= self._across @ self._bent.run_floats_silenced([*slopes, *m], (Q, N))
        return _Curve(self._weight @ density, gradient, density, m, middle)


def _some(p: Array, lanes: NDArray[np.intp] | NDArray[np.bool_]) -> Array:
    """The plan of some lanes, where it is not that of all."""
    return p if p.shape[1] == 1 else p[:, lanes]


def _solved(rows: Array) -> tuple[Array, NDArray[np.bool_]]:
    """m (n, ..) with W m = v, from rows (n, n + 1, ..) of W and v, which are lost; whether W is positive definite."""
    n, lowest = len(rows), rows[0, 0]
    for k in range(n):  # by Gauss and Jordan, without a search for pivots: these are positive
        lowest = np.minimum(lowest, rows[k, k])
        rows[k, k + 1 :] /= rows[k, k]
        others = rows[:, k].copy()
        others[k] = 0.0
        rows[:, k + 1 :] -= others[:, None] * rows[k, k + 1 :]
    return rows[:, n], lowest > 0


def _polynomials(degree: int) -> tuple[Array, Array, Array, Array]:
    """Clenshaw-Curtis weights (Q,) of nodes on [0, 1], and of s and phi_k, k = 2 .. degree: values and slopes there.

    Values, then slopes (2 Q, K + 1); what takes M gamma_s and what W_x does to its gradient to that of the energy,
    (K, Q) both.
    """
    from numpy.polynomial import chebyshev

    last = degree + _EXTRA_NODES - 1
    z = -np.cos(np.pi * np.arange(last + 1) / last)
    moments = np.array([0.0 if k % 2 else 2.0 / (1 - k * k) for k in range(last + 1)])
    weight = np.linalg.solve(chebyshev.chebvander(z, last).T, moments) / 2
    basis = [chebyshev.Chebyshev.basis(k) for k in range(2, degree + 1)]
    phi = np.array([(z + 1) / 2, *(T(z) - (z if k % 2 else 1.0) for k, T in enumerate(basis, 2))])
    slopes = np.array([0 * z + 1, *(2 * (T.deriv()(z) - k % 2) for k, T in enumerate(basis, 2))])
    return weight, np.hstack([phi, slopes]).T.copy(), 2 * slopes[1:] * weight, phi[1:] * weight

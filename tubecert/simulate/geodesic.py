"""Geodesics of a state-dependent metric: Chebyshev polynomials for the curve, Newton for the least energy.

gamma(s) = (1 - s) p + s q + sum_k a_k phi_k(s) with phi_k = T_k less its values at the ends; the energy
int gamma_s' M gamma_s ds is taken by Clenshaw-Curtis. Newton uses the exact Hessian; a step that does not lower the energy is
halved, and the result is refused unless it is stationary and no longer than the straight segment. A warm start that is not
finite or longer than the segment is forgotten. Source: K. Leung, I. R. Manchester, Nonlinear stabilization via control
contraction metrics: a pseudospectral approach for computing geodesics, ACC 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.expression import free_symbols
from tubecert.expression.matrix import Matrix, differentiate
from tubecert.model import ControlAffineModel
from tubecert.simulate.compiled import compiled
from tubecert.simulate.program import Index, Program, assemble, execute
from tubecert.simulate.small import dot, factor, solve

FOUND, NOT_POSITIVE, NOT_FOUND, UNRESOLVED = range(4)
REASONS = {
    NOT_POSITIVE: "the metric is not positive definite between plan and state",
    NOT_FOUND: "no geodesic from the plan to the state was found",
    UNRESOLVED: "the geodesic needs a polynomial of a higher degree",
}
_EXTRA_NODES = 2
_STATIONARY = 1e-20  # of the energy: what one more Newton step would gain
_MOST_STEPS = 30
_HALVINGS = 10
_UNEVEN = 0.05  # how far the squared speed may vary along the curve, of the energy


class Metric(NamedTuple):
    """W as programs: `values` gives the lower triangle of W, `slopes` also dW/dx_i and d2W/dx_i dx_j of the moving states.

    `constant` says that W is constant: then geodesics are segments. phi and phi_s (D - 1, Q) are the polynomials and
    their slopes at the nodes s (Q,) in [0, 1], `weight` (Q,) those of the quadrature.
    """

    n: int
    constant: bool
    moving: Index
    values: Program
    slopes: Program
    s: Array
    weight: Array
    phi: Array
    phi_s: Array


class Curve(NamedTuple):
    """Working memory and results of one geodesic: `a` (D - 1, n), covectors M gamma_s at both ends (n,)."""

    a: Array
    start: Array
    end: Array
    memory: Array
    memory_slopes: Array
    L: Array
    M: Array
    Hessian: Array
    Gauss: Array
    factor: Array
    gradient: Array
    step: Array
    trial: Array
    vectors: Array
    mixed: Array
    second: Array


def metric(model: ControlAffineModel, degree: int = 5) -> Metric:
    """The metric of a model for polynomials of a degree."""
    moving = [
        i for i, name in enumerate(model.states) if name in free_symbols(e for row in model.W for e in row)
    ]
    first = [model.W_x[i] for i in moving]
    second = [differentiate(w, model.states[j]) for i, w in enumerate(first) for j in moving[: i + 1]]
    return Metric(
        len(model.states),
        not moving,
        np.array(moving, dtype=np.int64),
        assemble(_lower([model.W]), model.states),
        assemble(_lower([model.W, *first, *second]), model.states),
        *_polynomials(degree),
    )


def _lower(matrices: list[Matrix]) -> list[Any]:
    return [row[j] for W in matrices for i, row in enumerate(W) for j in range(i + 1)]


def _polynomials(degree: int) -> tuple[Array, Array, Array, Array]:
    """Nodes, Clenshaw-Curtis weights, phi_k and phi_k' for k = 2..degree on [0, 1]."""
    from numpy.polynomial import chebyshev

    last = degree + _EXTRA_NODES - 1
    z = -np.cos(np.pi * np.arange(last + 1) / last)
    moments = np.array([0.0 if k % 2 else 2.0 / (1 - k * k) for k in range(last + 1)])
    weight = np.linalg.solve(chebyshev.chebvander(z, last).T, moments) / 2
    phi, phi_s = np.empty((degree - 1, last + 1)), np.empty((degree - 1, last + 1))
    for k in range(2, degree + 1):
        T = chebyshev.Chebyshev.basis(k)
        phi[k - 2] = T(z) - (z if k % 2 else 1.0)
        phi_s[k - 2] = 2 * (T.deriv()(z) - k % 2)
    return (z + 1) / 2, weight, phi, phi_s


def curve(metric: Metric) -> Curve:
    """Fresh working memory."""
    n, K = metric.n, len(metric.phi)
    size, moving = K * n, len(metric.moving)
    return Curve(
        np.zeros((K, n)),
        np.zeros(n),
        np.zeros(n),
        metric.values.start.copy(),
        metric.slopes.start.copy(),
        np.zeros((n, n)),
        np.zeros((n, n)),
        np.zeros((size, size)),
        np.zeros((size, size)),
        np.zeros((size, size)),
        np.zeros(size),
        np.zeros(size),
        np.zeros((K, n)),
        np.zeros((4, n)),
        np.zeros((2, max(moving, 1), n)),
        np.zeros((n, n)),
    )


@compiled
def connect(metric: Any, curve: Any, p: Any, q: Any) -> tuple[int, float]:
    """(status, energy) of the geodesic from p to q; `curve` then holds the covectors at its ends."""
    if metric.constant:
        return _segment(metric, curve, p, q)
    straight = _energy(metric, curve, p, q, curve.trial, True)
    if not straight > 0.0:  # nan where W is not positive definite
        for i in range(metric.n):
            curve.start[i] = curve.end[i] = 0.0
        return (FOUND if straight == 0.0 else NOT_POSITIVE), 0.0
    if not _energy(metric, curve, p, q, curve.a, False) <= straight:
        curve.a[:] = 0.0
    status, energy = _newton(metric, curve, p, q)
    if status != FOUND or not energy <= straight * (1 + 1e-9):
        curve.a[:] = 0.0
        status, energy = _newton(metric, curve, p, q)
    if status == FOUND and not energy <= straight * (1 + 1e-9):
        status = NOT_FOUND
    if status != FOUND:
        curve.a[:] = 0.0  # nothing of a failure is kept
    return status, energy


@compiled
def _segment(metric: Any, curve: Any, p: Any, q: Any) -> tuple[int, float]:
    n = metric.n
    if not _weight(metric.values, curve.memory, p, curve.L):
        return NOT_POSITIVE, 0.0
    for i in range(n):
        curve.step[i] = q[i] - p[i]
    solve(curve.L, curve.step[:n], curve.end)
    for i in range(n):
        curve.start[i] = curve.end[i]
    return FOUND, dot(curve.end, curve.step[:n])


@compiled
def _weight(program: Any, memory: Any, x: Any, L: Any) -> bool:
    """The Cholesky factor of W(x) into L."""
    n = x.shape[0]
    for i in range(n):
        memory[i] = x[i]
    execute(program, memory)
    place = 0
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = memory[program.outputs[place]]
            place += 1
    return bool(factor(L, L))


@compiled
def _point(metric: Any, a: Any, p: Any, q: Any, j: int, straight: bool, x: Any, v: Any) -> None:
    """gamma and gamma_s at node j."""
    for i in range(metric.n):
        x[i] = p[i] + metric.s[j] * (q[i] - p[i])
        v[i] = q[i] - p[i]
        if not straight:
            for k in range(a.shape[0]):
                x[i] += a[k, i] * metric.phi[k, j]
                v[i] += a[k, i] * metric.phi_s[k, j]


@compiled
def _energy(metric: Any, curve: Any, p: Any, q: Any, a: Any, straight: bool) -> float:
    """The energy of the curve with coefficients a, or of the segment; nan where W is not positive definite."""
    total = 0.0
    x, v, m = curve.vectors[0], curve.vectors[1], curve.vectors[2]
    for j in range(metric.s.shape[0]):
        _point(metric, a, p, q, j, straight, x, v)
        if not _weight(metric.values, curve.memory, x, curve.L):
            return np.nan
        solve(curve.L, v, m)
        total += metric.weight[j] * dot(v, m)
    return total


@compiled
def _newton(metric: Any, curve: Any, p: Any, q: Any) -> tuple[int, float]:
    size = curve.step.shape[0]
    n = metric.n
    energy, uneven = _expand(metric, curve, p, q)
    for _ in range(_MOST_STEPS):
        if not np.isfinite(energy):
            return NOT_POSITIVE, energy
        if not factor(curve.Hessian, curve.factor) and not factor(curve.Gauss, curve.factor):
            return NOT_FOUND, energy
        solve(curve.factor, curve.gradient, curve.step)
        gain = dot(curve.gradient, curve.step)
        if gain <= _STATIONARY * energy:
            return (UNRESOLVED if uneven > _UNEVEN * energy else FOUND), energy
        share, lowered = 1.0, False
        for i in range(size):
            curve.trial[i // n, i % n] = curve.a[i // n, i % n]
        for _ in range(_HALVINGS):
            for i in range(size):
                curve.a[i // n, i % n] = curve.trial[i // n, i % n] - share * curve.step[i]
            reached, uneven = _expand(metric, curve, p, q)
            if reached <= energy * (1 + 1e-13):
                lowered = True
                break
            share *= 0.5
        if not lowered:
            return NOT_FOUND, energy
        energy = reached
    return NOT_FOUND, energy


@compiled
def _expand(metric: Any, curve: Any, p: Any, q: Any) -> tuple[float, float]:
    """Energy, and the variation of the squared speed; gradient and Hessian by the coefficients go into `curve`.

    `Gauss` is the part of the Hessian in M alone, which is positive definite wherever W is.
    """
    n, K, Q = metric.n, curve.a.shape[0], metric.s.shape[0]
    size = K * n
    for r in range(size):
        curve.gradient[r] = 0.0
        for c in range(size):
            curve.Hessian[r, c] = 0.0
            curve.Gauss[r, c] = 0.0
    x, v, m = curve.vectors[0], curve.vectors[1], curve.vectors[2]
    energy, least, largest = 0.0, np.inf, 0.0
    for j in range(Q):
        _point(metric, curve.a, p, q, j, False, x, v)
        if not _weight(metric.slopes, curve.memory_slopes, x, curve.L):
            return np.nan, np.nan
        solve(curve.L, v, m)
        if j == 0:
            curve.start[:] = m
        if j == Q - 1:
            curve.end[:] = m
        density = dot(v, m)
        least, largest = min(least, density), max(largest, density)
        energy += metric.weight[j] * density
        _local(metric, curve, m)
        _gather(metric, curve, j, m)
    for r in range(size):
        for c in range(r):
            curve.Hessian[c, r] = curve.Hessian[r, c]
            curve.Gauss[c, r] = curve.Gauss[r, c]
    return energy, largest - least


@compiled
def _local(metric: Any, curve: Any, m: Any) -> None:
    """Second derivatives of v'Mv at one node: M, mixed -2 M W_i m, and 2 m'W_i M W_j m - m'W_ij m by the moving states."""
    n, moving = metric.n, metric.moving.shape[0]
    memory, outputs = curve.memory_slopes, metric.slopes.outputs
    triangle = n * (n + 1) // 2
    unit = curve.vectors[3]
    for i in range(n):
        for k in range(n):
            unit[k] = 1.0 if k == i else 0.0
        solve(curve.L, unit, curve.M[i])
    place = triangle
    for i in range(moving):
        w, Mw = curve.mixed[0, i], curve.mixed[1, i]
        _times(memory, outputs, place, m, w)
        solve(curve.L, w, Mw)
        place += triangle
    for i in range(moving):
        for j in range(i + 1):
            _times(memory, outputs, place, m, unit)
            value = 2 * dot(curve.mixed[0, i], curve.mixed[1, j]) - dot(unit, m)
            curve.second[i, j] = curve.second[j, i] = value
            place += triangle


@compiled
def _times(memory: Any, outputs: Any, place: int, m: Any, w: Any) -> None:
    """w = S m for the symmetric matrix S whose lower triangle begins at an output."""
    n = m.shape[0]
    for i in range(n):
        w[i] = 0.0
    for i in range(n):
        for j in range(i + 1):
            value = memory[outputs[place]]
            place += 1
            w[i] += value * m[j]
            if j < i:
                w[j] += value * m[i]


@compiled
def _gather(metric: Any, curve: Any, j: int, m: Any) -> None:
    """Adds the node's share to gradient and Hessian (lower triangles)."""
    n, K, moving = metric.n, curve.a.shape[0], metric.moving.shape[0]
    weight = metric.weight[j]
    for k in range(K):
        phi, slope = metric.phi[k, j], metric.phi_s[k, j]
        for i in range(n):
            curve.gradient[k * n + i] += weight * 2 * m[i] * slope
        for a in range(moving):
            curve.gradient[k * n + metric.moving[a]] -= weight * phi * dot(m, curve.mixed[0, a])
        for l in range(k + 1):
            phi_l, slope_l = metric.phi[l, j], metric.phi_s[l, j]
            common = weight * 2 * slope * slope_l
            for r in range(n):
                for c in range(n):
                    curve.Gauss[k * n + r, l * n + c] += common * curve.M[r, c]
                    curve.Hessian[k * n + r, l * n + c] += common * curve.M[r, c]
            for a in range(moving):
                at = metric.moving[a]
                for c in range(n):
                    mixed = -2 * weight * curve.mixed[1, a, c]
                    curve.Hessian[k * n + at, l * n + c] += mixed * phi * slope_l
                    curve.Hessian[k * n + c, l * n + at] += mixed * slope * phi_l
                for b in range(moving):
                    curve.Hessian[k * n + at, l * n + metric.moving[b]] += (
                        weight * phi * phi_l * curve.second[a, b]
                    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Geodesic:
    """A geodesic from p to q: its energy E = d^2, and gamma_s and M gamma_s at both ends, (2, n); None if not `found`."""

    found: bool
    reason: str
    energy: float
    covectors: Array
    coefficients: Array


def geodesic(space: Metric, p: Array, q: Array, memory: Curve | None = None) -> Geodesic:
    """The geodesic from p (n,) to q (n,); `memory` of an earlier one makes a warm start."""
    work = curve(space) if memory is None else memory
    status, energy = connect(space, work, np.asarray(p, dtype=float), np.asarray(q, dtype=float))
    return Geodesic(
        found=status == FOUND,
        reason=REASONS.get(status, ""),
        energy=float(energy),
        covectors=np.stack([work.start, work.end]),
        coefficients=work.a.copy(),
    )

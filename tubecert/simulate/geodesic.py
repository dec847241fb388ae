"""Geodesics of a state-dependent metric: Chebyshev polynomials for the curve, Newton for the least energy.

gamma(s) = (1 - s) p + s q + sum_k a_k phi_k(s) with phi_k = T_k less its values at the ends; the energy int
gamma_s' M gamma_s ds is taken by Clenshaw-Curtis. Newton uses the exact Hessian; a step that does not lower the
energy is halved, and the result is refused unless it is stationary and no longer than the straight segment. A warm
start that is not finite or longer than the segment is forgotten. Source: K. Leung, I. R. Manchester, Nonlinear
stabilization via control contraction metrics: a pseudospectral approach for computing geodesics, ACC 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.expression import free_symbols
from tubecert.expression.matrix import Matrix, differentiate
from tubecert.model import ControlAffineModel
from tubecert.simulate.compiled import compiled, entry, folded
from tubecert.simulate.program import Index, Program, assemble, execute
from tubecert.simulate.small import copy, dot, factor, solve

FOUND, NOT_POSITIVE, NOT_FOUND, UNRESOLVED = range(4)
REASONS = {
    NOT_POSITIVE: "the metric is not positive definite between plan and state",
    NOT_FOUND: "no geodesic from the plan to the state was found",
    UNRESOLVED: "the geodesic needs a polynomial of a higher degree",
}
_EXTRA_NODES = 2
_STATIONARY = 1e-20  # of the energy: what one more Newton step would gain
_LAST = 1e-11  # of the energy: after a full step that gains as little, the next would gain about its square
_MOST_STEPS = 30
_HALVINGS = 10
_SHIFTS = 20
_ROUNDING = 1e-12
_UNEVEN = 0.05  # how far the squared speed may vary along the curve, of the energy


class Metric(NamedTuple):
    """W as a program of x: the lower triangles of W, of dW/dx_i and of d2W/dx_i dx_j, of the `moving` states.

    The first `short` steps give W alone. No moving states: W is constant, and geodesics are segments. The columns of
    `table` (2 D, Q) belong to the nodes: s in [0, 1], weight, then phi_k and then their slopes for k = 2..D.
    """

    moving: Index
    program: Program
    short: int
    table: Array


class Bend(NamedTuple):
    """Working memory of Newton's method.

    `a` (2, D - 1, n): the coefficients, and those before the step; `large` (2, R, R): Hessian and a factor of it, R =
    (D - 1) n; `columns` (2, R): gradient and step; `mixed` (2, n, n): rows W_i m and M W_i m; `second` (n, n): second
    derivatives by x.
    """

    a: Array
    large: Array
    columns: Array
    mixed: Array
    second: Array


class Curve(NamedTuple):
    """Working memory and results of one geodesic.

    `vectors` (6, n): the covectors M gamma_s at start and end, then scratch; `squares` (2, n, n): a factor of W, and
    M. Without a `bend` W is constant, and what bends curves is not even compiled.
    """

    memory: Array
    vectors: Array
    squares: Array
    bend: Bend | None


def metric(model: ControlAffineModel, degree: int = 5) -> tuple[Metric, Curve]:
    """The metric of a model for polynomials of a degree, and working memory for it."""
    used = free_symbols(e for row in model.W for e in row)
    moving = [i for i, name in enumerate(model.states) if name in used]
    first = [model.W_x[i] for i in moving]
    second = [differentiate(w, model.states[j]) for i, w in enumerate(first) for j in moving[: i + 1]]
    short = len(assemble(_lower([model.W]), model.states)[0].steps)
    program, memory = assemble(_lower([model.W, *first, *second]), model.states)
    n, K = len(model.states), degree - 1
    R = K * n
    shapes = ((2, K, n), (2, R, R), (2, R), (2, n, n), (n, n))
    bend = Bend(*map(np.zeros, shapes)) if moving else None
    space = Metric(np.array(moving, dtype=np.int64), program, short, _polynomials(degree))
    return space, Curve(memory, np.zeros((6, n)), np.zeros((2, n, n)), bend)


def copied(curve: Curve) -> Curve:
    """The same for another thread."""
    bend = None if curve.bend is None else Bend(*(part.copy() for part in curve.bend))
    return Curve(curve.memory.copy(), curve.vectors.copy(), curve.squares.copy(), bend)


def _lower(matrices: list[Matrix]) -> list[Any]:
    return [row[j] for W in matrices for i, row in enumerate(W) for j in range(i + 1)]


def _polynomials(degree: int) -> Array:
    """Nodes, Clenshaw-Curtis weights, phi_k and phi_k' for k = 2..degree on [0, 1]."""
    from numpy.polynomial import chebyshev

    last = degree + _EXTRA_NODES - 1
    z = -np.cos(np.pi * np.arange(last + 1) / last)
    moments = np.array([0.0 if k % 2 else 2.0 / (1 - k * k) for k in range(last + 1)])
    weight = np.linalg.solve(chebyshev.chebvander(z, last).T, moments) / 2
    basis = [chebyshev.Chebyshev.basis(k) for k in range(2, degree + 1)]
    phi = [T(z) - (z if k % 2 else 1.0) for k, T in enumerate(basis, 2)]
    slopes = [2 * (T.deriv()(z) - k % 2) for k, T in enumerate(basis, 2)]
    return np.array([(z + 1) / 2, weight, *phi, *slopes])


@compiled
def connect(metric: Any, curve: Any, bend: Any, p: Any, q: Any) -> tuple[int, float]:
    """(status, energy) of the geodesic from p to q; `curve`, which has the `bend`, holds the covectors at its ends."""
    straight = _straight(metric, curve, p, q)
    if not np.isfinite(straight):
        return NOT_POSITIVE, straight
    status, energy = FOUND, straight
    if bend is not None:
        for _ in range(2 if straight > 0.0 else 0):
            status, energy = _newton(metric, curve, p, q, straight)
            if status == FOUND:
                break
            forget(bend)  # once more from the segment; nothing of a failure is kept
    return status, energy


@compiled
def forget(bend: Any) -> None:
    """The next geodesic starts from the segment."""
    if bend is not None:
        bend.a[:] = 0.0


@compiled
def _weight(metric: Any, curve: Any, steps: int, x: Any) -> bool:
    """The Cholesky factor of W(x) after the first steps of the program."""
    n, memory, L = x.shape[0], curve.memory, curve.squares[0]
    for i in range(n):
        memory[i] = x[i]
    execute(metric.program.steps, steps, memory)
    place = 0
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = memory[metric.program.outputs[place]]
            place += 1
    return bool(factor(L, L))


@folded
def _straight(metric: Any, curve: Any, p: Any, q: Any) -> float:
    """The energy of the segment; nan where W is not positive definite."""
    n, total = p.shape[0], 0.0
    start, end, x, v = curve.vectors[0], curve.vectors[1], curve.vectors[2], curve.vectors[3]
    count = metric.table.shape[1] if metric.moving.shape[0] else 1
    for i in range(n):
        v[i] = q[i] - p[i]
    for j in range(count):
        for i in range(n):
            x[i] = p[i] + metric.table[0, j] * v[i]
        if not _weight(metric, curve, metric.short, x):
            return np.nan
        solve(curve.squares[0], v, end)
        total += (metric.table[1, j] if count > 1 else 1.0) * dot(v, end)
    for i in range(n):
        start[i] = end[i]  # exact for a constant W, and for a segment of no length
    return total


@compiled
def _newton(metric: Any, curve: Any, p: Any, q: Any, most: float) -> tuple[int, float]:
    """Newton from the coefficients of `curve`, never to an energy above `most`."""
    a, before, step = curve.bend.a[0], curve.bend.a[1], curve.bend.columns[1]
    n = p.shape[0]
    energy, share, halvings = most, 1.0, 0
    for count in range(_MOST_STEPS):
        reached, uneven = _expand(metric, curve, p, q)
        if reached <= energy * (1 + _ROUNDING):
            energy, share, halvings = reached, 1.0, 0
            shift = _shift(curve.bend.large)
            if not np.isfinite(shift):
                return NOT_FOUND, energy
            solve(curve.bend.large[1], curve.bend.columns[0], step)
            gain = dot(curve.bend.columns[0], step)
            if gain <= (_LAST if shift == 0.0 else _STATIONARY) * energy:
                if gain > _STATIONARY * energy:
                    energy -= _leave(metric, curve, p, q, 0.5 * gain)
                return (UNRESOLVED if uneven > _UNEVEN * energy else FOUND), energy
            for k in range(a.shape[0]):
                copy(before[k], a[k])
        elif count == 0 or halvings == _HALVINGS:
            return NOT_FOUND, energy
        else:
            share, halvings = 0.5 * share, halvings + 1
        for r in range(step.shape[0]):
            a[r // n, r % n] = before[r // n, r % n] - share * step[r]
    return NOT_FOUND, energy


@compiled
def _leave(metric: Any, curve: Any, p: Any, q: Any, gain: float) -> float:
    """Takes the last step: what depends on it are the covectors at both ends."""
    a, step, table = curve.bend.a[0], curve.bend.columns[1], metric.table
    v, n, K = curve.vectors[3], p.shape[0], a.shape[0]
    for r in range(step.shape[0]):
        a[r // n, r % n] -= step[r]
    for end in range(2):
        place = -end  # the first and the last node
        for i in range(n):
            v[i] = q[i] - p[i]
            for k in range(K):
                v[i] += a[k, i] * table[2 + K + k, place]
        if not _weight(metric, curve, metric.short, p if end == 0 else q):
            return np.nan
        solve(curve.squares[0], v, curve.vectors[end])
    return gain


@compiled
def _largest(A: Any) -> float:
    """The largest size of an entry."""
    found = 0.0
    for r in range(A.shape[0]):
        for c in range(A.shape[1]):
            found = max(found, abs(A[r, c]))
    return found


@compiled
def _shift(large: Any) -> float:
    """Factors the Hessian, shifted until it is positive definite: by how much, inf if no shift serves."""
    R, shift = large.shape[1], 0.0
    for _ in range(_SHIFTS):
        if factor(large[0], large[1]):
            return shift
        more = max(shift, 1e-3 * _largest(large[0]))
        for r in range(R):
            large[0, r, r] += more
        shift += more
    return np.inf


@compiled
def _expand(metric: Any, curve: Any, p: Any, q: Any) -> tuple[float, float]:
    """Energy, and the variation of the squared speed; gradient and Hessian by the coefficients go into `curve`."""
    n, K, Q, table, a = (
        p.shape[0],
        curve.bend.a.shape[1],
        metric.table.shape[1],
        metric.table,
        curve.bend.a[0],
    )
    x, v, m = curve.vectors[2], curve.vectors[3], curve.vectors[4]
    curve.bend.columns[0] = 0.0
    curve.bend.large[0] = 0.0
    energy, least, largest = 0.0, np.inf, 0.0
    for j in range(Q):
        for i in range(n):
            v[i] = q[i] - p[i]
            x[i] = p[i] + table[0, j] * v[i]
            for k in range(K):
                x[i] += a[k, i] * table[2 + k, j]
                v[i] += a[k, i] * table[2 + K + k, j]
        if not _weight(metric, curve, metric.program.steps.shape[0], x):
            return np.nan, np.nan
        solve(curve.squares[0], v, m)
        if j == 0:
            copy(curve.vectors[0], m)
        density = dot(v, m)
        least, largest = min(least, density), max(largest, density)
        energy += table[1, j] * density
        _local(metric, curve, m)
        _gather(metric, curve, j, m)
    copy(curve.vectors[1], m)
    for r in range(K * n):
        for c in range(r):
            curve.bend.large[0, c, r] = curve.bend.large[0, r, c]
    return energy, largest - least


@compiled
def _local(metric: Any, curve: Any, m: Any) -> None:
    """Derivatives of v'Mv at one node: M, W_i m and M W_i m, and 2 m'W_i M W_j m - m'W_ij m by the moving states."""
    n, moving = m.shape[0], metric.moving.shape[0]
    L, M, unit = curve.squares[0], curve.squares[1], curve.vectors[5]
    place, triangle = 0, n * (n + 1) // 2
    for i in range(n):
        unit[:] = 0.0
        unit[i] = 1.0
        solve(L, unit, M[i])
    for i in range(moving):
        place += triangle
        _times(curve.memory, metric.program.outputs, place, m, curve.bend.mixed[0, i])
        solve(L, curve.bend.mixed[0, i], curve.bend.mixed[1, i])
    for i in range(moving):
        for j in range(i + 1):
            place += triangle
            _times(curve.memory, metric.program.outputs, place, m, unit)
            value = 2 * dot(curve.bend.mixed[0, i], curve.bend.mixed[1, j]) - dot(unit, m)
            curve.bend.second[i, j] = curve.bend.second[j, i] = value


@compiled
def _times(memory: Any, outputs: Any, place: int, m: Any, w: Any) -> None:
    """w = S m for the symmetric matrix S whose lower triangle begins at an output."""
    w[:] = 0.0
    for i in range(m.shape[0]):
        for j in range(i + 1):
            value = memory[outputs[place]]
            place += 1
            w[i] += value * m[j]
            if j < i:
                w[j] += value * m[i]


@compiled
def _gather(metric: Any, curve: Any, node: int, m: Any) -> None:
    """Adds the node's share to the gradient, and to the block-lower triangle of the Hessian."""
    n, K, moving, table = m.shape[0], curve.bend.a.shape[1], metric.moving.shape[0], metric.table
    gradient, Hessian = curve.bend.columns[0], curve.bend.large[0]
    M, W_m, M_W_m = curve.squares[1], curve.bend.mixed[0], curve.bend.mixed[1]
    for k in range(K):
        phi, slope = table[1, node] * table[2 + k, node], table[1, node] * table[2 + K + k, node]
        for i in range(n):
            gradient[k * n + i] += 2 * m[i] * slope
        for a in range(moving):
            gradient[k * n + metric.moving[a]] -= phi * dot(m, W_m[a])
        for l in range(k + 1):
            phi_l, slope_l = table[2 + l, node], table[2 + K + l, node]
            for r in range(n):
                for c in range(n):
                    Hessian[k * n + r, l * n + c] += 2 * slope * slope_l * M[r, c]
            for a in range(moving):
                at = metric.moving[a]
                for c in range(n):
                    Hessian[k * n + at, l * n + c] -= 2 * phi * slope_l * M_W_m[a, c]
                    Hessian[k * n + c, l * n + at] -= 2 * slope * phi_l * M_W_m[a, c]
                for b in range(moving):
                    Hessian[k * n + at, l * n + metric.moving[b]] += phi * phi_l * curve.bend.second[a, b]


@entry
def solve_all(metric: Any, curve: Any, p: Any, q: Any, status: Any, energy: Any) -> None:
    """Geodesics from p (N, n) to q (N, n), each one the warm start of the next: status and energy (N,)."""
    for i in range(p.shape[0]):
        status[i], energy[i] = connect(metric, curve, curve.bend, p[i], q[i])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Geodesic:
    """A geodesic from p to q: its energy E = d^2, M gamma_s at both ends (2, n), and its coefficients (D - 1, n).

    If it was not `found`, `reason` says why and the rest means nothing.
    """

    found: bool
    reason: str
    energy: float
    covectors: Array
    coefficients: Array


def geodesic(space: Metric, memory: Curve, p: Array, q: Array) -> Geodesic:
    """The geodesic from p (n,) to q (n,); `memory` makes the one before a warm start."""
    status, energy = np.zeros(1, dtype=np.int64), np.zeros(1)
    ends = (np.array([end], dtype=float) for end in (p, q))
    solve_all(space, memory, *ends, status, energy)
    return Geodesic(
        found=bool(status[0] == FOUND),
        reason=REASONS.get(int(status[0]), ""),
        energy=float(energy[0]),
        covectors=memory.vectors[:2].copy(),
        coefficients=np.zeros((0, len(p))) if memory.bend is None else memory.bend.a[0].copy(),
    )

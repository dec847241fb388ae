"""Why there is no metric: a mode of the linearisation that no input reaches bounds the rate. Exact but for the roots.

Where f(x) + B(x) u = 0, C3 makes the projected C2 that of the linear system (A, B), A = f_x + sum_j u_j (b_j)_x.
With Z a basis of the left null space of [B, AB, ..., A^(n-1) B] and Z A = A_c Z: for A_c'p = s p, v = Z'p has B'v = 0,
and C2 in direction v says 2 (Re s + rate) v'Wv <= 0. So no metric has the rate if some Re s > -rate. f, B and their
slopes must be rational at the point; the roots of the characteristic polynomial of A_c are enclosed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

from flint import fmpq, fmpq_mat

from tubecert.recheck.balls import exact
from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import CONFIRMED
from tubecert.recheck.reading import upright
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.metric import Wanted
from tubecert.recheck.specified.plant import Plant
from tubecert.recheck.specified.trajectory import Planned, Resting
from tubecert.recheck.terms import Matrix, Rows, matrix_replaced, matrix_slopes, number, number_of


def excludes(spec: Specification) -> Outcome:
    """Whether the rate that the specification asks for is excluded at one of the points that suggest themselves."""
    plant = spec.plant
    if not isinstance(spec.metric, Wanted) or spec.metric.rate is None:
        return Outcome(verdict="undecided", why="no rate is asked for")
    for point in _points(spec):
        if all(low <= x <= high for x, (low, high) in zip(point, plant.safe_set.values(), strict=True)):
            linear = _linearised(plant, point)
            if linear is not None and _has_slow_mode(*linear, spec.metric.rate):
                return CONFIRMED
    return Outcome(verdict="undecided", why="no uncontrollable mode was found that excludes the rate")


def _points(spec: Specification) -> Iterator[Sequence[Fraction]]:
    """Rational points that may be equilibria: the plan's, its target, the centre of the set, the origin."""
    trajectory = spec.trajectory
    if isinstance(trajectory, Resting):
        yield trajectory.at
    if isinstance(trajectory, Planned):
        yield trajectory.target
    yield [(low + high) / 2 for low, high in spec.plant.safe_set.values()]
    yield [Fraction(0)] * len(spec.plant.states)


def _linearised(plant: Plant, point: Sequence[Fraction]) -> tuple[fmpq_mat, fmpq_mat] | None:
    """(A, B) at a point, if it is a (forced) equilibrium and everything is rational there."""
    values = {name: number(q) for name, q in zip(plant.states, point, strict=True)}

    def rational(rows: Rows) -> fmpq_mat | None:
        there: Matrix = matrix_replaced(rows, values)
        if any(e.op != "const" for row in there for e in row):
            return None
        entries = [number_of(e) for row in there for e in row]
        return fmpq_mat(len(rows), len(rows[0]), [fmpq(q.numerator, q.denominator) for q in entries])

    drift = upright(plant.f)
    f, B = rational(drift), rational(plant.B)
    slopes = [[rational(matrix_slopes(rows, name)) for name in plant.states] for rows in (drift, plant.B)]
    if f is None or B is None or any(column is None for columns in slopes for column in columns):
        return None
    n, m = B.nrows(), B.ncols()
    gram = B.transpose() * B
    if gram.rank() < m:
        return None
    u = gram.solve(B.transpose() * f) * fmpq(-1)
    if f + B * u != fmpq_mat(n, 1):
        return None
    columns = [f_k + B_k * u for f_k, B_k in zip(*slopes, strict=True)]
    return fmpq_mat(n, n, [columns[k][i, 0] for i in range(n) for k in range(n)]), B


def _has_slow_mode(A: fmpq_mat, B: fmpq_mat, rate: Fraction) -> bool:
    """Whether some uncontrollable mode s has Re s > -rate."""
    n = A.nrows()
    blocks = [B]
    for _ in range(n - 1):
        blocks.append(A * blocks[-1])
    reached = fmpq_mat(n * B.ncols(), n, [e for block in blocks for e in block.transpose().entries()])
    echelon, rank = reached.rref()
    leading = [next(j for j in range(n) if echelon[i, j] != 0) for i in range(rank)]
    free = [j for j in range(n) if j not in leading]
    if not free:
        return False
    # rows z with z [B, AB, ...] = 0: one for each free column, 1 there and 0 at the others
    Z = fmpq_mat(
        len(free),
        n,
        [
            -echelon[leading.index(j), k] if j in leading else fmpq(int(j == k))
            for k in free
            for j in range(n)
        ],
    )
    image = Z * A
    A_c = fmpq_mat(len(free), len(free), [image[i, k] for i in range(len(free)) for k in free])
    assert image == A_c * Z, "the left null space of the controllability matrix is invariant"
    roots: Any = A_c.charpoly().complex_roots()  # with multiplicities, which flint's types do not say
    return any(bool(s.real + exact(rate) > 0) for s, _ in roots)

"""Vector fields that commute with the columns of a state-dependent B.

Their components are sought as combinations of products of the functions that occur in B, its divisors'
reciprocals and the states that B moves; [b_j, e] = 0 is linear in the coefficients. It is sampled at random
*rational* points (sines and cosines at rational points of the circle), solved exactly, and proven as an identity.
Untrusted: `verify` proves C3 for the metric that comes of it.

Frames in closed form where B depends only on states that it does not move (mechanical systems: on positions).

With m pivot rows R of B, B_R invertible, and x_R the states of these rows,
    e_j = d/dx_j + (dB/dx_j) B_R^-1 x_R  for states j that B depends on,  e_i = d/dx_i  for all others,
commute with every column: [b_k, e_j] = -db_k/dx_j + (dB/dx_j) B_R^-1 (b_k)_R = 0. They are independent everywhere.
If B_R is the inverse of a mass matrix, B_R^-1 is simpler:
    (dB/dx_j) B_R^-1 = d(B B_R^-1)/dx_j - B d(B_R^-1)/dx_j.
Untrusted: `verify` proves C3 for the metric that comes of it. Implements: (CCM_3).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from fractions import Fraction
from random import Random

import numpy as np

from tubecert.enclosure.tape import Tape
from tubecert.expression import ONE, ZERO, Expression, cos, free_symbols, is_zero, sin, symbol, topological
from tubecert.expression.graph import FUNCTIONS
from tubecert.expression.matrix import (
    Matrix,
    adjugate,
    column,
    combine,
    determinant,
    differentiate,
    dot,
    identity,
    jacobian,
    multiply,
    null_space,
    transpose,
)
from tubecert.model import ControlAffineModel, divide
from tubecert.synthesis.lifting import Lifted, at_point, lift, products, reduced, unit_angles

_DEGREE = 5
_UNKNOWNS = 900
_ATOMS = frozenset(FUNCTIONS) - {"sin", "cos", "tan"}

Field = tuple[Expression, ...]
Unknown = tuple[int, int]  # (k, i): the coefficient of function k in component i


def commuting_frame(model: ControlAffineModel) -> Matrix | None:
    """E (n, n): columns that commute with every column of B and are independent; None if none is found.

    First e_i = d/dx_i + fields in the directions that B moves, which is independent everywhere if these directions
    commute by themselves; then any components, which may be dependent at some points (C1 fails there).
    """
    return _search(model, narrow=True) or _search(model, narrow=False)


def _search(model: ControlAffineModel, *, narrow: bool) -> Matrix | None:
    n = len(model.states)
    moved = [i for i, row in enumerate(model.B) if any(e is not ZERO for e in row)]
    generator = Random(1)  # noqa: S311 - any points will do, the same each time
    found: list[Field] = []
    previous = 0
    for degree in range(_DEGREE + 1):
        functions = _dictionary(model, degree)
        unknowns = [
            (k, i) for k in range(len(functions)) for i in range(n) if k == 0 or i in moved or not narrow
        ]
        if len(functions) == previous or len(unknowns) > _UNKNOWNS:
            continue
        previous = len(functions)
        for field in _solutions(model, functions, unknowns, generator):
            if all(_commutes(model, field, j) for j in range(len(model.inputs))):
                found = _extended(found, field, generator)
            if len(found) == n:
                return transpose(_ordered(found, n))
    return None


def _dictionary(model: ControlAffineModel, degree: int) -> list[Expression]:
    """Products of at most `degree` atoms, the simplest first; states that B moves enter at most linearly."""
    entries = [e for row in model.B for e in row]
    nodes = topological(entries)
    units = unit_angles(entries)
    angles = {
        name: units.get(name, Fraction(1)) * symbol(name)
        for node in nodes
        if node.op in ("sin", "cos", "tan")
        for name in sorted(free_symbols(node.args))
    }
    atoms: list[Expression] = []
    for name in sorted(free_symbols(entries)):
        atoms += [cos(angles[name]), sin(angles[name])] if name in angles else [symbol(name)]
    divisors = dict.fromkeys(node.args[1] for node in nodes if node.op == "div")
    atoms += [ONE / e for e in divisors]
    atoms += [node for node in nodes if node.op in _ATOMS]
    moved = [
        symbol(name)
        for name, row in zip(model.states, model.B, strict=True)
        if any(e is not ZERO for e in row) and symbol(name) not in atoms
    ]
    found = products([*atoms, *moved], degree)
    return list(dict.fromkeys(own for choice, own in found if sum(a in moved for a in choice) <= 1))


def _solutions(
    model: ControlAffineModel, functions: Sequence[Expression], unknowns: Sequence[Unknown], generator: Random
) -> list[Field]:
    """Fields sum_k c_ki phi_k with b_j(e_i) = sum_l e_l d(b_ji)/dx_l at sampled points, the simplest first."""
    import flint

    n, m = len(model.states), len(model.inputs)
    slopes = jacobian(functions, model.states)  # d phi_k/dx_l
    # b_j(phi_k)
    along = [[dot(slopes[k], model.columns[j]) for j in range(m)] for k in range(len(functions))]
    flat = [
        *(e for row in along for e in row),
        *functions,
        *(e for j in range(m) for row in model.b_x[j] for e in row),
    ]
    lifted = lift(flat, opaque=True)
    place = {unknown: position for position, unknown in enumerate(unknowns)}
    K = len(functions)
    rows: list[list[Fraction]] = []
    for _ in range(len(unknowns) + 8 * n):
        if len(rows) > len(unknowns) + 8 * n:
            break
        try:
            values = at_point(lifted.expressions, _random_point(lifted, generator))
        except ZeroDivisionError:
            continue
        moved, phi, b_x = values[: K * m], values[K * m : K * m + K], values[K * m + K :]
        for j in range(m):
            for i in range(n):
                row = [Fraction(0)] * len(unknowns)
                for (k, component), position in place.items():
                    row[position] = -phi[k] * b_x[(j * n + i) * n + component]
                    if component == i:
                        row[position] += moved[k * m + j]
                if any(row):
                    rows.append(row)
    if not rows:
        rows.append([Fraction(0)] * len(unknowns))
    matrix = flint.fmpq_mat([[flint.fmpq(q.numerator, q.denominator) for q in row] for row in rows])
    fields = []
    for vector in _null_space(matrix):
        entries = [ZERO] * n
        for position, q in vector.items():
            k, i = unknowns[position]
            entries[i] = entries[i] + q * functions[k]
        fields.append(tuple(entries))
    return fields


def _null_space(matrix: object) -> list[dict[int, Fraction]]:
    """Null vectors by reduced row echelon form, one per free column, in the order of these columns."""
    reduced, rank = matrix.rref()  # type: ignore[attr-defined]
    table = reduced.tolist()[:rank]
    pivots = [next(j for j, q in enumerate(row) if q != 0) for row in table]
    width = reduced.ncols()
    vectors = []
    for j in sorted(set(range(width)) - set(pivots)):
        vector = {j: Fraction(1)}
        for row, pivot in zip(table, pivots, strict=True):
            if row[j] != 0:
                vector[pivot] = -Fraction(int(row[j].p), int(row[j].q))
        vectors.append(vector)
    return vectors


def _random_point(lifted: Lifted, generator: Random) -> dict[str, Fraction]:
    """Small rationals; sines and cosines on the circle by its rational parametrisation."""
    point = {}
    for s, c in lifted.circles.values():
        t = Fraction(generator.randint(-9, 9), generator.randint(2, 9))
        point[s], point[c] = 2 * t / (1 + t * t), (1 - t * t) / (1 + t * t)
    for name in sorted(free_symbols(lifted.expressions)):
        point.setdefault(name, Fraction(generator.randint(-19, 19), generator.randint(1, 9)))
    return point


def _commutes(model: ControlAffineModel, field: Field, j: int) -> bool:
    """Whether [b_j, e] = 0 is proven as an identity."""
    column = model.columns[j]
    slopes = jacobian(field, model.states)
    return all(
        is_zero(dot(slopes[i], column) - dot(model.b_x[j][i], field)) is True for i in range(len(field))
    )


def _extended(found: list[Field], field: Field, generator: Random) -> list[Field]:
    """The fields with one more, if it is independent of them at a random point."""
    n = len(field)
    lifted = lift([e for f in (*found, field) for e in f], opaque=True)
    for _ in range(10):
        try:
            values = at_point(lifted.expressions, _random_point(lifted, generator))
        except ZeroDivisionError:
            continue
        rows = [values[i : i + n] for i in range(0, len(values), n)]
        return [*found, field] if n - len(null_space(rows)) == len(rows) else found
    return found


def _ordered(fields: list[Field], n: int) -> list[Field]:
    """Fields in the order of the states that they belong to, as far as that can be seen."""
    rest = list(fields)
    eye = identity(n)
    result: list[Field | None] = [None] * n
    for i in range(n):
        if eye[i] in rest:
            result[i] = eye[i]
            rest.remove(eye[i])
    for i in range(n):
        if result[i] is None:
            chosen = next((f for f in rest if f[i].is_constant and f[i] is not ZERO), rest[0])
            rest.remove(chosen)
            lead = chosen[i]
            result[i] = tuple(e / lead for e in chosen) if lead.is_constant else chosen
    return [f for f in result if f is not None]


_POINTS = 400


def pivot_frame(model: ControlAffineModel, safe_set: Sequence[tuple[Fraction, Fraction]]) -> Matrix | None:
    """E (n, n) for the pivot rows that keep it smallest on random points of the safe set; None if there are none.

    Small in half-widths of the set: in the states' own units that would depend on them.
    """
    ends = np.array([[float(lo), float(hi)] for lo, hi in safe_set])
    points = np.random.default_rng(17).uniform(ends[:, 0], ends[:, 1], (_POINTS, len(ends)))
    half = (ends[:, 1] - ends[:, 0]) / 2
    units = (half / half[:, None]).reshape(-1, 1)
    best: tuple[float, Matrix] | None = None
    for frame in pivot_frames(model):
        tape = Tape([e for row in frame for e in row], model.states)
        size = float(np.abs(tape.run_floats(list(points.T), (len(points),)) * units).max())
        if np.isfinite(size) and (best is None or size < best[0]):
            best = size, frame
    return best[1] if best else None


def pivot_frames(model: ControlAffineModel) -> Iterator[Matrix]:
    """The frames of all choices of pivot rows."""
    moved = {name for name, row in zip(model.states, model.B, strict=True) if any(e is not ZERO for e in row)}
    needed = free_symbols(e for row in model.B for e in row)
    if moved & needed:
        return
    B = reduced(model.B)
    for rows in model.pivots[0]:
        B_R = [B[i] for i in rows]
        ((size,),) = reduced([[determinant(B_R)]])
        if size is ZERO:
            continue
        inverse = reduced(divide(adjugate(B_R), size))
        gain = reduced(multiply(B, inverse))
        x_R = column([symbol(model.states[i]) for i in rows])
        fields = [list(row) for row in identity(len(model.states))]  # columns of E as rows
        for j, name in enumerate(model.states):
            if name in needed:
                slope = combine(1, differentiate(gain, name), -1, multiply(B, differentiate(inverse, name)))
                fields[j] = [a + b for a, (b,) in zip(fields[j], multiply(slope, x_R), strict=True)]
        yield transpose(reduced(fields))

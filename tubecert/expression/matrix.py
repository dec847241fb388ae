"""Matrices of expressions: the few exact operations that the model needs."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.expression.graph import ONE, ZERO, Expression, constant, derivatives

Matrix = tuple[tuple[Expression, ...], ...]
Rows = Sequence[Sequence[Expression]]


def matrix(rows: Rows) -> Matrix:
    """The rows as an immutable matrix."""
    return tuple(tuple(row) for row in rows)


def identity(n: int) -> Matrix:
    """The n x n identity."""
    return matrix([[ONE if i == j else ZERO for j in range(n)] for i in range(n)])


def transpose(a: Rows) -> Matrix:
    """A'."""
    return matrix(list(zip(*a, strict=True)))


def multiply(a: Rows, b: Rows) -> Matrix:
    """A b."""
    columns = transpose(b)
    return matrix([[dot(row, column) for column in columns] for row in a])


def dot(a: Sequence[Expression], b: Sequence[Expression]) -> Expression:
    """sum_i a_i b_i."""
    return sum((x * y for x, y in zip(a, b, strict=True)), start=ZERO)


def combine(p: Expression | int | Fraction, a: Rows, q: Expression | int | Fraction, b: Rows) -> Matrix:
    """P a + q b."""
    return matrix([[p * x + q * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)])


def column(entries: Sequence[Expression]) -> Matrix:
    """The entries as an n x 1 matrix."""
    return tuple((e,) for e in entries)


def jacobian(entries: Sequence[Expression], names: Sequence[str]) -> Matrix:
    """d(entries_i)/d(names_j)."""
    return transpose([derivatives(entries, name) for name in names])


def differentiate(a: Rows, name: str) -> Matrix:
    """da/d(name), entry by entry."""
    width = len(a[0])
    flat = derivatives([e for row in a for e in row], name)
    return matrix([flat[i : i + width] for i in range(0, len(flat), width)])


def along(a: Rows, field: Sequence[Expression], names: Sequence[str]) -> Matrix:
    """The derivative of `a` along a vector field: sum_i field_i da/dx_i."""
    total = matrix([[ZERO] * len(a[0])] * len(a))
    for speed, name in zip(field, names, strict=True):
        if speed is not ZERO:
            total = combine(1, total, speed, differentiate(a, name))
    return total


def determinant(a: Rows) -> Expression:
    """The determinant by expansion along the first row (meant for as many rows as a system has inputs)."""
    if not a:
        return ONE
    if len(a) > 2 and all(e.is_constant for row in a for e in row):
        return constant(_rational_determinant([[e.fraction for e in row] for row in a]))
    total = ZERO
    for j, entry in enumerate(a[0]):
        if entry is not ZERO:
            minor = [[*row[:j], *row[j + 1 :]] for row in a[1:]]
            total = total + (-1) ** j * entry * determinant(minor)
    return total


def _rational_determinant(rows: list[list[Fraction]]) -> Fraction:
    """The determinant by elimination."""
    total = Fraction(1)
    for j in range(len(rows)):
        chosen = next((i for i in range(j, len(rows)) if rows[i][j] != 0), None)
        if chosen is None:
            return Fraction(0)
        if chosen != j:
            rows[j], rows[chosen] = rows[chosen], rows[j]
            total = -total
        total *= rows[j][j]
        for row in rows[j + 1 :]:
            factor = row[j] / rows[j][j]
            row[j:] = [x - factor * y for x, y in zip(row[j:], rows[j][j:], strict=True)]
    return total


def adjugate(a: Rows) -> Matrix:
    """The matrix with a adj(a) = det(a) I."""
    n = len(a)
    return matrix(
        [
            [
                (-1) ** (i + j)
                * determinant([[*row[:i], *row[i + 1 :]] for k, row in enumerate(a) if k != j])
                for j in range(n)
            ]
            for i in range(n)
        ]
    )


def null_space(a: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """A basis of {v : a v = 0} over the rationals, as rows."""
    rows = [list(row) for row in a]
    width = len(rows[0])
    pivots: list[int] = []
    for j in range(width):
        place = len(pivots)
        chosen = next((i for i in range(place, len(rows)) if rows[i][j] != 0), None)
        if chosen is None:
            continue
        rows[place], rows[chosen] = rows[chosen], rows[place]
        rows[place] = [x / rows[place][j] for x in rows[place]]
        for i in range(len(rows)):
            if i != place and rows[i][j] != 0:
                factor = rows[i][j]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[place], strict=True)]
        pivots.append(j)
    basis = []
    for j in (j for j in range(width) if j not in pivots):
        vector = [Fraction(int(i == j)) for i in range(width)]
        for i, p in enumerate(pivots):
            vector[p] = -rows[i][j]
        basis.append(vector)
    return basis


def constants(rows: Sequence[Sequence[Fraction]]) -> Matrix:
    """A rational matrix as expressions."""
    return matrix([[constant(x) for x in row] for row in rows])

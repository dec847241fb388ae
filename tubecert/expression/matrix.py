"""Matrices of expressions and of rationals: the few exact operations that a specification and its model need."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations
from operator import mul
from typing import TYPE_CHECKING

from tubecert.expression.calculus import derivatives, free_symbols, substitute
from tubecert.expression.graph import ONE, ZERO, Expression, constant
from tubecert.expression.zero import is_zero

if TYPE_CHECKING:
    from flint import fmpq_mat

Matrix = tuple[tuple[Expression, ...], ...]
Rows = Sequence[Sequence[Expression]]
Rationals = Sequence[Sequence[Fraction]]
_POINTS = 3  # where ranks are tried
_LARGEST_SYMBOLIC = 4  # columns up to which det(B^T B) is expanded


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
    """The product a b."""
    columns = transpose(b)
    return matrix([[dot(row, column) for column in columns] for row in a])


def dot(a: Sequence[Expression], b: Sequence[Expression]) -> Expression:
    """sum_i a_i b_i."""
    pairs = zip(a, b, strict=True)
    return sum((x * y for x, y in pairs if x is not ZERO and y is not ZERO), start=ZERO)


def combine(p: Expression | int | Fraction, a: Rows, q: Expression | int | Fraction, b: Rows) -> Matrix:
    """The sum p a + q b."""
    return matrix([[p * x + q * y for x, y in zip(r, s, strict=True)] for r, s in zip(a, b, strict=True)])


def column(entries: Sequence[Expression]) -> Matrix:
    """The entries as an n x 1 matrix."""
    return tuple((e,) for e in entries)


def jacobian(entries: Sequence[Expression], names: Sequence[str]) -> Matrix:
    """d(entries_i)/d(names_j)."""
    return transpose([derivatives(entries, name) for name in names])


def differentiate(a: Rows, name: str) -> Matrix:
    """The derivative da/d(name), entry by entry."""
    width = len(a[0])
    flat = derivatives([e for row in a for e in row], name)
    return matrix([flat[i : i + width] for i in range(0, len(flat), width)])


def along(a: Rows, field: Sequence[Expression], names: Sequence[str]) -> Matrix:
    """The derivative of `a` along a vector field: sum_i field_i da/dx_i."""
    total = matrix([[ZERO] * len(a[0])] * len(a))
    for speed, name in zip(field, names, strict=True):
        slope = differentiate(a, name) if speed is not ZERO else ()
        if any(e is not ZERO for row in slope for e in row):
            total = combine(1, total, speed, slope)
    return total


class TooLargeError(ValueError):
    """A determinant has more terms than asked for."""


def determinant(a: Rows, most: int | None = None) -> Expression:
    """The determinant by expansion along the first row (meant for as many rows as a system has inputs).

    A dense one of n rows takes n 2**(n - 1) products; beyond `most` of them `TooLargeError` is raised.
    """
    return _Expansion(a, most).minor(0, tuple(range(len(a))))


class _Expansion:
    """Determinants of the last rows of a matrix in some of its columns, each computed once."""

    def __init__(self, a: Rows, most: int | None) -> None:
        self._rows, self._most = a, most
        self._known: dict[tuple[int, ...], Expression] = {}
        self._products = 0

    def minor(self, first: int, columns: tuple[int, ...]) -> Expression:
        """The determinant of the rows from `first` on."""
        if not columns:
            return ONE
        if columns not in self._known:
            self._known[columns] = self._expanded(first, columns)
        return self._known[columns]

    def _expanded(self, first: int, columns: tuple[int, ...]) -> Expression:
        rows = [[row[j] for j in columns] for row in self._rows[first:]]
        if len(columns) > 2 and all(e.is_constant for row in rows for e in row):
            return constant(_rational([[e.fraction for e in row] for row in rows]))
        total = ZERO
        for k, entry in enumerate(rows[0]):
            if entry is not ZERO:
                self._products += 1
                if self._most is not None and self._products > self._most:
                    raise TooLargeError(f"a determinant has more than {self._most} products")
                total = total + (-1) ** k * entry * self.minor(first + 1, (*columns[:k], *columns[k + 1 :]))
        return total


def _rational(rows: Rationals) -> Fraction:
    found = _flint(rows).det()
    return Fraction(int(found.p), int(found.q))


def _flint(rows: Rationals) -> fmpq_mat:
    from flint import fmpq, fmpq_mat

    return fmpq_mat([[fmpq(q.numerator, q.denominator) for q in row] for row in rows])


def adjugate(a: Rows) -> Matrix:
    """The matrix with a adj(a) = det(a) I."""

    def cofactor(i: int, j: int) -> Expression:
        minor = determinant([[*row[:i], *row[i + 1 :]] for k, row in enumerate(a) if k != j])
        return -minor if (i + j) % 2 else minor

    return matrix([[cofactor(i, j) for j in range(len(a))] for i in range(len(a))])


def null_space(a: Rationals) -> list[list[Fraction]]:
    """A basis of {v : a v = 0} over the rationals, as rows."""
    reduced, rank = _flint(a).rref()
    rows = [[Fraction(int(q.p), int(q.q)) for q in row] for row in reduced.tolist()[:rank]]
    pivots, width = [next(j for j, q in enumerate(row) if q) for row in rows], len(a[0])
    basis = []
    for j in (j for j in range(width) if j not in pivots):
        vector = [Fraction(int(i == j)) for i in range(width)]
        for row, pivot in zip(rows, pivots, strict=True):
            vector[pivot] = -row[j]
        basis.append(vector)
    return basis


def constants(rows: Rationals) -> Matrix:
    """A rational matrix as expressions."""
    return matrix([[constant(x) for x in row] for row in rows])


def is_positive_definite(a: Rationals) -> bool:
    """Whether a symmetric matrix is positive definite."""
    return is_positive_semidefinite(a, definite=True)


def is_positive_semidefinite(a: Rationals, *, definite: bool = False) -> bool:
    """Whether a symmetric matrix is: no pivot is negative, and a zero one, if not `definite`, has a zero row."""
    rows = [list(row) for row in a]
    for k, row in enumerate(rows):
        if row[k] < 0 or (row[k] == 0 and (definite or any(row[k:]))):
            return False
        for below in rows[k + 1 :] if row[k] else []:
            ratio = below[k] / row[k]
            below[k:] = [b - ratio * r for b, r in zip(below[k:], row[k:], strict=True)]
    return True


def dependent_columns(a: Rows) -> bool:
    """Whether the columns are *proven* to be dependent at every point."""
    entries, columns = [entry for row in a for entry in row], len(a[0])
    names = sorted(free_symbols(entries))
    generator = random.Random(0)  # noqa: S311 - any points will do, the same in every run
    seen = False
    for _ in range(_POINTS):
        point = {name: constant(Fraction(generator.randint(-9_999, 9_999), 1_000)) for name in names}
        try:
            values = [entry.fraction for entry in substitute(entries, point) if entry.is_constant]
        except ZeroDivisionError:
            continue
        if len(values) == len(entries):
            each = [values[k::columns] for k in range(columns)]
            if is_positive_definite([[sum(map(mul, u, v), start=Fraction(0)) for v in each] for u in each]):
                return False
            seen = True
    if seen and not names:
        return True
    return columns <= _LARGEST_SYMBOLIC and is_zero(determinant(multiply(transpose(a), a))) is True


def asymmetric_entry(a: Rows, budget: int) -> tuple[int, int, bool] | None:
    """The first (i, j), i < j, whose entries are not proven equal; and whether they provably differ."""
    for i, j in combinations(range(len(a)), 2):
        if a[i][j] is not a[j][i]:
            zero = is_zero(a[i][j] - a[j][i], budget)
            if zero is not True:
                return i, j, zero is False
    return None

"""Exact checks on matrices: definiteness, symmetry, and whether columns are dependent everywhere."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from itertools import combinations

from tubecert.expression import Expression, constant, free_symbols, is_zero, substitute
from tubecert.expression.matrix import determinant, multiply, null_space, transpose
from tubecert.spec.values import Matrix

_POINTS = 3
_LARGEST_SYMBOLIC = 4  # columns up to which det(B^T B) is expanded


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a symmetric matrix is positive definite."""
    return is_positive_semidefinite(matrix) and not null_space(matrix)


def is_positive_semidefinite(matrix: Matrix) -> bool:
    """Whether a symmetric matrix is positive semidefinite: no pivot is negative, and a zero one has a zero row."""
    rows = [list(row) for row in matrix]
    for k, row in enumerate(rows):
        if row[k] < 0 or (row[k] == 0 and any(row[k:])):
            return False
        for below in rows[k + 1 :] if row[k] else []:
            ratio = below[k] / row[k]
            below[k:] = [b - ratio * r for b, r in zip(below[k:], row[k:], strict=True)]
    return True


def dependent_columns(matrix: Sequence[Sequence[Expression]]) -> bool:
    """Whether the columns are *proven* to be dependent at every point."""
    entries = [entry for row in matrix for entry in row]
    columns = len(matrix[0])
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
            if not null_space([values[i : i + columns] for i in range(0, len(values), columns)]):
                return False
            seen = True
    if seen and not names:
        return True
    few = columns <= _LARGEST_SYMBOLIC
    return few and is_zero(determinant(multiply(transpose(matrix), matrix))) is True


def asymmetric_entry(matrix: Sequence[Sequence[Expression]], budget: int) -> tuple[int, int, bool] | None:
    """The first (i, j), i < j, whose entries are not proven equal; and whether they provably differ."""
    for i, j in combinations(range(len(matrix)), 2):
        if matrix[i][j] is not matrix[j][i]:
            zero = is_zero(matrix[i][j] - matrix[j][i], budget)
            if zero is not True:
                return i, j, zero is False
    return None

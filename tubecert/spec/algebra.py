"""Exact checks on matrices: definiteness, symmetry, and whether columns are dependent everywhere."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from functools import cache
from itertools import combinations

from tubecert.expression import ZERO, Expression, free_symbols, is_zero, topological
from tubecert.spec.values import Matrix

_POINTS = 3
_LARGEST_SYMBOLIC = 4  # columns up to which det(B^T B) is expanded


def is_positive_definite(matrix: Matrix) -> bool:
    """Whether a symmetric matrix is positive definite."""
    return is_positive_semidefinite(matrix) and rank(matrix) == len(matrix)


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


def rank(matrix: Sequence[Sequence[Fraction]]) -> int:
    """Rank over the rationals."""
    rows, found = [list(row) for row in matrix], 0
    for column in range(len(rows[0]) if rows else 0):
        pivot = next((i for i in range(found, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[found], rows[pivot] = rows[pivot], rows[found]
        for i in range(found + 1, len(rows)):
            ratio = rows[i][column] / rows[found][column]
            rows[i] = [a - ratio * b for a, b in zip(rows[i], rows[found], strict=True)]
        found += 1
    return found


def dependent_columns(matrix: Sequence[Sequence[Expression]]) -> bool:
    """Whether the columns are *proven* to be dependent at every point."""
    entries = [entry for row in matrix for entry in row]
    columns = len(matrix[0])
    names = sorted(free_symbols(entries))
    generator = random.Random(0)  # noqa: S311 - any points will do, the same in every run
    seen = 0
    for _ in range(_POINTS):
        point = {name: Fraction(generator.randint(-9_999, 9_999), 1_000) for name in names}
        values = evaluate(entries, point)
        if values is None:
            continue
        rows = [values[i : i + columns] for i in range(0, len(values), columns)]
        if rank(rows) == columns:
            return False
        seen += 1
    if seen and not names:
        return True
    return columns <= _LARGEST_SYMBOLIC and is_zero(_gram_determinant(matrix)) is True


def evaluate(entries: Sequence[Expression], point: dict[str, Fraction]) -> list[Fraction] | None:
    """Values of rational functions at a point; None if an entry is none, or undefined there."""
    value: dict[Expression, Fraction] = {}
    for node in topological(entries):
        args = [value[arg] for arg in node.args]
        try:
            match node.op:
                case "const":
                    value[node] = node.fraction
                case "symbol":
                    value[node] = point[str(node.value)]
                case "add":
                    value[node] = args[0] + args[1]
                case "mul":
                    value[node] = args[0] * args[1]
                case "div":
                    value[node] = args[0] / args[1]
                case "pow":
                    value[node] = args[0] ** int(str(node.value))
                case _:
                    return None
        except ZeroDivisionError:
            return None
    return [value[entry] for entry in entries]


def _gram_determinant(matrix: Sequence[Sequence[Expression]]) -> Expression:
    columns = len(matrix[0])
    gram = [
        [sum((row[i] * row[j] for row in matrix), start=ZERO) for j in range(columns)] for i in range(columns)
    ]

    @cache
    def minor(chosen: tuple[int, ...]) -> Expression:
        """Determinant of the first rows in the chosen columns, by the last of these rows."""
        if not chosen:
            return ZERO + 1
        row = gram[len(chosen) - 1]
        total = ZERO
        for k, column in enumerate(chosen):
            sign = (-1) ** (len(chosen) - 1 - k)
            total = total + sign * row[column] * minor(chosen[:k] + chosen[k + 1 :])
        return total

    return minor(tuple(range(columns)))


def asymmetric_entry(matrix: Sequence[Sequence[Expression]], budget: int) -> tuple[int, int, bool] | None:
    """The first (i, j), i < j, whose entries are not proven equal; and whether they provably differ."""
    for i, j in combinations(range(len(matrix)), 2):
        if matrix[i][j] is not matrix[j][i]:
            zero = is_zero(matrix[i][j] - matrix[j][i], budget)
            if zero is not True:
                return i, j, zero is False
    return None

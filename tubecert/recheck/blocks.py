"""A matrix whose rows and columns fall into parts that no entry joins: its spectral norm is the largest of the parts'.

Each part is a statement of its own, in its own few variables: of many pendula that hang on springs, one per pendulum.
"""

from __future__ import annotations

from collections.abc import Sequence

from tubecert.recheck.terms import NOUGHT, Matrix, Rows


def blocks(matrix: Rows) -> list[Matrix]:
    """The parts that are not 0, each with its rows and columns."""
    parts: list[tuple[set[int], set[int]]] = []
    for i, row in enumerate(matrix):
        columns = {j for j, e in enumerate(row) if e is not NOUGHT}
        if not columns:
            continue
        met = [part for part in parts if part[1] & columns]
        parts = [part for part in parts if part not in met]
        parts.append(({i}.union(*(rows for rows, _ in met)), columns.union(*(own for _, own in met))))
    return [_part(matrix, sorted(rows), sorted(columns)) for rows, columns in parts]


def _part(matrix: Rows, rows: Sequence[int], columns: Sequence[int]) -> Matrix:
    return [[matrix[i][j] for j in columns] for i in rows]

"""Statements that hold on all of a box or not: norms below a limit, definiteness, a sign.

Each examines the vertices of an expansion of second order (`boxes`), and adds what the rest can be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from fractions import Fraction
from functools import reduce
from typing import Self

from flint import arb, arb_mat

from tubecert.recheck.balls import Ball, Balls, exact, is_indefinite, is_positive, spectral_norm, whitening
from tubecert.recheck.boxes import Box, Expansion, Field, Found, Values
from tubecert.recheck.program import Program
from tubecert.recheck.quotients import cancelled
from tubecert.recheck.terms import Rows, Term


class _OnField:
    """A statement about the terms of a field, with numbers for names that are no variables."""

    _field: Field

    def with_values(self, values: Values) -> Self:
        """The same with other numbers for the same names."""
        other = copy(self)
        other._field = self._field.with_values(values)
        return other


class NormsBelow(_OnField):
    """sum_k |G_k(x)| <= limit, spectral norms (of a column: the Euclidean norm)."""

    def __init__(self, matrices: Sequence[Rows], limit: Fraction, values: Values | None = None) -> None:
        self._shapes = [(len(g), len(g[0])) for g in matrices]
        self._field = Field([e for g in matrices for row in g for e in row], values)
        self.variables = self._field.variables
        self._limit = exact(limit)

    def over(self, box: Box) -> Found:
        """The norms of the affine part at its corners, and of the rest."""
        found, caused, spread = self._field.expand(box)
        return Found(all(map(self._holds, found)), caused, spread)

    def _holds(self, e: Expansion) -> bool:
        """At every vertex; the rest leaves less room there."""
        limit = self._limit - self._norms(e.rest)
        return all(self._is_below(entries, limit) for entries in e.vertices())

    def _is_below(self, entries: list[Ball], limit: Ball) -> bool:
        """One matrix: limit^2 I - G'G > 0; where that fails by little, or there are several, norm by norm."""
        if len(self._shapes) == 1 and limit > 0:
            rows, columns = self._shapes[0]
            if 1 in (rows, columns):  # of a row or a column, one number
                return bool(sum((x * x for x in entries), start=arb(0)) < limit * limit) or bool(
                    self._norms(entries) <= limit
                )
            G = arb_mat(rows, columns, entries)
            gram = G.transpose() * G if columns <= rows else G * G.transpose()
            if is_positive(arb_mat(gram.nrows(), gram.nrows(), limit * limit) - gram):
                return True
        return bool(self._norms(entries) <= limit)

    def bound(self, box: Box) -> Ball:
        """An upper bound on a box."""
        found, _, _ = self._field.expand(box)
        tops = [self._norms(at) + self._norms(e.rest) for e in found for at in e.vertices()]
        return reduce(arb.max, tops).upper() if _finite(tops) else arb("nan")

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether the columns of the matrices alone are too long at a point."""
        total = arb(0)
        for matrix in self._split(self._field.at(point)):
            v = _long_direction(matrix)
            image = [sum((x * y for x, y in zip(row, v, strict=True)), start=arb(0)) for row in matrix]
            size = arb(sum(x * x for x in v)) * (1 + 1e-12)
            if not size > 0:
                continue
            total = total + (sum((x * x for x in image), start=arb(0)) / size).nonnegative_part().sqrt()
        return bool(total > self._limit)

    def _split(self, entries: Sequence[Ball]) -> list[Balls]:
        matrices, start = [], 0
        for p, q in self._shapes:
            matrices.append([list(entries[start + i * q : start + (i + 1) * q]) for i in range(p)])
            start += p * q
        return matrices

    def _norms(self, entries: Sequence[Ball]) -> Ball:
        return sum((spectral_norm(matrix) for matrix in self._split(entries)), start=arb(0))


def _finite(values: Sequence[Ball]) -> bool:
    return all(value.is_finite() for value in values)


def _long_direction(a: Balls) -> list[float]:
    """A vector that a matrix makes long, a proposal in floats."""
    m = [[float(x.mid()) for x in row] for row in a]
    v = [1.0 / (1 + j) for j in range(len(m[0]))]
    for _ in range(30):
        image = [sum(x * y for x, y in zip(row, v, strict=True)) for row in m]
        back = [sum(m[i][j] * image[i] for i in range(len(m))) for j in range(len(v))]
        size = max((abs(x) for x in back), default=0.0)
        if not 0 < size < float("inf"):
            break
        v = [x / size for x in back]
    return v


class PositiveDefinite(_OnField):
    """S(x) > 0, with a congruence that makes `unit` (by default S) near the identity at the centre of each box."""

    def __init__(self, S: Rows, unit: Rows | None = None, values: Values | None = None) -> None:
        self._n = n = len(S)
        self._field = Field(cancelled([S[i][j] for i in range(n) for j in range(i + 1)]), values)
        self.variables = self._field.variables
        self._unit = (
            None
            if unit is None
            else Program([unit[i][j] for i in range(n) for j in range(i + 1)], self._inputs)
        )

    @property
    def _inputs(self) -> tuple[str, ...]:
        return (*self.variables, *self._field.values)

    def over(self, box: Box) -> Found:
        """At every vertex of the expansion, minus what the rest can be."""
        unit = self._unit_at(box)
        found, caused, spread = self._field.expand(
            box, lambda at: weights(self._n, at if unit is None else unit)
        )
        own = found[0].value.entries() if unit is None else unit
        T = arb_mat(whitening([[float(x.mid()) for x in row] for row in square(self._n, own).tolist()]))
        return Found(True) if all(definite_on(e, T) for e in found) else Found(False, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether S is proven to have a negative eigenvalue at a point."""
        S = square(self._n, self._field.at(point)).tolist()
        t = arb_mat(whitening([[float(x.mid()) for x in row] for row in S]))
        moved: Balls = (t * arb_mat(S) * t.transpose()).tolist()
        return is_indefinite(moved) or is_indefinite(S)

    def _unit_at(self, box: Box) -> list[Ball] | None:
        """The unit at the centre of a box."""
        if self._unit is None:
            return None
        centre = [arb(0.5 * lo + 0.5 * hi) for lo, hi in box]
        return self._unit.run([*centre, *self._field.values.values()])


def square(n: int, entries: Sequence[Ball]) -> arb_mat:
    """A symmetric matrix from the rows of its lower triangle, (n, n)."""
    places = (max(i, j) * (max(i, j) + 1) // 2 + min(i, j) for i in range(n) for j in range(n))
    return arb_mat(n, n, [entries[k] for k in places])


def weights(n: int, unit: Sequence[Ball]) -> list[float]:
    """What each entry of a symmetric matrix counts beside a matrix of its units, 1/sqrt(u_ii u_jj): a proposal."""
    sizes = [abs(float(unit[i * (i + 1) // 2 + i].mid())) for i in range(n)]
    roots = [size**-0.5 if 0 < size < math.inf else 1.0 for size in sizes]
    return [roots[i] * roots[j] for i in range(n) for j in range(i + 1)]


def definite_on(e: Expansion, T: arb_mat) -> bool:
    """S > 0 for S(x) that is given by its lower triangle: T S T' at every vertex, minus the row sums of the rest."""
    n = T.nrows()
    size = arb_mat([[abs(x) for x in row] for row in T.tolist()])
    rest = (size * square(n, e.rest) * size.transpose()).tolist()
    drop = arb_mat(
        [[sum(row, start=arb(0)) if i == j else 0 for j in range(n)] for i, row in enumerate(rest)]
    )
    moved = e.mapped(lambda S: T * square(n, S.entries()) * T.transpose())
    return all(is_positive(S - drop) for S in moved.corners())


class NotNegative(_OnField):
    """e(x) >= 0 for one term."""

    def __init__(self, e: Term, values: Values | None = None, *, strict: bool = False) -> None:
        self._field = Field([e], values)
        self.variables = self._field.variables
        self._strict = strict

    def over(self, box: Box) -> Found:
        """The least corner, minus what the rest can be."""
        found, caused, spread = self._field.expand(box)
        least = [at[0] - e.rest[0] for e in found for at in e.vertices()]
        proven = all(x > 0 if self._strict else x >= 0 for x in least)
        return Found(proven, caused, spread)

    def broken(self, point: Sequence[Ball]) -> bool:
        """Whether it is negative (strict: or zero) at a point."""
        value = self._field.at(point)[0]
        return bool(value <= 0 if self._strict else value < 0)

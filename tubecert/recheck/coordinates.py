"""Coordinates z = S x of a tube, S constant, rational and invertible, and what a system is in them.

All terms stay terms of x: only components are mixed, and derivatives: d/dz_i = sum_j (S^-1)_ji d/dx_j.
Implements: theory (1.5). Nothing is believed of S but that it is invertible, which is shown by inverting it exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from tubecert.recheck.metric import adjugate, determinant
from tubecert.recheck.specified.numbers import Rows
from tubecert.recheck.system import System
from tubecert.recheck.terms import Matrix, all_zero, matrix_slopes, number, plus, scaled, times, turned
from tubecert.recheck.terms import Rows as Terms


def inverted(rows: Rows) -> Rows:
    """The inverse of a rational matrix, exactly; raises `ValueError` if there is none."""
    n = len(rows)
    work = [[*row, *(Fraction(i == j) for j in range(n))] for i, row in enumerate(rows)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if work[i][k]), None)
        if pivot is None:
            raise ValueError("it is singular")
        work[k], work[pivot] = work[pivot], work[k]
        own = work[k] = [value / work[k][k] for value in work[k]]
        for i in range(n):
            if i != k and work[i][k]:
                work[i] = [a - work[i][k] * b for a, b in zip(work[i], own, strict=True)]
    return tuple(tuple(row[n:]) for row in work)


@dataclass(frozen=True)
class Coordinates:
    """S and its inverse, row by row; `ValueError` if S is singular."""

    S: Rows

    def __post_init__(self) -> None:
        _ = self.inverse

    @cached_property
    def inverse(self) -> Rows:
        """S^-1."""
        return inverted(self.S)

    @cached_property
    def spread(self) -> Rows:
        """(S'S)^-1: x_i is at most the root of its i-th entry where |S x| <= 1."""
        T = self.inverse
        return tuple(
            tuple(sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0)) for b in T) for a in T
        )


def _constant(rows: Rows) -> Matrix:
    return [[number(q) for q in row] for row in rows]


@dataclass(frozen=True)
class Fields:
    """A system in z = S x; as it is where `coordinates` is None."""

    system: System
    coordinates: Coordinates | None

    def vector(self, a: Terms) -> Matrix:
        """S a, for a vector or several in columns."""
        return list(map(list, a)) if self.coordinates is None else times(_constant(self.coordinates.S), a)

    def covector(self, a: Terms) -> Matrix:
        """A S^-1, for what maps vectors."""
        return (
            list(map(list, a)) if self.coordinates is None else times(a, _constant(self.coordinates.inverse))
        )

    def slopes(self, a: Terms) -> list[Matrix]:
        """dA/dz_i, for every i."""
        by_state = [matrix_slopes(a, name) for name in self.system.states]
        if self.coordinates is None:
            return by_state
        found = []
        for weights in zip(*self.coordinates.inverse, strict=True):
            total = scaled(0, a)
            for weight, slope in zip(weights, by_state, strict=True):
                if weight and not all_zero(slope):
                    total = plus(total, slope, weight)
            found.append(total)
        return found

    def jacobian(self, column: Terms) -> Matrix:
        """d(column)/dz of entries that are no components of z, (k, n)."""
        by_state = [[row[0] for row in matrix_slopes(column, name)] for name in self.system.states]
        return self.covector(turned(by_state))

    @property
    def f(self) -> Matrix:
        """S f, (n, 1)."""
        return self.vector(self.system.f)

    @property
    def f_x(self) -> Matrix:
        """S f_x S^-1, (n, n)."""
        return self.vector(self.covector(self.system.f_x))

    @cached_property
    def B(self) -> Matrix:
        """S B, (n, m)."""
        return self.vector(self.system.B)

    @cached_property
    def B_pinv(self) -> Matrix:
        """(S B)^+ = (B'B)^-1 B' of the B here, (m, n)."""
        gram = times(turned(self.B), self.B)
        d = determinant(gram)
        inverse = [[e / d for e in row] for row in adjugate(gram)]
        return times(inverse, turned(self.B))

    @property
    def b_x(self) -> list[Matrix]:
        """S (b_j)_x S^-1 for every column of B."""
        columns = ([[row[j]] for row in self.system.B] for j in range(len(self.system.inputs)))
        return [self.vector(self.jacobian(column)) for column in columns]

    @cached_property
    def W(self) -> Matrix:
        """S W S', (n, n)."""
        if self.coordinates is None:
            return self.system.W
        return times(self.vector(self.system.W), turned(_constant(self.coordinates.S)))

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW_z/dz_i."""
        return self.system.W_x if self.coordinates is None else self.slopes(self.W)

    @property
    def drift(self) -> Matrix:
        """S (f + B u), (n, 1)."""
        return self.vector(self.system.drift)

    @property
    def unit(self) -> Matrix:
        """(S'S)^-1: what W is compared with, M >= a S'S as (S'S)^-1/a - W >= 0."""
        n = range(len(self.system.states))
        rows = tuple(tuple(Fraction(i == j) for j in n) for i in n)
        return _constant(rows if self.coordinates is None else self.coordinates.spread)


def product(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    """The scalar product."""
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))

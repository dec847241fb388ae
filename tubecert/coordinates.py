"""Coordinates z = S x of the tube, S constant, rational and invertible, and the fields of a model in them.

In: S. Out: S^-1, and f_z = S f, B_z = S B, W_z = S W S' with their derivatives by z, all as expressions of x: only
components and derivatives are transformed, so that every expression depends on the states it depended on before.
Trusted: yes; nothing is believed of S but that it is invertible. Implements: theory 1a.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from tubecert.enclosure.interval import Array, fraction_bounds
from tubecert.expression import ZERO, Expression
from tubecert.expression.matrix import (
    Matrix,
    adjugate,
    column,
    combine,
    constants,
    determinant,
    differentiate,
    multiply,
    transpose,
)
from tubecert.model import ControlAffineModel, divide

Rows = tuple[tuple[Fraction, ...], ...]


@dataclass(frozen=True)
class Coordinates:
    """S, (n, n), as rows; raises `ValueError` if it is singular or not square."""

    rows: Rows

    def __post_init__(self) -> None:
        if any(len(row) != len(self.rows) for row in self.rows) or not self.rows:
            raise ValueError("S is not square")
        if not self.inverse:
            raise ValueError("S is singular")

    @cached_property
    def inverse(self) -> Rows:
        """S^-1, exactly; empty if there is none."""
        return inverse(self.rows)

    @cached_property
    def gram(self) -> Rows:
        """S'S: |z|^2 = x'S'S x."""
        return product(turned(self.rows), self.rows)

    @cached_property
    def spread(self) -> Rows:
        """S^-1 S^-T, the inverse of S'S: x_i reaches sqrt(spread_ii) where |z| <= 1."""
        return product(self.inverse, turned(self.inverse))

    @cached_property
    def S(self) -> Matrix:
        """S as expressions."""
        return constants(self.rows)

    @cached_property
    def S_inverse(self) -> Matrix:
        """S^-1 as expressions."""
        return constants(self.inverse)


def inverse(rows: Sequence[Sequence[Fraction]]) -> Rows:
    """The inverse of a rational matrix by elimination; empty if it is singular."""
    n = len(rows)
    work = [[*row, *(Fraction(int(i == j)) for j in range(n))] for i, row in enumerate(rows)]
    for k in range(n):
        pivot = next((i for i in range(k, n) if work[i][k]), None)
        if pivot is None:
            return ()
        work[k], work[pivot] = work[pivot], work[k]
        work[k] = [value / work[k][k] for value in work[k]]
        for i in range(n):
            if i != k and work[i][k]:
                ratio = work[i][k]
                work[i] = [a - ratio * b for a, b in zip(work[i], work[k], strict=True)]
    return tuple(tuple(row[n:]) for row in work)


def turned(rows: Rows) -> Rows:
    """The transpose of a rational matrix."""
    return tuple(zip(*rows, strict=True))


def product(a: Rows, b: Rows) -> Rows:
    """The product of rational matrices, exactly."""
    columns = turned(b)
    return tuple(
        tuple(sum((x * y for x, y in zip(row, own, strict=True)), Fraction(0)) for own in columns)
        for row in a
    )


@dataclass(frozen=True)
class Fields:
    """The fields of a model as they are in z = S x; in x itself where `coordinates` is None.

    Derivatives are by the components of z: d/dz_i = sum_j (S^-1)_ji d/dx_j.
    """

    model: ControlAffineModel
    coordinates: Coordinates | None

    @property
    def states(self) -> tuple[str, ...]:
        """The variables of all expressions: the states x."""
        return self.model.states

    def of_vector(self, a: Matrix) -> Matrix:
        """S a: the components of vectors, given as columns."""
        return a if self.coordinates is None else multiply(self.coordinates.S, a)

    def by_state(self, a: Matrix) -> Matrix:
        """A S^-1: what maps vectors, by their components in z."""
        return a if self.coordinates is None else multiply(a, self.coordinates.S_inverse)

    def slopes(self, a: Matrix) -> list[Matrix]:
        """da/dz_i for every component of z."""
        by_x = [differentiate(a, name) for name in self.states]
        if self.coordinates is None:
            return by_x
        nothing = tuple((ZERO,) * len(a[0]) for _ in a)
        slopes = []
        for weights in zip(*self.coordinates.inverse, strict=True):
            total = nothing
            for weight, slope in zip(weights, by_x, strict=True):
                if weight and any(e is not ZERO for row in slope for e in row):
                    total = combine(1, total, weight, slope)
            slopes.append(total)
        return slopes

    def lengths(self, variables: tuple[str, ...]) -> Array:
        """|S_ki| rounded up, (k, n), for the states i among the variables: what they add to the components of z."""
        which = [self.states.index(name) for name in variables]
        if self.coordinates is None:
            return np.eye(len(self.states))[which]
        return np.array([[fraction_bounds(abs(row[i]))[1] for row in self.coordinates.rows] for i in which])

    @cached_property
    def f(self) -> Matrix:
        """S f, (n, 1)."""
        return self.of_vector(column(self.model.f))

    @cached_property
    def f_x(self) -> Matrix:
        """S f_x S^-1, (n, n)."""
        return self.of_vector(self.by_state(self.model.f_x))

    @cached_property
    def B(self) -> Matrix:
        """S B, (n, m)."""
        return self.of_vector(self.model.B)

    @cached_property
    def B_x(self) -> list[Matrix]:
        """dB_z/dz_i, each (n, m)."""
        return self.model.B_x if self.coordinates is None else self.slopes(self.B)

    @cached_property
    def b_x(self) -> list[Matrix]:
        """S db_j/dx S^-1 for every input, each (n, n)."""
        return [self.of_vector(self.by_state(b)) for b in self.model.b_x]

    @cached_property
    def B_pinv(self) -> Matrix:
        """(B_z'B_z)^-1 B_z', (m, n)."""
        if self.coordinates is None:
            return self.model.B_pinv
        columns = transpose(self.B)
        gram = multiply(columns, self.B)
        return divide(multiply(adjugate(gram), columns), determinant(gram))

    @cached_property
    def B_pinv_x(self) -> list[Matrix]:
        """dB_z^+/dz_i, each (m, n)."""
        return self.model.B_pinv_x if self.coordinates is None else self.slopes(self.B_pinv)

    @cached_property
    def W(self) -> Matrix:
        """S W S', (n, n)."""
        if self.coordinates is None:
            return self.model.W
        return multiply(self.of_vector(self.model.W), transpose(self.coordinates.S))

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW_z/dz_i, each (n, n)."""
        return self.model.W_x if self.coordinates is None else self.slopes(self.W)

    def drift_on_plan(self) -> Matrix:
        """S (f + B u*), (n, 1), the names of the inputs standing for u*."""
        return self.of_vector(self.model.drift_on_plan())

    def vector(self, entries: Sequence[Expression]) -> Matrix:
        """S v, (n, 1), of a vector v by its components in x."""
        return self.of_vector(column(entries))

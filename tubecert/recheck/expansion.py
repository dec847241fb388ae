"""Polynomials of second order over a box, and vertices whose hull contains their values.

A polynomial in d_i/r_i with d = x - c is affine in every pair (d_i, s_i), s_i = d_i^2, and the pair lies in the hull of
(-r, r^2), (-r/2, 0), (r/2, 0), (r, r^2) (edges: tangents of the parabola, and its chord). Norms and largest eigenvalues
are convex, so products of these vertices are all there is to examine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import TypeAlias

from flint import arb_mat

from tubecert.recheck.balls import Ball, between, magnitude

Vertices: TypeAlias = tuple[tuple[float, float], ...]  # pairs (d, s)

STRAIGHT: Vertices = ((-1.0, 0.0), (1.0, 0.0))
CURVED: Vertices = ((-1.0, 1.0), (-0.5, 0.0), (0.5, 0.0), (1.0, 1.0))


@dataclass(frozen=True, slots=True)
class Expansion:
    """Entries near the centre of a box as a polynomial in d_i/r_i; `rest` bounds what is left of each of them.

    `steps[i]` belongs to d_i/r_i, `squares[i]` to (d_i/r_i)^2, `mixed` to products of two different ones. Every
    coefficient is a matrix of one shape, by default a column; `rest` lists its entries row by row.
    """

    value: arb_mat
    steps: list[arb_mat]
    squares: dict[int, arb_mat]
    mixed: dict[tuple[int, int], arb_mat]
    rest: list[Ball]

    def mapped(self, linear: Callable[[arb_mat], arb_mat]) -> Expansion:
        """A linear map of the polynomial; the rest is left as it is."""
        return Expansion(
            linear(self.value),
            [linear(step) for step in self.steps],
            {i: linear(square) for i, square in self.squares.items()},
            {ij: linear(product) for ij, product in self.mixed.items()},
            self.rest,
        )

    def vertices(self) -> Iterator[list[Ball]]:
        """The entries of the polynomial, row by row, at points whose hull contains all its values."""
        parts = [self.value, *self.steps, *self.squares.values(), *self.mixed.values()]
        monomials = _at_vertices(len(self.steps), tuple(self.squares), tuple(self.mixed), CURVED)
        count = monomials.ncols()
        coefficients = [x for row in zip(*(part.entries() for part in parts), strict=True) for x in row]
        found = (arb_mat(len(coefficients) // len(parts), len(parts), coefficients) * monomials).entries()
        return (found[k::count] for k in range(count))

    def corners(self) -> Iterator[arb_mat]:
        """The same as matrices."""
        shape = self.value.nrows(), self.value.ncols()
        return (arb_mat(*shape, entries) for entries in self.vertices())

    def ranges(self) -> list[Ball]:
        """An enclosure of every entry."""
        value = self.value.entries()
        sizes = [e.entries() for e in (*self.steps, *self.mixed.values())]
        squares = [q.entries() for q in self.squares.values()]
        found = []
        for k, r in enumerate(self.rest):
            size = sum((magnitude(e[k]) for e in sizes), start=r)
            total = value[k] + between(-size, size)
            found.append(sum((between(0, q[k]) for q in squares), start=total))
        return found


@cache
def _at_vertices(
    count: int, squared: tuple[int, ...], mixed: tuple[tuple[int, int], ...], curved: Vertices
) -> arb_mat:
    """1, d_i, s_i and d_i d_j (rows) at products of vertices (columns): exact numbers."""
    choices = [curved if i in squared else STRAIGHT for i in range(count)]
    columns = [
        [1.0, *(d for d, _ in at), *(at[i][1] for i in squared), *(at[i][0] * at[j][0] for i, j in mixed)]
        for at in product(*choices)
    ]
    return arb_mat([list(row) for row in zip(*columns, strict=True)])

"""Polynomials of second order over a box, and vertices whose hull contains their values.

A polynomial in d_i/r_i with d = x - c is affine in every pair (d_i, s_i), s_i = d_i^2, and the pair lies in the hull of
(-r, r^2), (-r/2, 0), (r/2, 0), (r, r^2) (edges: tangents of the parabola, and its chord). Norms and largest eigenvalues
are convex, so products of these vertices are all there is to examine.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from flint import arb_mat

from tubecert.recheck.balls import Ball, between, magnitude

_STRAIGHT = ((-1.0, 0.0), (1.0, 0.0))
_CURVED = ((-1.0, 1.0), (-0.5, 0.0), (0.5, 0.0), (1.0, 1.0))


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

    def corners(self) -> Iterator[arb_mat]:
        """The polynomial at vertices whose hull contains all its values."""
        yield from self._corners(0, self.value, self.steps)

    def _corners(self, i: int, value: arb_mat, steps: list[arb_mat]) -> Iterator[arb_mat]:
        """Variable i at each of its vertices; its products with later ones become a part of their steps."""
        if i == len(steps):
            yield value
            return
        for d, s in _CURVED if i in self.squares else _STRAIGHT:
            corner = _added(value, d, steps[i])
            if s:
                corner = corner + self.squares[i]
            later = [
                _added(step, d, self.mixed[i, j]) if (i, j) in self.mixed else step
                for j, step in enumerate(steps)
            ]
            yield from self._corners(i + 1, corner, later)

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


def _added(corner: arb_mat, factor: float, step: arb_mat) -> arb_mat:
    if factor == 1:
        return corner + step
    return corner - step if factor == -1 else corner + step * factor

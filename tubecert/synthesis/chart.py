"""Boxes of states as cubes on which the conditions are polynomials, angles included.

A plain state is scaled to u in [-1, 1]. An angle phi in a range inside (-pi, pi) becomes t = tan(phi/2), scaled
likewise: sin phi = 2t/(1 + t^2) and cos phi = (1 - t^2)/(1 + t^2), so that a trigonometric polynomial of degree d times
(1 + t^2)^d > 0 is a polynomial of degree 2d in t. That is exact on the range, there is no circle s^2 + c^2 = 1 left to
reduce by, and in one variable sums of squares lose nothing.
Coefficients come from values on a tensor grid that has one node more than the degree in every variable.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import NDArray

from tubecert.expression import Expression, topological
from tubecert.synthesis.lifting import lift

Array = NDArray[np.float64]
Degrees = Mapping[str, int]


class NotPolynomialError(Exception):
    """The conditions are no polynomials in states and in sines and cosines of states."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A state in [lo, hi]; `angle`: it enters only by the sine and cosine of so many times itself; 0: by itself."""

    name: str
    lo: float
    hi: float
    angle: float

    def __post_init__(self) -> None:
        if self.angle and not -np.pi < self.angle * self.lo <= self.angle * self.hi < np.pi:
            raise NotPolynomialError(f"the range of the angle {self.name} reaches pi")

    def order(self, degree: int) -> int:
        """The degree in u of what has this degree in the state, or in its sine and cosine."""
        return 2 * degree if self.angle else degree

    def value(self, u: Array) -> Array:
        """The state at u in [-1, 1]."""
        return 2 * np.arctan(self._inner(u)) / self.angle if self.angle else self._inner(u)

    def weight(self, u: Array, degree: int) -> Array:
        """The positive factor that makes it a polynomial in u, at most 1."""
        if not self.angle:
            return np.ones_like(u)
        most = np.abs(self._ends).max()
        return np.asarray(((1 + self._inner(u) ** 2) / (1 + most**2)) ** degree)

    def _inner(self, u: Array) -> Array:
        lo, hi = self._ends
        return np.asarray((lo + hi) / 2 + (hi - lo) / 2 * u)

    @property
    def _ends(self) -> Array:
        """Of t, or of the state."""
        ends = np.array([self.lo, self.hi])
        return np.asarray(np.tan(self.angle * ends / 2)) if self.angle else ends


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """The variables of one condition, with its degree in each."""

    variables: tuple[Variable, ...]
    degrees: tuple[int, ...]

    @property
    def orders(self) -> tuple[int, ...]:
        """Degrees in u."""
        return tuple(v.order(d) for v, d in zip(self.variables, self.degrees, strict=True))

    def nodes(self) -> tuple[Array, Array]:
        """The tensor grid as states (N, variables), and the factor of the condition there (N,)."""
        axes = [chebyshev(order) for order in self.orders]
        states = [v.value(u) for v, u in zip(self.variables, axes, strict=True)]
        weights = [v.weight(u, d) for v, u, d in zip(self.variables, axes, self.degrees, strict=True)]
        return _tensor(states), np.prod(_tensor(weights), axis=1)

    def coefficients(self, values: Array, pieces: Sequence[int]) -> tuple[Array, Array]:
        """Values (N, ...) at the nodes -> control points (P, p) and polynomials there, (P, order_1 + 1, ..., ...).

        `pieces[i]` = 0 keeps variable i, in monomials of u; with k >= 1 it is replaced by the control points of its
        Bernstein form on k equal pieces, p variables in all. Where all of these are positive, so is the function; of
        degree 1 they are the two ends, and then that is necessary as well.
        """
        shape = tuple(order + 1 for order in self.orders)
        table = values.reshape(*shape, *values.shape[1:])
        places = []
        for axis, (order, count) in enumerate(zip(self.orders, pieces, strict=True)):
            matrix = monomial_matrix(order) if count == 0 else control_matrix(order, count)
            table = np.moveaxis(np.tensordot(matrix, table, axes=(1, axis)), 0, axis)
            if count:
                places.append(control_points(order, count))
        out = [axis for axis, count in enumerate(pieces) if count]
        table = np.moveaxis(table, out, range(len(out)))
        return _tensor(places), table.reshape(-1, *table.shape[len(out) :])


@cache
def chebyshev(order: int) -> Array:
    """order + 1 nodes in [-1, 1], both ends included."""
    return np.array([0.0]) if order == 0 else -np.cos(np.pi * np.arange(order + 1) / order)


@cache
def monomial_matrix(order: int) -> Array:
    """Values at the nodes -> coefficients of 1, u, u^2, ..."""
    return np.asarray(np.linalg.inv(np.vander(chebyshev(order), increasing=True)), dtype=np.float64)


@cache
def control_matrix(order: int, pieces: int) -> Array:
    """Values at the nodes -> Bernstein coefficients on equal pieces of [-1, 1], repeated ends once."""
    rows = []
    for lo, hi in _pieces(pieces):
        # coefficients of s^k from those of u^p, u = lo + (hi - lo) s
        shifted = np.zeros((order + 1, order + 1))
        for p in range(order + 1):
            for k in range(p + 1):
                shifted[k, p] = comb(p, k) * lo ** (p - k) * (hi - lo) ** k
        rows += [
            sum(comb(i, k) / comb(order, k) * shifted[k] for k in range(i + 1)) for i in range(order + 1)
        ]
    return np.array(rows)[_distinct(order, pieces)] @ monomial_matrix(order)


@cache
def control_points(order: int, pieces: int) -> Array:
    """Where the control points stand, in u."""
    share = np.arange(order + 1) / max(order, 1) if order else np.array([0.5])
    return np.concatenate([lo + (hi - lo) * share for lo, hi in _pieces(pieces)])[_distinct(order, pieces)]


def _pieces(count: int) -> list[tuple[float, float]]:
    ends = np.linspace(-1, 1, count + 1)
    return [(float(a), float(b)) for a, b in pairwise(ends)]


def _distinct(order: int, pieces: int) -> list[int]:
    """Rows without the first point of every piece but the first: it is the last of the one before."""
    return [r for r in range(pieces * (order + 1)) if order == 0 or r % (order + 1) or r == 0]


def _tensor(axes: Sequence[Array]) -> Array:
    """All combinations, (N, axes), the last one fastest."""
    if not axes:
        return np.zeros((1, 0))
    return np.stack([a.ravel() for a in np.meshgrid(*axes, indexing="ij")], axis=1)


def degrees_of(expressions: Sequence[Expression]) -> tuple[list[Degrees], dict[str, Fraction]]:
    """A bound on the degree of each expression in each state (of an angle: in sine and cosine), and the unit angles.

    Raises `NotLiftedError` or `NotPolynomialError` at what is no polynomial.
    """
    lifted = lift(expressions)
    circle = {name: angle for angle, pair in lifted.circles.items() for name in pair}
    degrees: dict[Expression, dict[str, int]] = {}
    for node in topological(lifted.expressions):
        parts = [degrees[arg] for arg in node.args]
        if node.op == "symbol":
            name = str(node.value)
            if name in lifted.circles:
                raise NotPolynomialError(f"{name} enters both by itself and by its sine or cosine")
            degrees[node] = {circle.get(name, name): 1}
        elif node.op in ("const", "pi"):
            degrees[node] = {}
        elif node.op == "add":
            degrees[node] = highest(*parts)
        elif node.op == "mul":
            degrees[node] = total(*parts)
        elif node.op == "pow" and int(str(node.value)) > 0:
            degrees[node] = {name: d * int(str(node.value)) for name, d in parts[0].items()}
        else:
            raise NotPolynomialError("a quotient is no polynomial")
    return [degrees[e] for e in lifted.expressions], lifted.units


def highest(*parts: Degrees) -> dict[str, int]:
    """Degrees of a sum."""
    return {name: max(p.get(name, 0) for p in parts) for name in {n: None for p in parts for n in p}}


def total(*parts: Degrees) -> dict[str, int]:
    """Degrees of a product."""
    return {name: sum(p.get(name, 0) for p in parts) for name in {n: None for p in parts for n in p}}

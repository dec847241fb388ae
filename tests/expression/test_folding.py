"""Folding against exact arithmetic: what a graph stands for is what its construction says, to the last digit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import fractions
from test_graph import value as node_by_node

from tubecert.expression import (
    ZERO,
    Expression,
    constant,
    derivative,
    norm,
    power,
    rebuild,
    sqrt,
    substitute,
    symbol,
    topological,
)

NAMES = ("x", "y", "z")
Point = dict[str, Fraction]


@dataclass(frozen=True)
class Built:
    """An expression, and the same as a function of exact numbers that never met the graph."""

    e: Expression
    at: Callable[[dict[str, Any]], Any]  # of Fractions, or of dual numbers


rationals = fractions(-4, 4, 9)
points = st.fixed_dictionaries(dict.fromkeys(NAMES, rationals))
leaves = st.one_of(
    st.sampled_from(NAMES).map(lambda name: Built(symbol(name), lambda p: p[name])),
    rationals.map(lambda q: Built(constant(q), lambda p: type(p["x"])(q))),
)


def _grow(children: st.SearchStrategy[Built]) -> st.SearchStrategy[Built]:
    pairs = st.tuples(children, children)
    return st.one_of(
        pairs.map(lambda v: Built(v[0].e + v[1].e, lambda p: v[0].at(p) + v[1].at(p))),
        pairs.map(lambda v: Built(v[0].e - v[1].e, lambda p: v[0].at(p) - v[1].at(p))),
        pairs.map(lambda v: Built(v[0].e * v[1].e, lambda p: v[0].at(p) * v[1].at(p))),
        pairs.filter(lambda v: v[1].e is not ZERO).map(
            lambda v: Built(v[0].e / v[1].e, lambda p: v[0].at(p) / v[1].at(p))
        ),
        st.tuples(children, rationals).map(lambda v: Built(v[1] * v[0].e, lambda p: v[1] * v[0].at(p))),
        st.tuples(children, st.integers(-4, 5))
        .filter(lambda v: v[0].e is not ZERO or v[1] > 0)
        .map(lambda v: Built(power(v[0].e, v[1]), lambda p: v[0].at(p) ** v[1])),
    )


rational_functions = st.recursive(leaves, _grow, max_leaves=7)


def exact(e: Expression, point: Point) -> Fraction:
    """The value by substitution, which folds to a constant."""
    return substitute([e], {name: constant(q) for name, q in point.items()})[0].fraction


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(built=rational_functions, point=points)
def test_a_graph_has_the_value_of_its_construction(built: Built, point: Point) -> None:
    try:
        value = built.at(point)
    except ZeroDivisionError:
        assume(False)
    assert node_by_node(built.e, point, Fraction) == value
    assert exact(built.e, point) == value


@dataclass(frozen=True)
class Dual:
    """A number with its slope: derivatives by arithmetic alone."""

    value: Fraction
    slope: Fraction = Fraction(0)

    def __add__(self, other: Dual) -> Dual:
        return Dual(self.value + other.value, self.slope + other.slope)

    def __sub__(self, other: Dual) -> Dual:
        return Dual(self.value - other.value, self.slope - other.slope)

    def __mul__(self, other: Dual | Fraction) -> Dual:
        if isinstance(other, Fraction):
            return Dual(self.value * other, self.slope * other)
        return Dual(self.value * other.value, self.slope * other.value + self.value * other.slope)

    __rmul__ = __mul__

    def __truediv__(self, other: Dual) -> Dual:
        inverse = 1 / other.value
        return self * Dual(inverse, -other.slope * inverse * inverse)

    def __pow__(self, n: int) -> Dual:
        result = Dual(Fraction(1))
        for _ in range(abs(n)):
            result = result * self
        return result if n >= 0 else Dual(Fraction(1)) / result


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(built=rational_functions, point=points, name=st.sampled_from(NAMES))
def test_a_derivative_is_that_of_dual_numbers(built: Built, point: Point, name: str) -> None:
    duals = {key: Dual(q, Fraction(key == name)) for key, q in point.items()}
    try:
        value = built.at(duals)
    except ZeroDivisionError:
        assume(False)
    assert node_by_node(derivative(built.e, name), point, Fraction) == value.slope


EXPONENTS = [n for n in range(-12, 13) if n not in (0, 1)]
FACTORS = [Fraction(q) for q in ("-1", "2", "-2", "1/3", "-5/7", "10")]


@pytest.mark.parametrize("n", EXPONENTS)
@pytest.mark.parametrize("q", FACTORS)
def test_a_factor_leaves_a_power_with_its_power(q: Fraction, n: int) -> None:
    x, y = symbol("x"), symbol("y")
    assert power(q * x, n) is q**n * power(x, n)
    assert power(q * x * y, n) is q**n * power(x * y, n)
    assert power(q * x**2, n) is q**n * power(x, 2 * n)
    assert power(q * x**-3, n) is q**n * power(x, -3 * n)
    assert power(constant(q), n).fraction == q**n


@pytest.mark.parametrize("n", EXPONENTS)
def test_powers_of_one_base_are_added_and_multiplied(n: int) -> None:
    x = symbol("x")
    for m in EXPONENTS:
        assert power(x, m) * power(x, n) is power(x, m + n)
        assert power(power(x, m), n) is power(x, m * n)
    assert derivative(power(x, n), "x") is n * power(x, n - 1)


@pytest.mark.parametrize("bottom", range(1, 20))
def test_only_roots_of_squares_are_folded(bottom: int) -> None:
    squares = {Fraction(a, b) ** 2: Fraction(a, b) for a in range(1, 20) for b in range(1, 20)}
    for q in (Fraction(top, bottom) for top in range(1, 20)):
        root = sqrt(constant(q))
        if q in squares:
            assert root.fraction == squares[q]
        else:
            assert root.op == "sqrt"
            assert root.args == (constant(q),)


def test_a_norm_counts_every_argument() -> None:
    x, y = symbol("x"), symbol("y")
    assert norm([x, x]).args == (x, x)  # |(x, x)| = sqrt(2) |x|
    assert norm([constant(-3)]).fraction == 3
    assert norm([ZERO, constant(-3), ZERO]).fraction == 3
    assert substitute([norm([x, y])], {"y": ZERO}) == [norm([x])]
    assert substitute([norm([x, y])], {"x": y}) == [norm([y, y])]


def test_directions_keep_their_component() -> None:
    x, y, z = (symbol(name) for name in NAMES)
    slopes = [derivative(norm([x, 2 * y, x * y]), name) for name in ("x", "y")]
    parts = [{n.value for n in topological([s]) if n.op == "direction"} for s in slopes]
    assert parts == [{0, 2}, {1, 2}]
    moved = substitute(slopes, {"x": z})
    assert [{n.value for n in topological([s]) if n.op == "direction"} for s in moved] == parts
    for node in topological(slopes):
        if node.op == "direction":
            assert rebuild(node, node.args) is node


def test_substitution_keeps_every_operation() -> None:
    x, y, z = (symbol(name) for name in NAMES)
    for e in (x / y, x**-3, (x + 1) / (y**2 - x), norm([x, y, x * y]), sqrt(x) * y):
        there = substitute([e], {"x": z, "y": x})[0]
        assert substitute([there], {"z": x, "x": y})[0] is e


def test_a_slope_needs_one_argument_only() -> None:
    x, y = symbol("x"), symbol("y")
    assert derivative(x * y, "x") is y
    assert derivative(y / x, "y") is 1 / x
    assert derivative(norm([y, x]), "x").op == "direction"

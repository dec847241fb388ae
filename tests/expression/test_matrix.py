"""Matrices of expressions against the definition, exactly."""

from fractions import Fraction
from itertools import permutations
from math import prod

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.expression import ONE, ZERO, constant, substitute, symbol
from tubecert.expression.matrix import (
    TooLargeError,
    adjugate,
    constants,
    determinant,
    identity,
    multiply,
    null_space,
)

entries = st.integers(-3, 3).map(Fraction)


def squares(n: int) -> st.SearchStrategy[list[list[Fraction]]]:
    return st.lists(st.lists(entries, min_size=n, max_size=n), min_size=n, max_size=n)


def by_definition(rows: list[list[Fraction]]) -> Fraction:
    n = len(rows)
    total = Fraction(0)
    for p in permutations(range(n)):
        odd = sum(p[i] > p[j] for i in range(n) for j in range(i + 1, n)) % 2
        total += (-1) ** odd * prod((rows[i][p[i]] for i in range(n)), start=Fraction(1))
    return total


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5])
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_determinant_and_adjugate_are_those_of_the_definition(n: int, data: st.DataObject) -> None:
    rows = data.draw(squares(n))
    value = by_definition(rows)
    assert determinant(constants(rows)) is constant(value)
    product = multiply(constants(rows), adjugate(constants(rows)))
    assert product == tuple(tuple(value * e for e in row) for row in identity(n))


@pytest.mark.parametrize("n", [2, 3, 4])
def test_a_symbolic_determinant_has_the_values_of_its_entries(n: int) -> None:
    names = [[f"a{i}{j}" for j in range(n)] for i in range(n)]
    symbolic = determinant([[symbol(name) for name in row] for row in names])
    for seed in range(5):
        rows = [
            [Fraction((7 * i + 3 * j * j + seed * (i + 2) * (j + 1)) % 11 - 5) for j in range(n)]
            for i in range(n)
        ]
        values = {names[i][j]: constant(rows[i][j]) for i in range(n) for j in range(n)}
        assert substitute([symbolic], values)[0] is constant(by_definition(rows))


@settings(max_examples=50, deadline=None)
@given(
    rows=st.integers(1, 3).flatmap(
        lambda p: st.lists(st.lists(entries, min_size=4, max_size=4), min_size=p, max_size=p)
    )
)
def test_a_null_space_is_one_and_all_of_it(rows: list[list[Fraction]]) -> None:
    basis = null_space(rows)
    assert all(sum(a * b for a, b in zip(row, v, strict=True)) == 0 for row in rows for v in basis)
    assert len(basis) >= 4 - len(rows)
    assert not null_space([list(column) for column in zip(*basis, strict=True)])  # they are independent


def test_a_determinant_that_is_too_large_is_refused() -> None:
    dense = [[symbol(f"b{i}_{j}") for j in range(8)] for i in range(8)]
    with pytest.raises(TooLargeError):
        determinant(dense, most=500)
    diagonal = [[dense[i][j] if i == j else ZERO for j in range(8)] for i in range(8)]
    assert determinant(diagonal, most=500) is not ZERO
    assert determinant([]) is ONE

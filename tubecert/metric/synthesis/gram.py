"""Matrix sums of squares on the cube [-1, 1]^v, with the coefficient equations eliminated.

A symmetric polynomial matrix C(u) (s, s) is positive semidefinite on the cube if (Putinar)
    C(u) = Z_0' G_0 Z_0 + sum_i (1 - u_i^2) Z_i' G_i Z_i,    G_0, G_i >= 0,    Z = (monomials of u) x I_s.
Comparing coefficients gives one equation for every monomial and entry of C. Each is solved for one entry of G_0, its
pivot, so that only cones remain: G_0 and G_i become affine functions of C's coefficients and of the other Gram entries.
Sign symmetries that fix C split every G into blocks, one for each character.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Array = NDArray[np.float64]
Ints = NDArray[np.intp]
Signs = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GramForm:
    """Gram entries = `pivots` @ (coefficients of C) + `free` @ (free Gram entries).

    Rows: the upper triangles, column by column, of blocks of the given `orders`, one after another. Coefficients of C:
    monomial by monomial (exponents in C order, shape `orders of C + 1`), each with the upper triangle of C.
    """

    orders: tuple[int, ...]
    pivots: sparse.csr_array
    free: sparse.csr_array


@lru_cache(maxsize=64)
def gram_form(orders: tuple[int, ...], size: int, raised: int = 0, signs: Signs = ()) -> GramForm:
    """The form for C (size, size) of degree `orders[i]` in u_i; multipliers have `raised` times two degrees more.

    Each of `signs` is a symmetry: for every variable, then for every row of C, 1 or -1, with C(u) = D C(S u) D.
    """
    half = tuple((order + 1) // 2 + (raised if order else 0) for order in orders)
    blocks = _blocks(half, size, signs)
    entries = [_entries(block, half, size) for block in blocks]
    starts = np.cumsum([0, *(len(block.basis) * (len(block.basis) + 1) // 2 for block in blocks)])
    row = np.concatenate([e[0] + start for e, start in zip(entries, starts[:-1], strict=True)])
    equation = np.concatenate([e[1] for e in entries])
    factor = np.concatenate([e[2] for e in entries])
    pivot = _pivots(
        blocks, entries, starts, _equations(half, size)
    )  # equation -> row and factor of its pivot, row -1 if it has none
    rows, count = int(starts[-1]), len(pivot[0])
    is_pivot = np.zeros(rows, dtype=bool)
    is_pivot[pivot[0][pivot[0] >= 0]] = True
    column = np.cumsum(~is_pivot) - 1
    own = np.flatnonzero(~is_pivot)
    other = ~is_pivot[row]
    place, divisor = pivot[0][equation[other]], pivot[1][equation[other]]
    free = sparse.csr_array(
        (
            np.concatenate([np.ones(len(own)), -factor[other] / divisor]),
            (np.concatenate([own, place]), np.concatenate([column[own], column[row[other]]])),
        ),
        shape=(rows, len(own)),
    )
    present = np.flatnonzero(pivot[0] >= 0)
    inserted = sparse.csr_array((1 / pivot[1][present], (pivot[0][present], present)), shape=(rows, count))
    keep = _within(orders, half, size)
    return GramForm(
        orders=tuple(len(block.basis) for block in blocks),
        pivots=sparse.csr_array(inserted[:, keep]),
        free=free,
    )


@dataclass(frozen=True, slots=True)
class _Block:
    """Basis elements (exponents..., row of C) and the multiplier's terms (exponents, coefficient)."""

    basis: Ints
    terms: tuple[tuple[tuple[int, ...], float], ...]


def _blocks(half: tuple[int, ...], size: int, signs: Signs) -> list[_Block]:
    variables = len(half)
    zero = (0,) * variables
    multipliers = [(half, ((zero, 1.0),))]
    for i, h in enumerate(half):
        if h:
            square = tuple(2 * (k == i) for k in range(variables))
            smaller = tuple(d - (k == i) for k, d in enumerate(half))
            multipliers.append((smaller, ((zero, 1.0), (square, -1.0))))
    blocks = []
    for limits, terms in multipliers:
        basis = np.array(list(product(*(range(d + 1) for d in limits), range(size))), dtype=np.intp)
        for chosen in _classes(basis, signs):
            blocks.append(_Block(basis[chosen], terms))
    return blocks


def _classes(basis: Ints, signs: Signs) -> list[Ints]:
    """Elements with equal characters under all symmetries."""
    exponents, rows = basis[:, :-1], basis[:, -1]
    characters = np.zeros(len(basis), dtype=np.intp)
    for sign in signs:
        odd = np.array(sign[: exponents.shape[1]]) < 0
        flips = exponents[:, odd].sum(axis=1) + (np.array(sign[exponents.shape[1] :])[rows] < 0)
        characters = 2 * characters + flips % 2
        characters = np.unique(characters, return_inverse=True)[1]
    return [np.flatnonzero(characters == c) for c in range(int(characters.max()) + 1)]


def _entries(block: _Block, half: tuple[int, ...], size: int) -> tuple[Ints, Ints, Array, Ints]:
    """(row in the triangle, equation, factor, imbalance) of everything that the entries of a block contribute."""
    j, i = np.tril_indices(len(block.basis))
    left, right = block.basis[i], block.basis[j]
    a, b = np.minimum(left[:, -1], right[:, -1]), np.maximum(left[:, -1], right[:, -1])
    entry = b * (b + 1) // 2 + a
    twice = np.where((a == b) & (i != j), 2.0, 1.0)
    imbalance = np.abs(left[:, :-1] - right[:, :-1]).sum(axis=1)
    shape = tuple(2 * h + 1 for h in half)
    rows, equations, factors, spread = [], [], [], []
    for exponents, value in block.terms:
        power = left[:, :-1] + right[:, :-1] + np.array(exponents, dtype=np.intp)
        monomial = np.ravel_multi_index(tuple(power.T), shape) if half else np.zeros(len(i), dtype=np.intp)
        rows.append(np.arange(len(i)))
        equations.append(monomial * (size * (size + 1) // 2) + entry)
        factors.append(value * twice)
        spread.append(imbalance)
    return np.concatenate(rows), np.concatenate(equations), np.concatenate(factors), np.concatenate(spread)


def _equations(half: tuple[int, ...], size: int) -> int:
    """How many coefficients there are at most."""
    return int(np.prod([2 * h + 1 for h in half], dtype=int)) * (size * (size + 1) // 2)


def _pivots(
    blocks: Sequence[_Block], entries: Sequence[tuple[Ints, Ints, Array, Ints]], starts: Ints, count: int
) -> tuple[Ints, Array]:
    """For every equation the row (-1: none) and factor of its pivot: the most balanced product of monomials in G_0."""
    first = [k for k, block in enumerate(blocks) if len(block.terms) == 1]
    row = np.concatenate([entries[k][0] + starts[k] for k in first])
    equation = np.concatenate([entries[k][1] for k in first])
    factor = np.concatenate([entries[k][2] for k in first])
    imbalance = np.concatenate([entries[k][3] for k in first])
    places, factors = np.full(count, -1, dtype=np.intp), np.ones(count)
    order = np.lexsort((row, imbalance, equation))
    chosen = order[np.concatenate([[True], np.diff(equation[order]) > 0])]
    places[equation[chosen]] = row[chosen]
    factors[equation[chosen]] = factor[chosen]
    return places, factors


def _within(orders: tuple[int, ...], half: tuple[int, ...], size: int) -> Ints:
    """Equations of the monomials that C has, in the order of C's coefficients."""
    triangle = size * (size + 1) // 2
    if not orders:
        return np.arange(triangle)
    exponents = np.array(list(product(*(range(order + 1) for order in orders))), dtype=np.intp)
    monomial = np.ravel_multi_index(tuple(exponents.T), tuple(2 * h + 1 for h in half))
    return np.asarray((monomial[:, None] * triangle + np.arange(triangle)).ravel())

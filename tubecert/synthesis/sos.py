"""Synthesis by sums of squares: matrix SOS with Putinar multipliers on the safe set, trigonometric dynamics included.

The unknowns are the entries of the V_k, kappa, and the Gram entries that the coefficient equations leave free
(`gram`): only cones remain, and the program goes straight to the solver (`conic`).
Untrusted. Implements: (CCM_1), (CCM_2) as sufficient conditions, on the whole set up to the solver's accuracy.

Matrix sums of squares on the cube [-1, 1]^v, with the coefficient equations eliminated.

A symmetric polynomial matrix C(u) (s, s) is positive semidefinite on the cube if (Putinar)
    C(u) = Z_0' G_0 Z_0 + sum_i (1 - u_i^2) Z_i' G_i Z_i,    G_0, G_i >= 0,    Z = (monomials of u) x I_s;
in one variable that loses nothing. Comparing coefficients gives one equation for every monomial and entry of C. Each is
solved for one entry of G_0, its pivot, that occurs in no other: only cones remain, of matrices that are affine in C's
coefficients and the other Gram entries. Sign symmetries of C split every G into blocks, one for each character.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from math import inf, prod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.progress import Phase, Step
from tubecert.synthesis.chart import NotPolynomialError
from tubecert.synthesis.conic import Affine, ConicProgram, ConicSolution, Semidefinite, solve, triangle
from tubecert.synthesis.lifting import NotLiftedError
from tubecert.synthesis.polynomial import Condition, Conditions, polynomial_conditions
from tubecert.synthesis.problem import Proposal, SynthesisProblem

Ints = NDArray[np.intp]
Signs = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GramForm:
    """Gram entries = `pivots` @ (coefficients of C) + `free` @ (free Gram entries).

    Rows: the upper triangles, column by column, of blocks of the given `orders`, one after another. Coefficients of C:
    monomial by monomial (exponents in C order, shape `order_i + 1`), of each the upper triangle of C.
    """

    orders: tuple[int, ...]
    pivots: sparse.csr_array
    free: sparse.coo_array


@lru_cache(maxsize=64)
def gram_form(orders: tuple[int, ...], size: int, signs: Signs = ()) -> GramForm:
    """The form for C (size, size) of degree `orders[i]` in u_i.

    Each of `signs` is a symmetry: for every variable, then for every row of C, 1 or -1, with C(u) = D C(S u) D.
    """
    half = tuple((order + 1) // 2 for order in orders)
    multipliers: list[int | None] = [None, *(i for i, h in enumerate(half) if h)]
    blocks = [(basis, i) for i in multipliers for basis in _classes(_basis(half, i, size), signs)]
    plain = [basis for basis, i in blocks if i is None]
    sums = sparse.hstack([_products(basis, half, i, size) for basis, i in blocks], format="csr")
    equation, pivot, factor = _pivots(sums, np.concatenate([_imbalance(basis) for basis in plain]))
    entries = sums.shape[1]
    kept = np.setdiff1d(np.arange(entries), pivot)
    solved = sparse.csr_array((1 / factor, (pivot, equation)), shape=(entries, sums.shape[0]))
    selected = sparse.csr_array(
        (np.ones(len(kept)), (kept, np.arange(len(kept)))), shape=(entries, len(kept))
    )
    return GramForm(
        orders=tuple(len(basis) for basis, _ in blocks),
        pivots=sparse.csr_array(solved[:, _within(orders, half, size)]),
        free=sparse.coo_array(selected - solved @ sums[:, kept]),
    )


def _basis(half: tuple[int, ...], multiplier: int | None, size: int) -> Ints:
    """Exponents and row of C, one element a row; one degree less where 1 - u_i^2 multiplies."""
    limits = [h - (i == multiplier) for i, h in enumerate(half)]
    return np.array(list(product(*(range(h + 1) for h in limits), range(size))), dtype=np.intp)


def _classes(basis: Ints, signs: Signs) -> list[Ints]:
    """The elements, by their characters under all symmetries."""
    variables = basis.shape[1] - 1
    character = np.zeros(len(basis), dtype=np.intp)
    for sign in signs:
        odd = basis[:, :-1][:, np.array(sign[:variables], dtype=int) < 0].sum(axis=1)
        odd = odd + (np.array(sign[variables:])[basis[:, -1]] < 0)
        character = np.unique(2 * character + odd % 2, return_inverse=True)[1]
    return [basis[character == c] for c in range(int(character.max()) + 1)]


def _products(basis: Ints, half: tuple[int, ...], multiplier: int | None, size: int) -> sparse.csr_array:
    """What every entry of one Gram block adds to the coefficients of C, (coefficients, entries)."""
    i, j = triangle(len(basis))
    left, right = basis[i], basis[j]
    low, high = np.minimum(left[:, -1], right[:, -1]), np.maximum(left[:, -1], right[:, -1])
    both = np.where((low == high) & (i != j), 2.0, 1.0)  # (p, q) and (q, p) meet the same entry of C
    exponents = left[:, :-1] + right[:, :-1]
    t, shape = size * (size + 1) // 2, tuple(2 * h + 1 for h in half)
    total = sparse.csr_array((prod(shape) * t, len(i)))
    for sign, shift in [(1.0, 0)] if multiplier is None else [(1.0, 0), (-1.0, 2)]:
        moved = exponents + shift * (np.arange(len(half)) == multiplier)
        monomial = np.ravel_multi_index(tuple(moved.T), shape) if half else np.zeros(len(i), dtype=np.intp)
        rows = monomial * t + high * (high + 1) // 2 + low
        total = total + sparse.csr_array((sign * both, (rows, np.arange(len(i)))), shape=total.shape)
    return total


def _imbalance(basis: Ints) -> Ints:
    """How far apart the two monomials of each entry are."""
    i, j = triangle(len(basis))
    return np.asarray(np.abs(basis[i, :-1] - basis[j, :-1]).sum(axis=1))


def _pivots(sums: sparse.csr_array, imbalance: Ints) -> tuple[Ints, Ints, NDArray[np.float64]]:
    """(equation, entry of G_0, its factor) for every equation that has one: of the most balanced product."""
    plain = sparse.coo_array(sums[:, : len(imbalance)])
    equation, entry = plain.coords
    order = np.lexsort((entry, imbalance[entry], equation))
    chosen = order[np.flatnonzero(np.diff(equation[order], prepend=-1))]
    return equation[chosen].astype(np.intp), entry[chosen].astype(np.intp), plain.data[chosen]


def _within(orders: tuple[int, ...], half: tuple[int, ...], size: int) -> Ints:
    """The equations of the coefficients that C has, in their order."""
    places = np.arange(prod(2 * h + 1 for h in half)).reshape([2 * h + 1 for h in half])
    own = places[tuple(slice(order + 1) for order in orders)].ravel()
    t = size * (size + 1) // 2
    return np.asarray((own[:, None] * t + np.arange(t)).ravel())


Array = NDArray[np.float64]
ROUTE = "sos"
_DUST = 1e-11  # relative to the largest coefficient


def propose_sos(problem: SynthesisProblem) -> Proposal:
    """The member of the family with the least kappa that sums of squares find."""
    try:
        conditions = polynomial_conditions(problem)
    except (NotPolynomialError, NotLiftedError) as error:
        return _proposal(None, ConicSolution.none(f"sums of squares do not apply: {error}"), problem)
    if problem.progress is not None:
        words = f"sums of squares: {len(conditions.conditions)} polynomial matrices"
        problem.progress(Step(phase=Phase.SYNTHESIS, name=words))
    found = solve(sos_program(conditions), problem.solver)
    return _proposal(conditions, found, problem)


def sos_program(conditions: Conditions) -> ConicProgram:
    """Minimise kappa: variables are the unknowns, kappa, then every condition's free Gram entries."""
    count = conditions.unknowns.count
    orders: list[int] = []
    constants: list[Array] = []
    data: list[Array] = []
    rows: list[NDArray[Any]] = []
    columns: list[NDArray[Any]] = []
    row, column = 0, count + 1
    for condition in conditions.conditions:
        form = gram_form(condition.orders, condition.size, condition.signs)
        table = form.pivots @ _clean(condition)
        shared, free = table[:, :-1], form.free
        i, j = np.nonzero(shared)
        data += [shared[i, j], free.data]
        rows += [i + row, free.coords[0] + row]
        columns += [j, free.coords[1] + column]
        constants.append(table[:, -1])
        orders += form.orders
        row, column = row + len(table), column + free.shape[1]
    slopes = sparse.csr_array(
        (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))), shape=(row, column)
    )
    entries = Affine(constant=np.concatenate(constants), slopes=slopes)
    cost = np.zeros(column)
    cost[count] = 1.0
    return ConicProgram(cost=cost, semidefinite=[Semidefinite(orders=tuple(orders), entries=entries)])


def _clean(condition: Condition) -> Array:
    """The coefficients, by monomial and entry, (equations, U + 2), without the dust of interpolation."""
    table = condition.coefficients.reshape(-1, condition.coefficients.shape[-1])
    return np.where(np.abs(table) > _DUST * np.abs(table).max(), table, 0.0)


def _proposal(conditions: Conditions | None, found: ConicSolution, problem: SynthesisProblem) -> Proposal:
    y, kappa, status, feasible = found.values, inf, found.status, found.feasible
    if conditions is None or feasible is False:
        y = None
    elif y is None:
        feasible = None  # "solved" without a finite solution is no opinion
    coefficients = None
    if conditions is not None and y is not None:
        count = conditions.unknowns.count
        inner = conditions.unknowns.matrices(y[:count])
        coefficients, kappa = inner * problem.scaled.entries, float(y[count])
    if problem.limit is not None and feasible and kappa > problem.limit:
        feasible, status = False, f"{status}, with kappa {kappa:.6g} above the limit {problem.limit:.6g}"
    return Proposal(
        route=ROUTE,
        coefficients=coefficients,
        kappa=kappa,
        feasible=feasible,
        status=status,
    )

"""Synthesis by sums of squares: matrix SOS with Putinar multipliers on the safe set, trigonometric dynamics included.

The unknowns are the entries of the V_k, kappa, and the Gram entries that the coefficient equations leave free
(`gram`): only cones remain, and the program goes straight to the solver (`conic`).
Untrusted. Implements: (CCM_1), (CCM_2) as sufficient conditions, on the whole set up to the solver's accuracy.
"""

from __future__ import annotations

from math import inf
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.metric.synthesis.chart import NotPolynomialError
from tubecert.metric.synthesis.conic import Affine, ConicProgram, ConicSolution, Semidefinite, solve
from tubecert.metric.synthesis.gram import gram_form
from tubecert.metric.synthesis.lifting import NotLiftedError
from tubecert.metric.synthesis.polynomial import Condition, Conditions, polynomial_conditions
from tubecert.metric.synthesis.problem import Proposal, SynthesisProblem

Array = NDArray[np.float64]
ROUTE = "sos"
_DUST = 1e-11  # of interpolation, relative to the largest coefficient
_PIECES = 2


def propose_sos(problem: SynthesisProblem, *, raised: int = 0) -> Proposal:
    """The member of the family with the least kappa that sums of squares find.

    `raised`: by so many steps finer than the degrees of the conditions suggest: multipliers of two degrees more, and
    twice the pieces where variables are replaced by control points.
    """
    start = perf_counter()
    try:
        conditions = polynomial_conditions(problem, pieces=_PIECES << raised)
    except (NotPolynomialError, NotLiftedError) as error:
        return _proposal(None, ConicSolution.none(f"sums of squares do not apply: {error}"), problem, start)
    if problem.progress is not None:
        problem.progress(f"sums of squares: {len(conditions.conditions)} polynomial matrices")
    found = solve(sos_program(conditions, raised=raised), problem.solver)
    return _proposal(conditions, found, problem, start)


def sos_program(conditions: Conditions, *, raised: int = 0) -> ConicProgram:
    """Minimise kappa: variables are the unknowns, kappa, then every condition's free Gram entries."""
    count = conditions.unknowns.count
    pieces = [_gram_entries(condition, raised) for condition in conditions.conditions]
    width = count + 1 + sum(free.shape[1] for _, _, _, free in pieces)
    blocks: list[Semidefinite] = []
    column = count + 1
    for orders, constant, shared, free in pieces:
        slopes = _side_by_side(shared, free, column, width)
        column += free.shape[1]
        row = 0
        for order in orders:
            rows = slice(row, row + order * (order + 1) // 2)
            row = rows.stop
            blocks.append(
                Semidefinite(order=order, entries=Affine(constant=constant[rows], slopes=slopes[rows]))
            )
    cost = np.zeros(width)
    cost[count] = 1.0
    return ConicProgram(cost=cost, semidefinite=blocks)


def _gram_entries(
    condition: Condition, raised: int
) -> tuple[tuple[int, ...], Array, sparse.csr_array, sparse.csr_array]:
    """(orders, constants, slopes in unknowns and kappa, slopes in free Gram entries) of the Gram blocks."""
    form = gram_form(condition.orders, condition.size, raised, condition.signs)
    table = condition.coefficients.reshape(-1, condition.coefficients.shape[-1])  # by monomial, then by entry
    table = np.where(np.abs(table) > _DUST * np.abs(table).max(), table, 0.0)
    shared = sparse.csr_array(form.pivots @ sparse.csr_array(table[:, :-1]))
    return form.orders, np.asarray(form.pivots @ table[:, -1]), shared, form.free


def _side_by_side(
    shared: sparse.csr_array, free: sparse.csr_array, column: int, width: int
) -> sparse.csr_array:
    a, b = sparse.coo_array(shared), sparse.coo_array(free)
    data = np.concatenate([a.data, b.data])
    rows = np.concatenate([a.coords[0], b.coords[0]])
    columns = np.concatenate([a.coords[1], b.coords[1] + column])
    return sparse.csr_array((data, (rows, columns)), shape=(a.shape[0], width))


def _proposal(
    conditions: Conditions | None, found: ConicSolution, problem: SynthesisProblem, start: float
) -> Proposal:
    y, kappa, status, feasible = found.values, inf, found.status, found.feasible
    if conditions is None or feasible is False:
        y = None
    coefficients = None
    if conditions is not None and y is not None:
        count = conditions.unknowns.count
        coefficients, kappa = conditions.unknowns.matrices(y[:count]), float(y[count])
    if problem.limit is not None and feasible and kappa > problem.limit:
        feasible, status = False, f"{status}, with kappa {kappa:.6g} above the limit {problem.limit:.6g}"
    return Proposal(
        route=ROUTE,
        coefficients=coefficients,
        kappa=kappa,
        feasible=feasible,
        status=status,
        seconds=perf_counter() - start,
        solver_seconds=found.seconds,
    )

"""Synthesis by sums of squares: matrix SOS with Putinar multipliers on the safe set, trigonometric dynamics included.

The unknowns are the entries of the V_k, kappa, and the Gram entries that the coefficient equations leave free
(`gram`): only cones remain, and the program goes straight to the solver (`conic`).
Untrusted. Implements: (CCM_1), (CCM_2) as sufficient conditions, on the whole set up to the solver's accuracy.
"""

from __future__ import annotations

from math import inf
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.progress import Phase, Step
from tubecert.synthesis.chart import NotPolynomialError
from tubecert.synthesis.conic import Affine, ConicProgram, ConicSolution, Semidefinite, solve
from tubecert.synthesis.gram import gram_form
from tubecert.synthesis.lifting import NotLiftedError
from tubecert.synthesis.polynomial import Condition, Conditions, polynomial_conditions
from tubecert.synthesis.problem import Proposal, SynthesisProblem

Array = NDArray[np.float64]
ROUTE = "sos"
_DUST = 1e-11  # relative to the largest coefficient


def propose_sos(problem: SynthesisProblem) -> Proposal:
    """The member of the family with the least kappa that sums of squares find."""
    start = perf_counter()
    try:
        conditions = polynomial_conditions(problem)
    except (NotPolynomialError, NotLiftedError) as error:
        return _proposal(None, ConicSolution.none(f"sums of squares do not apply: {error}"), problem, start)
    if problem.progress is not None:
        words = f"sums of squares: {len(conditions.conditions)} polynomial matrices"
        problem.progress(Step(phase=Phase.SYNTHESIS, name=words))
    found = solve(sos_program(conditions), problem.solver)
    return _proposal(conditions, found, problem, start)


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


def _proposal(
    conditions: Conditions | None, found: ConicSolution, problem: SynthesisProblem, start: float
) -> Proposal:
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
        seconds=perf_counter() - start,
        solver_seconds=found.seconds,
    )

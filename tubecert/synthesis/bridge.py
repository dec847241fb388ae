"""The bridge to every other solver of semidefinite programs: through cvxpy, by the name that it has there.

The same program as in `conic`, one constraint of cvxpy for each of its parts. What a solver says of its work comes back
as its status: its warnings are not repeated, its breakdowns are no solution.
Untrusted, like every solver.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import sparse

from tubecert.errors import SpecError
from tubecert.findings import Finding
from tubecert.synthesis.conic import CVXPY, Affine, ConicProgram, ConicSolution, judged, triangle


def _cvxpy() -> Any:
    """The library, which takes a second to load."""
    import cvxpy

    return cvxpy


def required(solver: str) -> None:
    """Raises `SpecError`, naming those that there are, unless the solver is installed and takes matrices."""
    if not solver.startswith(CVXPY):
        return
    found = available()
    name = solver.removeprefix(CVXPY)
    if name in found:
        return
    cvxpy = _cvxpy()
    why = "does not solve semidefinite programs" if name in cvxpy.installed_solvers() else "is not installed"
    shown = ", ".join(CVXPY + other for other in found)
    raise SpecError(
        [
            Finding(
                code="TC122",
                message=f"the solver {solver} cannot be used: {name} {why}",
                help=f"installed: {shown}; also: clarabel, scs",
            )
        ]
    )


def available() -> list[str]:
    """cvxpy's names of the installed solvers that take semidefinite programs."""
    cvxpy = _cvxpy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sorted(name for name in cvxpy.installed_solvers() if _takes_matrices(name))


def _takes_matrices(name: str) -> bool:
    cvxpy = _cvxpy()
    x = cvxpy.Variable((2, 2), symmetric=True)
    try:
        cvxpy.Problem(cvxpy.Minimize(cvxpy.trace(x)), [x >> np.eye(2)]).get_problem_data(name)
    except Exception:  # each of these interfaces refuses in a way of its own
        return False
    return True


def solve_through_cvxpy(
    program: ConicProgram, name: str, tolerance: float, iterations: int | None
) -> ConicSolution:
    """The answer of cvxpy's solver `name`; its own tolerances and limits hold where ours have no name there."""
    cvxpy = _cvxpy()
    y = cvxpy.Variable(len(program.cost))
    parts = list(_parts(program))
    constraints = [_constraint(kind, part, y) for kind, part in parts]
    task = cvxpy.Problem(cvxpy.Minimize(program.cost @ y), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the status says the same
            task.solve(solver=name, **_settings(name, tolerance, iterations))
    except Exception as error:  # a solver from outside may fail in any way
        what = " ".join(str(error).split())[:120] or type(error).__name__
        return ConicSolution.none(f"{name} through cvxpy failed: {what}")
    return _answer(task, y, name, _bound(parts, constraints), tolerance)


def _parts(program: ConicProgram) -> Iterator[tuple[str, Affine]]:
    """Equalities, inequalities, and every matrix with all its entries, row by row."""
    if program.equalities is not None and len(program.equalities.constant):
        yield "zero", program.equalities
    if program.inequalities is not None and len(program.inequalities.constant):
        yield "nonnegative", program.inequalities
    for block in program.semidefinite:
        slopes, start = sparse.csr_array(block.entries.slopes), 0
        for order in block.orders:
            rows = start + _places(order)
            yield "semidefinite", Affine(constant=block.entries.constant[rows], slopes=slopes[rows])
            start += order * (order + 1) // 2


def _places(order: int) -> Any:
    """Where entry (i, j) of a symmetric matrix stands in its upper triangle, (order^2,), row by row."""
    i, j = triangle(order)
    places = np.zeros((order, order), dtype=np.intp)
    places[i, j] = places[j, i] = np.arange(len(i))
    return places.ravel()


def _constraint(kind: str, part: Affine, y: Any) -> Any:
    cvxpy = _cvxpy()
    value = part.slopes @ y + part.constant
    if kind == "zero":
        return value == 0
    if kind == "nonnegative":
        return value >= 0
    order = round(np.sqrt(len(part.constant)))
    return cvxpy.reshape(value, (order, order), order="C") >> 0


def _settings(name: str, tolerance: float, iterations: int | None) -> dict[str, float]:
    """Tolerance and limit under the names that a solver has for them."""
    if name == "CLARABEL":
        settings: dict[str, float] = dict.fromkeys(("tol_feas", "tol_gap_abs", "tol_gap_rel"), tolerance)
        return settings | {"max_threads": 1} | ({} if iterations is None else {"max_iter": iterations})
    if name == "SCS":
        return {"eps_abs": tolerance, "eps_rel": tolerance, "max_iters": iterations or 20_000}
    if name == "CVXOPT":
        return dict.fromkeys(("abstol", "reltol", "feastol"), tolerance)
    return {}


def _bound(parts: list[tuple[str, Affine]], constraints: list[Any]) -> float | None:
    """The dual's value: of the Lagrangian, what does not depend on y. None without multipliers."""
    total = 0.0
    for (kind, part), constraint in zip(parts, constraints, strict=True):
        if constraint.dual_value is None:
            return None
        value = float(part.constant @ np.ravel(np.asarray(constraint.dual_value, dtype=float)))
        total += value if kind == "zero" else -value
    return total


def _answer(task: Any, y: Any, name: str, bound: float | None, tolerance: float) -> ConicSolution:
    cvxpy = _cvxpy()
    status, stats = str(task.status), task.solver_stats
    opinions = {
        cvxpy.OPTIMAL: True,
        cvxpy.OPTIMAL_INACCURATE: True,
        cvxpy.INFEASIBLE: False,
        cvxpy.INFEASIBLE_INACCURATE: False,
    }
    objective = np.inf if task.value is None else float(task.value)
    values = np.full(y.shape, np.nan) if y.value is None else np.asarray(y.value, dtype=float)
    if bound is None:  # no multipliers: as far as its tolerance may be trusted
        bound = objective - tolerance * (1 + abs(objective)) if np.isfinite(objective) else -np.inf
    return judged(
        values,
        objective=objective,
        bound=bound,
        feasible=opinions.get(status),
        finished=status in (cvxpy.OPTIMAL, cvxpy.INFEASIBLE),
        status=f"{name} through cvxpy: {status.replace('_', ' ')}",
        iterations=int(getattr(stats, "num_iters", None) or 0),
        seconds=float(getattr(stats, "solve_time", None) or 0.0),
    )

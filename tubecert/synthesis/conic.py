"""Semidefinite programs, straight to a conic solver.

Minimise c'y subject to S_0 + sum_k y_k S_k >= 0 for every block. All slopes are sparse and nothing is
canonicalised, so that the wall time is the solver's own. Clarabel runs on one thread with fixed settings; SCS, for
cross-checks, and every other solver are reached through cvxpy.
Untrusted: what comes back is a proposal with an opinion, never a verdict.

A program for cvxpy has one constraint for each of its parts. What a solver says of its work comes back as its status:
its warnings are not repeated, its breakdowns are no solution.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.errors import SpecError
from tubecert.findings import Finding

Array = NDArray[np.float64]
CVXPY = "cvxpy:"  # and a name


@dataclass(frozen=True, slots=True, kw_only=True)
class Affine:
    """y -> constant + slopes y: `constant` (r,), `slopes` (r, N) sparse or dense."""

    constant: Array
    slopes: Any

    def at(self, y: Array) -> Array:
        """The value at y, (r,)."""
        return np.asarray(self.constant + self.slopes @ y)


@dataclass(frozen=True, slots=True, kw_only=True)
class Semidefinite:
    """Symmetric matrices of the given `orders` that are affine in y and have to be positive semidefinite.

    `entries` holds their upper triangles one after another, column by column, unscaled: row j(j+1)/2 + i of a matrix
    is entry (i, j), i <= j.
    """

    orders: tuple[int, ...]
    entries: Affine


@dataclass(frozen=True, slots=True, kw_only=True)
class ConicProgram:
    """Minimise cost'y (N,) subject to `semidefinite` blocks."""

    cost: Array
    semidefinite: Sequence[Semidefinite]

    @property
    def orders(self) -> list[int]:
        """Orders of all semidefinite matrices."""
        return [order for block in self.semidefinite for order in block.orders]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConicSolution:
    """`values` y (N,), also of an unfinished run, None if there are none; `bound` is the dual's value of the objective.

    `feasible`: the solver's opinion, None if it came to none; `status`: its words.
    """

    values: Array | None
    objective: float
    bound: float
    feasible: bool | None
    status: str

    @classmethod
    def none(cls, status: str) -> ConicSolution:
        """No solution, and why."""
        return cls(
            values=None,
            objective=np.inf,
            bound=-np.inf,
            feasible=None,
            status=status,
        )


def triangle(order: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns (i <= j) of the upper triangle, column by column."""
    j, i = _lower_triangle(order)
    return i, j


@cache
def _lower_triangle(order: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    j, i = np.tril_indices(order)
    j.flags.writeable = i.flags.writeable = False
    return j, i


def solve(
    program: ConicProgram, solver: str = "clarabel", *, tolerance: float = 1e-8, iterations: int | None = None
) -> ConicSolution:
    """The answer of `solver` (clarabel, scs, or cvxpy:NAME), deterministic on one machine.

    `tolerance` is on gap and residuals; `iterations` bounds the work (default 200, of SCS 20 000). Data that are not
    finite end without calling a solver.
    """
    lifted = _stacked(program)
    if not (np.isfinite(lifted.slopes.data).all() and np.isfinite(lifted.constant).all()):
        return ConicSolution.none("the program has coefficients that are not finite")
    if solver != "clarabel":
        name = "SCS" if solver == "scs" else solver.removeprefix(CVXPY)
        return solve_through_cvxpy(program, name, tolerance, iterations)
    return _clarabel(program, lifted, tolerance, iterations or 200)


def _stacked(program: ConicProgram) -> Affine:
    """All rows as one, off-diagonal entries times sqrt 2."""
    parts = [block.entries for block in program.semidefinite]
    scale = np.concatenate([_scale(order) for order in program.orders])
    slopes = sparse.vstack([sparse.csr_array(part.slopes) for part in parts], format="csc")
    assert slopes.shape == (len(scale), len(program.cost)), (
        "a row for every entry, a column for every variable"
    )
    scaled = sparse.csc_matrix(
        (slopes.data * scale[slopes.indices], slopes.indices, slopes.indptr), slopes.shape
    )
    return Affine(constant=scale * np.concatenate([part.constant for part in parts]), slopes=scaled)


@cache
def _scale(order: int) -> Array:
    i, j = triangle(order)
    return np.where(i == j, 1.0, np.sqrt(2.0))


def _clarabel(program: ConicProgram, rows: Affine, tolerance: float, iterations: int) -> ConicSolution:
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.direct_solve_method = "faer"
    settings.chordal_decomposition_enable = False
    settings.max_iter = iterations
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = tolerance
    cones = [clarabel.PSDTriangleConeT(order) for order in program.orders]
    width = len(program.cost)
    quadratic = sparse.csc_matrix((width, width))
    try:
        run = clarabel.DefaultSolver(quadratic, program.cost, -rows.slopes, rows.constant, cones, settings)
        found = run.solve()
    except BaseException as error:  # a panic of the Rust side is no Exception
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        return ConicSolution.none(f"Clarabel failed: {error}")
    name = str(found.status)
    opinions = {
        "Solved": True,
        "AlmostSolved": True,
        "PrimalInfeasible": False,
        "AlmostPrimalInfeasible": False,
    }
    return judged(
        np.array(found.x),
        objective=float(found.obj_val),
        bound=float(found.obj_val_dual),
        feasible=opinions.get(name),
        status=f"Clarabel: {_words(name)}",
    )


def judged(values: Array, **rest: Any) -> ConicSolution:
    """The solution; values that are not finite are none."""
    return ConicSolution(values=values if np.isfinite(values).all() else None, **rest)


def _words(name: str) -> str:
    """AlmostSolved -> almost solved."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()


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
    constraints = [_constraint(part, y) for part in parts]
    task = cvxpy.Problem(cvxpy.Minimize(program.cost @ y), constraints)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the status says the same
            task.solve(solver=name, **_settings(name, tolerance, iterations))
    except Exception as error:  # a solver from outside may fail in any way
        what = " ".join(str(error).split())[:120] or type(error).__name__
        return ConicSolution.none(f"{name} through cvxpy failed: {what}")
    return _answer(task, y, name, _bound(parts, constraints), tolerance)


def _parts(program: ConicProgram) -> Iterator[Affine]:
    """Every matrix with all its entries, row by row."""
    for block in program.semidefinite:
        slopes, start = sparse.csr_array(block.entries.slopes), 0
        for order in block.orders:
            rows = start + _places(order)
            yield Affine(constant=block.entries.constant[rows], slopes=slopes[rows])
            start += order * (order + 1) // 2


def _places(order: int) -> Any:
    """Where entry (i, j) of a symmetric matrix stands in its upper triangle, (order^2,), row by row."""
    i, j = triangle(order)
    places = np.zeros((order, order), dtype=np.intp)
    places[i, j] = places[j, i] = np.arange(len(i))
    return places.ravel()


def _constraint(part: Affine, y: Any) -> Any:
    order = round(np.sqrt(len(part.constant)))
    return _cvxpy().reshape(part.slopes @ y + part.constant, (order, order), order="C") >> 0


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


def _bound(parts: list[Affine], constraints: list[Any]) -> float | None:
    """The dual's value: of the Lagrangian, what does not depend on y. None without multipliers."""
    total = 0.0
    for part, constraint in zip(parts, constraints, strict=True):
        if constraint.dual_value is None:
            return None
        total -= float(part.constant @ np.ravel(np.asarray(constraint.dual_value, dtype=float)))
    return total


def _answer(task: Any, y: Any, name: str, bound: float | None, tolerance: float) -> ConicSolution:
    cvxpy = _cvxpy()
    status = str(task.status)
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
        status=f"{name} through cvxpy: {status.replace('_', ' ')}",
    )

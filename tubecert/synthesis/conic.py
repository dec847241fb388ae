"""Semidefinite programs, straight to a conic solver.

Minimise c'y subject to S_0 + sum_k y_k S_k >= 0 for every block, g_0 + G y >= 0 and e_0 + E y = 0. All slopes are
sparse and nothing is canonicalised, so that the wall time is the solver's own. Clarabel runs on one thread with fixed
settings; SCS, for cross-checks, and every other solver are reached through cvxpy (`bridge`).
Untrusted: what comes back is a proposal with an opinion, never a verdict.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

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
    """Minimise cost'y (N,) subject to `semidefinite` blocks, `inequalities` >= 0 and `equalities` = 0."""

    cost: Array
    semidefinite: Sequence[Semidefinite] = ()
    inequalities: Affine | None = None
    equalities: Affine | None = None

    @property
    def orders(self) -> list[int]:
        """Orders of all semidefinite matrices."""
        return [order for block in self.semidefinite for order in block.orders]


@dataclass(frozen=True, slots=True, kw_only=True)
class ConicSolution:
    """`values` y (N,), also of an unfinished run, None if there are none; `bound` is the dual's value of the objective.

    `feasible`: the solver's opinion, None if it came to none; `finished`: it met its tolerances; `status`: its words.
    """

    values: Array | None
    objective: float
    bound: float
    feasible: bool | None
    finished: bool
    status: str
    iterations: int
    seconds: float

    @classmethod
    def none(cls, status: str) -> ConicSolution:
        """No solution, and why."""
        return cls(
            values=None,
            objective=np.inf,
            bound=-np.inf,
            feasible=None,
            finished=False,
            status=status,
            iterations=0,
            seconds=0.0,
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
        from tubecert.synthesis.bridge import solve_through_cvxpy

        name = "SCS" if solver == "scs" else solver.removeprefix(CVXPY)
        return solve_through_cvxpy(program, name, tolerance, iterations)
    return _clarabel(program, lifted, tolerance, iterations or 200)


def _stacked(program: ConicProgram) -> Affine:
    """All rows as one: equalities, inequalities, blocks with off-diagonal entries times sqrt 2."""
    parts = [part for part in (program.equalities, program.inequalities) if part is not None]
    scale = np.concatenate([np.ones(sum(map(_rows, parts))), *map(_scale, program.orders)])
    parts += [block.entries for block in program.semidefinite]
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


def _rows(part: Affine | None) -> int:
    return 0 if part is None else len(part.constant)


def _clarabel(program: ConicProgram, rows: Affine, tolerance: float, iterations: int) -> ConicSolution:
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.direct_solve_method = "faer"
    settings.chordal_decomposition_enable = False
    settings.max_iter = iterations
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = tolerance
    cones: list[Any] = []
    if _rows(program.equalities):
        cones.append(clarabel.ZeroConeT(_rows(program.equalities)))
    if _rows(program.inequalities):
        cones.append(clarabel.NonnegativeConeT(_rows(program.inequalities)))
    cones += [clarabel.PSDTriangleConeT(order) for order in program.orders]
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
        finished=name in ("Solved", "PrimalInfeasible"),
        status=f"Clarabel: {_words(name)}",
        iterations=int(found.iterations),
        seconds=float(found.solve_time),
    )


def judged(values: Array, **rest: Any) -> ConicSolution:
    """The solution; values that are not finite are none."""
    return ConicSolution(values=values if np.isfinite(values).all() else None, **rest)


def _words(name: str) -> str:
    """AlmostSolved -> almost solved."""
    return "".join(f" {letter.lower()}" if letter.isupper() else letter for letter in name).strip()

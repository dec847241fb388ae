"""What cvxpy finds, with the accuracy at which its solver says it has finished: an oracle for tests of synthesis.

How far an interior-point method comes depends on the last digits of its data, so on the processor: where it stalls
before a tolerance, it is asked again for less.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from tubecert.synthesis.conic import Affine, Semidefinite, triangle

_TOLERANCES = (1e-7, 1e-6, 1e-5)


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimum:
    """The value of the objective (infinite if infeasible or unbounded) and the tolerance on gap and residuals."""

    value: float
    tolerance: float


def optimum(task: Any) -> Optimum | None:
    """The optimum to the best tolerance that Clarabel reaches, None if it reaches none; variables keep their values."""
    import cvxpy

    for tolerance in _TOLERANCES:
        settings = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), tolerance)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message="Solution may be inaccurate")  # so says the status, too
            try:
                task.solve(solver="CLARABEL", **settings)
            except cvxpy.SolverError:  # it stalled
                continue
        if task.status in (cvxpy.OPTIMAL, cvxpy.INFEASIBLE, cvxpy.UNBOUNDED):
            return Optimum(value=float(task.value), tolerance=tolerance)
    return None


def semidefinite(constant: Any, slopes: Any) -> Semidefinite:
    """A block from dense symmetric matrices: S_0 (n, n) and S_k as (N, n, n)."""
    s0, s = np.asarray(constant, dtype=float), np.asarray(slopes, dtype=float)
    i, j = triangle(len(s0))
    return Semidefinite(orders=(len(s0),), entries=Affine(constant=s0[i, j], slopes=s[:, i, j].T))

"""One batch of runs by itself."""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.engine import integrate as together
from tubecert.simulate.problem import Batch, Disturbance, LoopProblem
from tubecert.simulate.runs import Runs


def integrate(problem: LoopProblem, x0: Array, disturbance: Disturbance, *, tolerance: float) -> Runs:
    """N runs from x0 (N, n) under a disturbance of N lanes."""
    batch = Batch(problem=problem, x0=np.asarray(x0, dtype=float), disturbance=disturbance)
    return together([batch], tolerance=tolerance)[0]

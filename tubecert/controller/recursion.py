"""The controller of a certificate in numpy, sample by sample: for code that simulates or drives in Python."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from tubecert.enclosure.interval import Array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tubecert.controller.data import Data
    from tubecert.sampled_loop.record import Tables

Step: TypeAlias = Callable[[Array, Array, Array], Array]
"""Inputs (m, N) for measurements y (n, N), the plan's x* (n, N or 1) now and its u* (m, N or 1) when they act."""
_ON_TIME: Final = 1e-6  # of a sample time


def linear(tables: Tables, lanes: int = 1) -> Step:
    """The recursion of N lanes: delta = M zeta + N dy, zeta+ = F zeta + G dy (theory of the sampled loop, 1.4)."""
    zeta = np.zeros((tables.size, lanes))

    def step(y: Array, x: Array, u: Array) -> Array:
        delta = tables.M @ zeta + tables.N @ (y - x)
        zeta[...] = tables.F @ zeta + tables.G @ (y - x)
        return np.asarray(u + delta)

    return step


class SampledController:
    """The recursion of a certificate's tables in numpy: `u = controller(t, y)` once a sample, beginning with t = 0.

    What is exported in C computes the same, and also judges samples and clips inputs.
    """

    def __init__(self, data: Data) -> None:
        self.sample_time, self.samples, self._row = float(data.sample_time), 0, 0
        self._plan, self._step = data.plan, linear(data.tables)

    def __call__(
        self, t: float, y: ArrayLike, x: ArrayLike | None = None, u: ArrayLike | None = None
    ) -> Array:
        """The input (m,) for the state (n,) that is measured at t, in s; it acts after the delay, for a sample time.

        Of a family the plan comes with every sample: x* at t (n,), and u* (m,) as it is held while the input acts.
        Raises `ValueError` if t is not the time of the next sample, if y is no state, if a number is not
        finite, if a plan is missing, or is over.
        """
        plan = self._plan
        if abs(t / self.sample_time - self.samples) > _ON_TIME * (1 + self.samples):
            raise ValueError(f"the next sample is at t = {self.samples * self.sample_time} s")
        if plan.handed is (x is None or u is None):
            raise ValueError("x and u are given for a family of plans, and only there")
        if self._row >= plan.steps:
            raise ValueError("the plan is over, and nothing is proven for later")
        given = (x, u) if plan.handed else plan.at([self._row])
        planned, held = (np.ravel(np.asarray(each, float)) for each in given)
        measured = np.asarray(y, float)
        if measured.shape != planned.shape:
            raise ValueError(f"y has {measured.size} numbers, the state has {planned.size}")
        if not np.isfinite([*measured, *planned, *held]).all():  # all inputs from here on would be nan
            raise ValueError("a number of the sample is not finite")
        self.samples += 1
        self._row = self._row + 1 if self._row + 1 < plan.steps else plan.after
        return self._step(measured[:, None], planned[:, None], held[:, None])[:, 0]

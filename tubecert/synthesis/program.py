"""The conditions at finitely many points as a semidefinite program in the coefficients and kappa.

At the `low` points floor <= W, at the `high` ones W <= kappa I, at the `contraction` points
-N'(F_0 + 2 rate W)N >= 0. Fewer points
are fewer conditions: the least kappa is a bound from below for every member of the family, as far as the solver may be
trusted. The blocks of a point are made once and kept.
Untrusted. Implements: (CCM_1), (CCM_2) at points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from tubecert.enclosure.interval import Array
from tubecert.synthesis.conic import Affine, ConicProgram, ConicSolution, Semidefinite, solve
from tubecert.synthesis.forms import FormsTape, Unknowns, upper
from tubecert.synthesis.problem import Floor

_TOLERANCE, _ROUGH = 1e-7, 1e-5
_LEAST = 1e-4  # of kappa: keeps W definite where the floor is B B'
_SMALL = 0.01  # of the rate, for a W of mean eigenvalue kappa: of metrics alike, the smaller one


@dataclass(frozen=True, slots=True, kw_only=True)
class Points:
    """Points (N, n) and their rows on the unknowns, (N, s, U); `floor` (N, s): what W has to exceed there, or empty."""

    at: Array
    rows: Array
    floor: Array

    def kept(self, chosen: NDArray[np.bool_]) -> Points:
        """Those with a True in `chosen` (N,)."""
        return Points(at=self.at[chosen], rows=self.rows[chosen], floor=self.floor[chosen])

    def joined(self, other: Points) -> Points:
        """These and the others."""
        pairs = ((self.at, other.at), (self.rows, other.rows), (self.floor, other.floor))
        at, rows, floor = (np.concatenate(pair) for pair in pairs)
        return Points(at=at, rows=rows, floor=floor)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointProgram:
    """The conditions at `low` and `high` points (C1) and `contraction` points (C2); `rate` in the unit of the rows."""

    unknowns: Unknowns
    low: Points
    high: Points
    contraction: Points
    floor: Floor
    rate: float
    solver: str

    def least_kappa(self) -> ConicSolution:
        """Minimise kappa; the unknowns come first, kappa last."""
        width = self.unknowns.count
        cost = np.zeros(width + 1)
        cost[-1] = 1.0
        blocks = [*self._between(0.0, None), *self._contracting(None)]
        return solve(ConicProgram(cost=cost, semidefinite=blocks), self.solver, tolerance=_TOLERANCE)

    def central(self, kappa: float, slack: float, reference: Array) -> ConicSolution:
        """With kappa given, the greatest extra rate mu (the last unknown), W kept inside by a relative `slack`.

        -N'(F_0 + 2 rate W)N >= 2 mu N'W_r N with W_r given by `reference`, the unknowns found before (U,); mu is in the
        unit of the rows. Under the floor B B' parts of W may be anything between the floor and kappa I; so that no last
        digit of a solver decides, a little is paid for the trace of W.
        """
        cost = np.zeros(self.unknowns.count + 1)
        cost[-1] = -1.0
        if self.floor == "input":
            diagonal = upper(np.eye(self.unknowns.mask.shape[1])) > 0
            trace = self.low.rows[:, diagonal].sum(axis=1).mean(axis=0)
            cost[:-1] = _SMALL * self.rate / (kappa * diagonal.sum()) * trace
        blocks = [*self._between(slack, kappa), *self._contracting(reference)]
        return solve(ConicProgram(cost=cost, semidefinite=blocks), self.solver, tolerance=_ROUGH)

    @property
    def size(self) -> int:
        """The number of conditions."""
        return len(self.low.at) + len(self.high.at) + len(self.contraction.at)

    def _between(self, slack: float, kappa: float | None) -> list[Semidefinite]:
        """W - floor >= 0 at the low, kappa I - W >= 0 at the high points; kappa may be the last unknown."""
        n = self.unknowns.mask.shape[1]
        eye = upper(np.eye(n))
        unknown, known = (eye, 0.0 * eye) if kappa is None else (0.0 * eye, kappa * eye)
        blocks = [_block(n, (1 - slack) * known, -rows, unknown) for rows in self.high.rows]
        for rows, floor in zip(self.low.rows, self.low.floor, strict=True):
            blocks.append(_block(n, -(1 + slack) * floor, rows, 0.0 * eye))
            if self.floor == "input":
                blocks.append(_block(n, -_LEAST * known, rows, -_LEAST * unknown))
        return blocks

    def _contracting(self, reference: Array | None) -> list[Semidefinite]:
        """The C2 blocks; with a reference, less 2 mu N'W_r N."""
        blocks: list[Semidefinite] = []
        if not self.contraction.rows.shape[1]:
            return blocks  # as many inputs as states: C2 is void
        for rows, weight in zip(self.contraction.rows, self.contraction.floor, strict=True):
            order = round((np.sqrt(8 * len(rows) + 1) - 1) / 2)
            last = np.zeros(len(rows)) if reference is None else -2 * weight.reshape(rows.shape) @ reference
            blocks.append(_block(order, np.zeros(len(rows)), rows, last))
        return blocks


def _block(order: int, constant: Array, rows: Array, last: Array) -> Semidefinite:
    slopes = np.concatenate([rows, last[:, None]], axis=1)
    return Semidefinite(orders=(order,), entries=Affine(constant=constant, slopes=sparse.csr_array(slopes)))


def metric_points(forms: FormsTape, unknowns: Unknowns, at: Array, floor: Floor) -> Points:
    """Points for C1."""
    here = forms(at)
    n = at.shape[1]
    below = here.input if floor == "input" else np.broadcast_to(np.eye(n), (len(at), n, n))
    return Points(at=at, rows=here.metric_rows(unknowns), floor=upper(below))


def contraction_points(forms: FormsTape, unknowns: Unknowns, at: Array, rate: float) -> Points:
    """Points for C2; `floor` holds the rows of N'W N."""
    here = forms(at)
    weight = here.projected_rows(unknowns)
    floor = weight.reshape(len(at), weight.shape[1] * weight.shape[2])
    return Points(at=at, rows=here.contraction_rows(unknowns, rate), floor=floor)


def finite(points: Points) -> Points:
    """Without those at which something is not finite."""
    known = np.isfinite(points.rows).all(axis=(1, 2)) & np.isfinite(points.floor).all(axis=1)
    return points.kept(np.asarray(known))

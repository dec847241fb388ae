"""A plan through knots: a few expressions for all pieces, and the domain that knows each piece's coefficients.

The expressions depend on the time tau within a piece and on the piece's coefficients, which are variables as well. One
tape so serves all pieces at once, and a supremum along the plan is a search over (piece, tau).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.domain import Domain
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.objective import Estimate
from tubecert.expression import Expression, constant, symbol
from tubecert.expression.matrix import Matrix
from tubecert.model import TIME, ControlAffineModel
from tubecert.spec import Knots
from tubecert.trajectory.hermite import Pieces, pieces
from tubecert.trajectory.plan import PIECE, Plan, missing

TAU = "tau#"  # no state can have this name
SINCE = "since#"  # when a piece begins


@dataclass(frozen=True)
class PiecewisePlan(Plan):
    """Cubic Hermite pieces for x*, held, linear or quadratic u*; `data` is exact, `pieces` encloses what follows."""

    data: Knots
    pieces: Pieces

    @cached_property
    def start(self) -> tuple[Expression, ...]:
        """The first knot."""
        return tuple(map(constant, self.data.x[0]))

    @cached_property
    def slope(self) -> tuple[Expression, ...]:
        """x*' in tau and the coefficients."""
        tau = symbol(TAU)
        return tuple(
            _coefficient("x", i, 1) + tau * (2 * _coefficient("x", i, 2) + 3 * tau * _coefficient("x", i, 3))
            for i in range(len(self.x))
        )

    @cached_property
    def domain(self) -> Domain:
        """Every piece with its coefficients, and tau in it."""
        data = {
            name: getattr(self.pieces, kind)[:, i, k] for name, (kind, i, k) in _columns(self.pieces).items()
        }
        data[SINCE] = self.pieces.start
        return PieceDomain(data, self.pieces.length)

    @cached_property
    def fixed(self) -> frozenset[str]:
        """The coefficients, and when a piece begins."""
        return frozenset((*_columns(self.pieces), SINCE))

    @property
    def defined(self) -> bool:
        """Whether f and B are defined at every knot: without them there are no slopes."""
        return bool(self.pieces.defined.all())

    @property
    def knots(self) -> Knots:
        """The exact knots."""
        return self.data

    def moment(self, at: Mapping[str, float]) -> float | None:
        """The time at a point of the domain."""
        if TIME in at or PIECE not in at:
            return super().moment(at)
        piece = round(at[PIECE])
        t = float(self.pieces.start.mid[piece]) + at.get(TAU, 0.0)
        return min(t, float(self.pieces.end.mid[piece]))

    @property
    def spans(self) -> Interval | None:
        """The pieces, if u* is held on each of them."""
        return (
            Interval(self.pieces.start.lo, self.pieces.end.hi) if self.data.interpolation == "hold" else None
        )

    def enclose(self, lo: Array, hi: Array, span: Array | None = None) -> tuple[Interval, Interval]:
        """x* (N, n) and u* (N, m) over windows [lo, hi] of time, each of shape (N,)."""
        with np.errstate(all="ignore"):  # what is not finite is unbounded
            both = self.pieces.over(lo, hi, None if span is None else np.rint(span).astype(np.intp))
        n = len(self.x)
        return both[:, :n], both[:, n:]

    @property
    def clock(self) -> Expression:
        """The time t, in the variables of the plan."""
        return symbol(SINCE) + symbol(TAU)

    def defect(self, model: ControlAffineModel) -> Matrix:
        """p in tau and the coefficients, (n, 1)."""
        return missing(self, model)


def piecewise_plan(model: ControlAffineModel, knots: Knots, horizon: Fraction | None = None) -> PiecewisePlan:
    """The plan through the knots over [0, horizon], by default up to the last knot."""
    tau = symbol(TAU)
    x = []
    for i in range(len(model.states)):
        a = [_coefficient("x", i, k) for k in range(4)]
        x.append(a[0] + tau * (a[1] + tau * (a[2] + tau * a[3])))
    u = [_coefficient("u", j, 0) for j in range(len(model.inputs))]
    if knots.interpolation == "linear":
        u = [e + tau * _coefficient("u", j, 1) for j, e in enumerate(u)]
    elif knots.interpolation == "hermite-simpson":
        u = [e + tau * (_coefficient("u", j, 1) + tau * _coefficient("u", j, 2)) for j, e in enumerate(u)]
    end = knots.t[-1] if horizon is None else horizon
    with np.errstate(all="ignore"):
        return PiecewisePlan(tuple(x), tuple(u), end, knots, pieces(model, knots, end))


def _coefficient(kind: str, index: int, power: int) -> Expression:
    return symbol(f"{kind}{index}#{power}")


def _columns(found: Pieces) -> dict[str, tuple[str, int, int]]:
    """Every coefficient's name, and where it stands in the pieces."""
    shapes = (("x", found.x.shape), ("u", found.u.shape))
    return {
        f"{kind}{i}#{k}": (kind, i, k)
        for kind, (_, rows, most) in shapes
        for i in range(rows)
        for k in range(most)
    }


class PieceDomain:
    """All (piece, tau): the coefficients of a piece are thin ranges that belong together; only tau is ever split."""

    def __init__(self, data: Mapping[str, Interval], length: Interval) -> None:
        self._data, self._length = data, length

    def variables(self, needed: tuple[str, ...]) -> tuple[str, ...]:
        """The number of the piece, beside what is needed."""
        return (*needed, PIECE) if needed else ()

    def boxes(self, variables: tuple[str, ...]) -> tuple[Array, Array]:
        """One box for each piece."""
        if not variables:
            return np.zeros((1, 0)), np.zeros((1, 0))
        return self._rows(variables, np.arange(len(self._length.lo)))

    def contract(
        self, variables: tuple[str, ...], lo: Array, hi: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Boxes never leave their piece: nothing to do."""
        return lo, hi, np.ones(len(lo), dtype=bool)

    def inside(self, variables: tuple[str, ...], points: Array) -> tuple[Array, Array]:
        """The points with the whole ranges of their piece's coefficients, tau moved into the piece."""
        if not variables:
            return points, points
        piece = np.rint(points[:, variables.index(PIECE)]).astype(np.intp)
        lo, hi = self._rows(variables, piece)
        if TAU in variables:
            column = variables.index(TAU)
            lo[:, column] = hi[:, column] = np.clip(points[:, column], 0.0, self._length.lo[piece])
        return lo, hi

    def priorities(self, variables: tuple[str, ...], lo: Array, hi: Array, estimate: Estimate) -> Array:
        """Split tau, where it causes an overestimate."""
        priority = np.zeros(lo.shape)
        if TAU in variables:
            column = variables.index(TAU)
            priority[:, column] = np.where(hi[:, column] > lo[:, column], estimate.caused[:, column], 0.0)
        return priority

    def _rows(self, variables: tuple[str, ...], piece: NDArray[np.intp]) -> tuple[Array, Array]:
        lo, hi = np.zeros((len(piece), len(variables))), np.zeros((len(piece), len(variables)))
        for column, name in enumerate(variables):
            if name == PIECE:
                lo[:, column] = hi[:, column] = piece
            elif name == TAU:
                hi[:, column] = self._length.hi[piece]
            else:
                lo[:, column], hi[:, column] = self._data[name].lo[piece], self._data[name].hi[piece]
        return lo, hi

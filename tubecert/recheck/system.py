"""The exact terms of a system, and its plan as a curve, made of a specification that was read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from itertools import pairwise

from tubecert.recheck.balls import Ball
from tubecert.recheck.cover import Range as CoverRange
from tubecert.recheck.curve import Curve, Knots, everyone, expressed, hermite
from tubecert.recheck.document import wrong
from tubecert.recheck.grammar import Owed
from tubecert.recheck.plans import Plan
from tubecert.recheck.specification import Specification
from tubecert.recheck.specified.loop import Disturbance
from tubecert.recheck.specified.numbers import TIME, Numbers, Range, upright
from tubecert.recheck.specified.plant import Metric, Uncertainty
from tubecert.recheck.specified.trajectory import AnyPlan, Expressed, Resting, Trajectory
from tubecert.recheck.terms import (
    Matrix,
    Term,
    all_zero,
    matrix_slopes,
    number,
    plus,
    scaled,
    times,
    turned,
    variable,
)
from tubecert.recheck.times import period_of, time_range


@dataclass(frozen=True)
class System:
    """x' = f + B (u + h) with dual metric W at a rate, a plan, and the options of the loop; all exact."""

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    f: Matrix  # (n, 1)
    B: Matrix
    W: Matrix
    rate: Fraction
    uncertainty: Uncertainty
    safe_set: dict[str, Range]
    x0: Numbers | None
    within: Fraction | None
    box: dict[str, Range] | None
    predictor_gain: Fraction | None  # None: auto
    smooth: Fraction | None
    horizon: Fraction | None
    duties: tuple[Owed, ...]  # of f, B, W and E, on the safe set
    wind: Disturbance | None = None
    ranges: dict[str, Range] = field(default_factory=dict)  # of parameters of the plant's drift,
    unknown: Matrix | None = None  # which is this, (n, 1), in place of f
    moving: tuple[Term, ...] = ()  # f and what it owes, if t occurs in them
    lengths: dict[str, Numbers] = field(default_factory=dict)  # what has a half-width, each as a row times x

    @property
    def varies(self) -> bool:
        """Whether t occurs in f, or in what f owes."""
        return bool(self.moving)

    @property
    def time(self) -> CoverRange | None:
        """The times of f; None where it is free of t. Raises `ValueError` like `times`."""
        return self.times if self.varies else None

    @property
    def times(self) -> CoverRange | None:
        """The times that matter for f and h; raises `ValueError` if there are no such bounds."""
        return time_range(self.uncertainty, self.horizon, self.moving)

    @property
    def period(self) -> Ball | None:
        """One period of f and h, where f depends on t and there is no horizon."""
        if not self.varies or self.horizon is not None:
            return None
        return period_of(self.uncertainty, self.moving).ball

    @property
    def h(self) -> Matrix | None:
        """The uncertainty as expressions, (m, 1)."""
        return None if self.uncertainty.h is None else upright(self.uncertainty.h)

    @property
    def declared(self) -> dict[str, Fraction]:
        """Bounds of h, h_x, h_t that the specification declares."""
        return self.uncertainty.declared

    @cached_property
    def f_x(self) -> Matrix:
        """df/dx, (n, n)."""
        columns = [[row[0] for row in matrix_slopes(self.f, name)] for name in self.states]
        return turned(columns)

    def squared(self, row: Sequence[Fraction]) -> Term:
        """c'W c, which (c'v)^2 is at most for every v of metric length 1."""
        found = number(0)
        for i, left in enumerate(row):
            for j, right in enumerate(row):
                if left and right:
                    found = found + number(left * right) * self.W[i][j]
        return found

    @cached_property
    def W_x(self) -> list[Matrix]:
        """dW/dx_i for every state."""
        return [matrix_slopes(self.W, name) for name in self.states]

    @cached_property
    def BBt(self) -> Matrix:
        """B B'."""
        return times(self.B, turned(self.B))

    @cached_property
    def drift(self) -> Matrix:
        """f + B u in the states and inputs, (n, 1)."""
        return plus(self.f, times(self.B, [[variable(name)] for name in self.inputs]))

    @cached_property
    def contraction(self) -> Matrix:
        """-d_f W + f_x W + W f_x', (n, n)."""
        moved = along(self.W_x, self.f)
        product = times(self.f_x, self.W)
        return plus(plus(product, turned(product)), moved, -1)

    @cached_property
    def F(self) -> Matrix:
        """The same plus 2 rate W."""
        return plus(self.contraction, self.W, 2 * self.rate)

    @property
    def flat(self) -> bool:
        """Whether the metric is constant."""
        return all(all_zero(slope) for slope in self.W_x)


def along(slopes_by_state: list[Matrix], direction: Matrix) -> Matrix:
    """sum_i v_i dW/dx_i for a column v."""
    total = scaled(0, slopes_by_state[0])
    for slope, (v,) in zip(slopes_by_state, direction, strict=True):
        total = plus(total, [[v * e for e in row] for row in slope])
    return total


def system_of(spec: Specification) -> System:
    """The system of a specification with a metric."""
    metric, loop, wind = spec.metric, spec.loop, spec.disturbance
    assert isinstance(metric, Metric), "a certificate without a metric has no system to examine"
    return System(
        states=spec.plant.states,
        inputs=spec.plant.inputs,
        f=upright(spec.plant.f),
        B=spec.plant.B,
        W=metric.dual,
        rate=metric.rate,
        uncertainty=spec.uncertainty,
        safe_set=spec.plant.safe_set,
        x0=spec.start.at,
        within=spec.start.within,
        box=spec.start.box,
        predictor_gain=loop.predictor_gain,
        smooth=loop.smooth,
        horizon=spec.trajectory.horizon,
        duties=(*spec.plant.duties, *metric.duties, *(() if wind is None else wind.duties)),
        wind=wind,
        ranges=spec.plant.ranges,
        unknown=None if spec.plant.unknown is None else upright(spec.plant.unknown),
        moving=spec.plant.moving,
        lengths=spec.plant.lengths,
    )


def curve_of(
    trajectory: Trajectory,
    plan: Plan,
    states: Sequence[str],
    inputs: Sequence[str],
    drift: Sequence[Term],
    *,
    times: CoverRange | None = None,
    period: Ball | None = None,
) -> Curve:
    """The plan: expressions of the specification, or the knots that the certificate holds, with f + B u as `drift`.

    `times` and `period`: of f, where it depends on t.
    """
    if isinstance(trajectory, AnyPlan):
        return everyone(trajectory, states, inputs, times)
    if isinstance(trajectory, Resting):
        at, input_ = ([number(q) for q in own] for own in (trajectory.at, trajectory.input))
        return expressed(at, input_, TIME, trajectory.horizon, period)
    if isinstance(trajectory, Expressed):
        return expressed(trajectory.x, trajectory.u, TIME, trajectory.horizon)
    knots = knots_of(plan, trajectory.between, trajectory.horizon)
    return hermite(knots, drift, states, inputs, trajectory.horizon)


def knots_of(plan: Plan, between: str, horizon: Fraction) -> Knots:
    """Knots that span the horizon, in order, filled as the specification says."""
    path, knots = "certificate.result.plan", plan.knots
    if knots is None:
        raise wrong("TC603", f"{path} lacks its knots", "write the certificate again")
    t = knots.t
    if len(t) < 2 or t[0] != 0 or any(b <= a for a, b in pairwise(t)):
        raise wrong("TC603", f"{path}.knots.t must begin at 0 and increase")
    if t[-1] < horizon:
        raise wrong("TC603", f"{path}.knots.t ends before the horizon")
    if plan.interpolation != between:
        raise wrong("TC603", f"{path}.interpolation is not that of the specification")
    if between != "hermite-simpson":
        return replace(knots, held=between == "hold")
    if len(t) % 2 == 0:
        raise wrong(
            "TC603", f"{path}.knots must begin and end with a knot, points between knots in turn with them"
        )
    inner = tuple(zip(t[1::2], knots.u[1::2], strict=True))
    return Knots(t=t[::2], x=knots.x[::2], u=knots.u[::2], held=False, inner=inner)

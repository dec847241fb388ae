"""What is simulated: plan, times, starts, what a certificate proves; and a loop with what is promised about it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.bounds.wind import Beside
from tubecert.certificate.result import Result
from tubecert.coordinates import Coordinates, Fields
from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.expression import Expression
from tubecert.expression.matrix import Matrix, column, combine, multiply
from tubecert.findings import Finding
from tubecert.model import ControlAffineModel, build
from tubecert.simulate.certified import Certified, certified_plan, read_numbers
from tubecert.simulate.loops import Controller
from tubecert.simulate.problem import LoopProblem
from tubecert.simulate.promise import Promise
from tubecert.simulate.uncertainty import Class, Sources, class_of
from tubecert.spec import Spec
from tubecert.trajectory import Plan

TIMES: Final = 501  # output times of the loops that are drawn
_LAYER: Final = 0.25  # of what |B'M gamma_s| can reach in the tube, for adversaries that push
_TOLERANCE_IF_DEAR: Final = 5e-3  # half of what would be no result
_TOLERANCE: Final = 1e-3  # of the tube's least radius, asked of the integrator


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A closed loop: the problem, where its gains come from, and the promise about it, if there is one."""

    problem: LoopProblem
    origin: str
    promise: Promise | None

    def along(self, plan: Plan) -> Loop:
        """The same around another plan."""
        return replace(self, problem=replace(self.problem, plan=plan))

    @property
    def controller(self) -> Controller:
        """Its controller."""
        return self.problem.controller

    @property
    def tested(self) -> bool:
        """Whether leaving the tube counts: it estimates h, so it is meant to stay."""
        return self.problem.terms.predicts


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting:
    """Everything that the loops share: `x0` (n,), `centre` = x*(0), radius `within` of allowed starts, or 0.

    `spread` (n,): how far from x0 they may be, state by state. `E` (n, k) is that of the wind. `uncertainty` is the
    class of what may act. `dear`: every run takes so many steps that they are attacked with runs that are less
    accurate, and with fewer.
    """

    spec: Spec
    certified: Certified
    model: ControlAffineModel
    plan: Plan
    horizon: float
    times: Array
    x0: Array
    centre: Array
    within: float
    spread: Array
    uncertainty: Class
    E: Matrix
    rest: Matrix
    h: tuple[Expression, ...] | None
    layer: float
    dear: bool = False

    @property
    def varied(self) -> bool:
        """Whether there is more than one start."""
        return self.within > 0 or bool(self.spread.any())

    def started(self, direction: Array, radius: float = 1.0) -> Array:
        """The start (n,) in a direction: at a part of the radius of the ball, or in the box (|direction_i| <= 1)."""
        if self.within:
            length = float(np.linalg.norm(direction)) or 1.0
            return np.asarray(self.centre + self.within * radius * direction / length)
        return np.asarray(self.x0 + self.spread * direction)

    def along(self, plan: Plan) -> Setting:
        """The same around another plan of the family that is certified; the state starts on it, or `within` of it."""
        start = _start_of(plan)
        return replace(self, plan=plan, x0=start, centre=start)

    @property
    def rho(self) -> float:
        """The radius of the tube, in z."""
        return self.certified.rho

    @property
    def S(self) -> Array:
        """The coordinates z = S x of the tube, (n, n)."""
        return self.certified.S

    @property
    def greatest_radius(self) -> float:
        """|x - x*| is at most this where |S (x - x*)| <= rho."""
        return self.rho * float(np.linalg.norm(np.linalg.inv(self.S), 2))

    @property
    def reach(self) -> float:
        """dbar = sqrt(a) rho."""
        return self.certified.reach

    @property
    def tolerance(self) -> float:
        """The error of |S x| that the integrator is asked for."""
        return (_TOLERANCE_IF_DEAR if self.dear else _TOLERANCE) * self.rho

    @property
    def half_widths(self) -> Array:
        """Bounds of |x_i - x_i*| in the tube, (n,)."""
        return np.array(self.certified.half_widths)


def setting_of(
    spec: Spec, result: Result, duration: Fraction | None = None, plan: Plan | None = None
) -> Setting:
    """The setting of a specification and its certification, which has a tube; `plan` is one of a family."""
    model = build(spec)
    single = certified_plan(spec, model, result) if plan is None else plan
    horizon = horizon_of(spec, duration)
    certified = read_numbers(result)
    wanted = spec.simulation.h if spec.simulation and spec.simulation.h else spec.uncertainty.h
    centre = _start_of(single)
    n, m = len(spec.states), len(spec.inputs)
    return Setting(
        spec=spec,
        certified=certified,
        model=model,
        plan=single,
        horizon=horizon,
        times=np.linspace(0.0, horizon, TIMES),
        x0=centre if plan is not None else np.array([float(value) for value in spec.x0]),
        centre=centre,
        within=0.0 if spec.within is None else float(spec.within),
        spread=np.array([float(high - low) / 2 for low, high in spec.start_box] or [0.0] * len(spec.x0)),
        uncertainty=class_of(certified, n, m, _beside(certified, model)),
        E=_wind(model, result),
        rest=_rest(model, result),
        h=None if wanted is None else tuple(term.expression for term in wanted),
        layer=_LAYER * certified["metric_input_gain"] * certified.reach,
    )


def _beside(certified: Certified, model: ControlAffineModel) -> Sources | None:
    """What acts beside h; None if nothing does."""
    if not model.E and not model.parameters:
        return None
    return Sources(
        pace=certified.rate,
        k=len(model.E[0]) if model.E else 0,
        wind=float(model.wind_bound or 0),
        ranges=_ranges(model),
    )


def _ranges(model: ControlAffineModel) -> Array:
    """Those of the parameters, (p, 2)."""
    return np.array([[float(low), float(high)] for _, (low, high) in model.parameters]).reshape(-1, 2)


def _rest(model: ControlAffineModel, result: Result) -> Matrix:
    """What unknown parameters do that no input can; the rest of it is a part of h, as large as the class allows."""
    if not model.drift:
        return ()
    matched = column(Beside(_fields(model, result)).known)
    unknown = combine(1, column(model.drift), -1, column(model.f))
    return combine(1, unknown, -1, multiply(model.B, matched))


def _fields(model: ControlAffineModel, result: Result) -> Fields:
    """The model in the coordinates of the tube."""
    rows = None if result.tube is None else result.tube.coordinates
    S = None if rows is None else Coordinates(tuple(tuple(Fraction(q) for q in row) for row in rows))
    return Fields(model, S)


def _wind(model: ControlAffineModel, result: Result) -> Matrix:
    """E, or where w has a rate (I - B B^+) E: the rest of it is a part of h, which is as large as the class allows."""
    if model.wind_rate is None:
        return model.E
    fields = _fields(model, result)
    reached = multiply(fields.B_pinv, fields.of_vector(model.E))
    return combine(1, model.E, -1, multiply(model.B, reached))


def _start_of(plan: Plan) -> Array:
    """x*(0), (n,)."""
    return Tape(plan.start, ()).run_floats([], ())


def horizon_of(spec: Spec, duration: Fraction | None) -> float:
    """The duration asked for; else the plan's horizon; else ten time constants of the metric."""
    wanted = duration or (spec.simulation.duration if spec.simulation else None) or spec.trajectory.horizon
    if wanted is None:
        assert spec.metric is not None
        wanted = 10 / spec.metric.rate
    if spec.trajectory.horizon is not None and wanted > spec.trajectory.horizon:
        message = f"the plan ends at {near(spec.trajectory.horizon)} s, before {near(wanted)} s"
        raise TubecertError([Finding(code="TC704", message=message, help="ask for a shorter duration")])
    return float(wanted)

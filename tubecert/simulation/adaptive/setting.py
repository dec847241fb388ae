"""What is simulated: plan, times, starts, what a certificate proves; loops, their gains, and what they promise."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
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
from tubecert.kinds import DISTANCE, name_of
from tubecert.model import ControlAffineModel, build
from tubecert.records import to_json
from tubecert.simulation.adaptive.loops import Controller, LoopGains, LoopProblem
from tubecert.simulation.adaptive.reading import Certified, Promise, certified_plan, promise
from tubecert.simulation.adaptive.times import output_times
from tubecert.simulation.adaptive.uncertainty import Class, class_of
from tubecert.spec import Spec
from tubecert.trajectory import Plan

CHOSEN: Final = "chosen, not certified"
_TOLERANCE: Final = 1e-3  # of the tube's least radius, asked of the integrator
_LIMIT: Final = 100  # of the greatest radius: what is further away from the plan is not followed any more
_DEGREE: Final = 5  # of the polynomials that geodesics are
_EVEN, _EVEN_DEGREE = 1.01, 3  # where M varies by a factor of less over the tube, cubic ones are as near


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting(Certified):
    """Everything that the loops share, beside what is certified.

    `x0` (n,), `centre` = x*(0), radius `within` of allowed starts, or 0; `spread` (n,): how far from x0 they may be,
    state by state. `E` (n, k) is that of the wind, `rest` (n, 1) what unknown parameters do that no input can.
    `uncertainty` is the class of what may act.
    """

    spec: Spec
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

    @property
    def varied(self) -> bool:
        """Whether there is more than one start."""
        return self.within > 0 or bool(self.spread.any())

    def started(self, direction: Array, radius: Array | float = 1.0) -> Array:
        """Starts (n, N) in directions: at parts (N,) of the ball's radius, or in the box (|direction_i| <= 1)."""
        if self.within:
            length = np.linalg.norm(direction, axis=0)
            away = self.within * radius * direction / np.where(length > 0, length, 1.0)
            return np.asarray(self.centre[:, None] + away)
        return np.asarray(self.x0[:, None] + self.spread[:, None] * direction)

    def along(self, plan: Plan) -> Setting:
        """The same around another plan of the family that is certified; the state starts on it, or `within` of it."""
        start = _start_of(plan)
        return replace(self, plan=plan, x0=start, centre=start)

    @property
    def greatest_radius(self) -> float:
        """|x - x*| is at most this where |S (x - x*)| <= rho."""
        return self.rho * float(np.linalg.norm(np.linalg.inv(self.S), 2))

    @property
    def limit(self) -> float:
        """Where |x - x*| is more than this a run is not followed any more."""
        return _LIMIT * self.greatest_radius

    @property
    def tolerance(self) -> float:
        """The error of |S x| that the integrator is asked for."""
        return _TOLERANCE * self.rho

    @property
    def box(self) -> Array:
        """Bounds of |x_i - x_i*| in the tube, (n,)."""
        return np.array([self.half_widths[name] for name in self.spec.states])


def setting_of(
    spec: Spec, result: Result, duration: Fraction | None = None, plan: Plan | None = None
) -> Setting:
    """The setting of a specification and its certification, which has a tube; `plan` is one of a family.

    Raises `TubecertError` where the certificate lacks what is needed, or the plan is too short.
    """
    model, certified = build(spec), Certified.of(result)
    single = certified_plan(spec, model, result) if plan is None else plan
    horizon = horizon_of(spec, duration)
    wanted = spec.simulation.h if spec.simulation and spec.simulation.h else spec.uncertainty.h
    centre, field = _start_of(single), Fields(model, _coordinates(result))
    return Setting(
        **{item.name: getattr(certified, item.name) for item in fields(Certified)},
        spec=spec,
        model=model,
        plan=single,
        horizon=horizon,
        times=output_times(single, horizon),
        x0=centre if plan is not None else np.array([float(value) for value in spec.x0]),
        centre=centre,
        within=0.0 if spec.within is None else float(spec.within),
        spread=np.array([float(high - low) / 2 for low, high in spec.start_box] or [0.0] * len(spec.x0)),
        uncertainty=class_of(certified, model),
        E=_wind(model, field),
        rest=_rest(model, field),
        h=None if wanted is None else tuple(term.expression for term in wanted),
    )


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


def _start_of(plan: Plan) -> Array:
    """x*(0), (n,)."""
    return Tape(plan.start, ()).run_floats([], ())


def _coordinates(result: Result) -> Coordinates | None:
    rows = None if result.tube is None else result.tube.coordinates
    return None if rows is None else Coordinates(tuple(tuple(map(Fraction, row)) for row in rows))


def _rest(model: ControlAffineModel, fields: Fields) -> Matrix:
    """What unknown parameters do that no input can; the rest of it is a part of h, as large as the class allows."""
    if not model.drift:
        return ()
    unknown = combine(1, column(model.drift), -1, column(model.f))
    return combine(1, unknown, -1, multiply(model.B, column(Beside(fields).known)))


def _wind(model: ControlAffineModel, fields: Fields) -> Matrix:
    """E, or where w has a rate (I - B B^+) E: the rest of it is a part of h, which is as large as the class allows."""
    if model.wind_rate is None:
        return model.E
    reached = multiply(fields.B_pinv, fields.of_vector(model.E))
    return combine(1, model.E, -1, multiply(model.B, reached))


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the command line says about gains: the kind of certificate that has them, and what replaces its numbers."""

    source: str = DISTANCE.option
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop(LoopProblem):
    """A closed loop beside what its gains are, and the promise about it, if there is one."""

    gains_are: str
    promise: Promise | None

    @property
    def covered(self) -> bool:
        """Whether a certificate is about it."""
        return self.promise is not None

    @property
    def data(self) -> dict[str, object]:
        """What is told of it."""
        told = {"controller": self.controller, "gains_are": self.gains_are}
        gains = {} if self.gains is None else {"gains": to_json(self.gains)}
        return told | {"covered": self.covered, "tested": self.adapts} | gains


def loop_of(setting: Setting, controller: Controller, choice: Choice) -> Loop:
    """A loop with its gains; raises `TubecertError` if there are none for it."""
    if setting.model.gained:
        where = setting.spec.location("system.B")
        message = "parameters known by ranges stand in B, and the loops are stated for a known B"
        help = "give each of them one value: --set system.parameters.NAME=VALUE"
        raise TubecertError([Finding(code="TC705", message=message, location=where, help=help)])
    loop = Loop(
        model=setting.model,
        plan=setting.plan,
        controller=controller,
        horizon=setting.horizon,
        times=setting.times,
        limit=setting.limit,
        degree=_EVEN_DEGREE if _even(setting) else _DEGREE,
        P=setting.S.T @ setting.S,
        E=setting.E,
        rest=setting.rest,
        gains_are="no adaptation",
        promise=None,
    )
    if not loop.filters:
        return loop
    kind, (gains, covered) = name_of(choice.source), _gains(setting, loop, choice)
    return replace(
        loop,
        gains=gains,
        gains_are=f"certified by {kind}" if covered else CHOSEN,
        promise=promise(setting, kind) if covered and loop.adapts else None,
    )


def _even(own: Certified) -> bool:
    """Whether a S'S <= M <= A S'S with nearly the same a and A over the tube: geodesics hardly bend there."""
    return own.upper is not None and own.upper <= _EVEN * (own.reach / own.rho) ** 2


def _gains(setting: Setting, loop: Loop, choice: Choice) -> tuple[LoopGains, bool]:
    """The gains of a loop that filters, and whether they are those that a certificate proves."""
    adapts, kind = loop.adapts, name_of(choice.source)
    proven, smooth = setting.proven(kind), setting.spec.adaptation.smooth
    bandwidth = choice.bandwidth or (None if proven is None else proven.bandwidth)
    rate = choice.adaptation_rate or (None if proven is None else proven.adaptation_rate)
    if bandwidth is None or (adapts and rate is None):
        lacks = ("--bandwidth", bandwidth is None), ("--adaptation-rate", adapts and rate is None)
        options = " and ".join(option for option, missing in lacks if missing)
        message = f"{kind} certifies no gains for the controller {loop.controller}"
        help = f"choose {options} (then nothing is covered by the certificate), or another --gains"
        raise TubecertError([Finding(code="TC705", message=message, help=help)])
    # R_H where no certificate gives one: Dh, with what the smooth layer needs
    radius = setting.uncertainty.h * math.sqrt(1 + float(smooth or 0)) * (1 + 1e-6) or 1.0
    gains = LoopGains(
        bandwidth=float(bandwidth),
        adaptation_rate=None if rate is None else float(rate),
        projection_radius=float(proven.projection_radius) if proven else radius,
        predictor_gain=float(proven.predictor_gain if proven else bandwidth),
        smooth=None if smooth is None or not adapts else float(smooth),
    )
    if proven is None or bandwidth != proven.bandwidth:
        return gains, False
    return gains, not adapts or rate == proven.adaptation_rate

"""A certificate, read back: plan, times, starts, what it proves; loops, their gains, and what is promised of them.

Nothing is believed that the hash does not cover; nothing is proven here either (that is `recheck`'s task).
Implements: theory 4, the bounds D(t), |k| <= du dbar, |xtilde| <= Dxt/sqrt(Gamma), |sigma_hat - h| <= Dh + R_H.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final, Literal

import numpy as np

from tubecert.bounds.wind import Beside
from tubecert.certificate.belonging import as_set, compared
from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Result
from tubecert.claims.advice import advice
from tubecert.conditions.distance import DistanceRecipe
from tubecert.conditions.rates import RateRecipe
from tubecert.coordinates import Coordinates, Fields
from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.expression import Expression
from tubecert.expression.matrix import Matrix, column, combine, multiply
from tubecert.findings import Finding
from tubecert.kinds import DISTANCE, Name, name_of
from tubecert.model import ControlAffineModel, build
from tubecert.simulation.adaptive.loops import Controller, Decay, Loop, LoopGains, Problem, Promise
from tubecert.simulation.adaptive.times import output_times
from tubecert.simulation.adaptive.uncertainty import Class, class_of, sup
from tubecert.spec import Spec, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.make import plan_of
from tubecert.verdict import Verdict

_UNUSED: Final = ("initial_state", "obstacles", "simulation", "expect", "conditions")  # of a metric alone
CHOSEN: Final = "chosen, not certified"
_TOLERANCE: Final = 1e-3  # of the tube's least radius, asked of the integrator
_LIMIT: Final = 100  # of the greatest radius: what is further away from the plan is not followed any more
_DEGREE: Final = 5  # of the polynomials that geodesics are
_EVEN, _EVEN_DEGREE = 1.01, 3  # where M varies by a factor of less over the tube, cubic ones are as near
Gains = RateRecipe | DistanceRecipe


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting(Problem):
    """Everything that loops share, and what is certified of it.

    `reach` is dbar = sqrt(a) rho; `half_widths` by state and output. `x0` (n,), `centre` = x*(0), radius `within` of
    allowed starts, or 0; `spread` (n,): how far from x0 they may be, state by state. `uncertainty` is the class of what
    may act, `h` the specification's.
    """

    spec: Spec
    result: Result
    rho: float
    reach: float
    half_widths: Mapping[str, float]
    x0: Array
    centre: Array
    within: float
    spread: Array
    uncertainty: Class
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
        start = Tape(plan.start, ()).run_floats([], ())
        return replace(self, plan=plan, x0=start, centre=start)

    @property
    def tolerance(self) -> float:
        """The error of |S x| that the integrator is asked for."""
        return _TOLERANCE * self.rho

    @property
    def box(self) -> Array:
        """Bounds of |x_i - x_i*| in the tube, (n,)."""
        return np.array([self.half_widths[name] for name in self.spec.states])

    def sup(self, name: str, otherwise: float | None = None) -> float:
        """The safe side of a constant."""
        return sup(self.result, name, otherwise)

    def beside(self, what: Literal["push", "size"]) -> float:
        """What a wind of the size given, and unknown parameters, do: beta_w |w| + beta_r, or D_E |w| + D_r."""
        wind = self.result.claim.wind
        size = 0.0 if wind is None else float(Fraction(wind.bound))
        return size * self.sup(f"wind_{what}", 0.0) + self.sup(f"residual_{what}", 0.0)

    def proven(self, name: Name) -> Gains | None:
        """The gains of a kind with the numbers of their proof, if it is certified."""
        section, recipe = self.result.sections.get(name.key), self.result.proof.of.get(name.key)
        certified = section is not None and section.verdict is Verdict.CERTIFIED
        return recipe if certified and isinstance(recipe, (RateRecipe, DistanceRecipe)) else None


def adopted(spec: Spec, result: Result) -> Spec:
    """The specification with what the certification had changed: what the command line gave, a new metric.

    Raises `ForeignError` if the certificate is about another system.
    """
    compared(spec, result).require(spec, "the certificate")
    other = load_text(result.spec.effective.at_rest(_UNUSED), "certificate")
    spec = replace(as_set(spec, result.overrides.settings), tube=other.tube)
    if result.overrides.metric is None and spec.metric is not None:
        return spec
    return replace(spec, metric=other.metric, synthesis=other.synthesis)


def require_family(spec: Spec, options: Sequence[str]) -> None:
    """Raises TC708 if there is one plan only, and options say which of many is to be followed."""
    if spec.trajectory.bundle is not None or not options:
        return
    message = f"{' and '.join(options)}: this specification has one plan, not a family of them"
    help = "leave it away, or certify a family: trajectory: {kind: any, x: {...}, u: {...}}"
    raise TubecertError(
        [Finding(code="TC708", message=message, location=spec.location("trajectory.kind"), help=help)]
    )


def require_tube(result: Result) -> None:
    """Raises the reason why there is no tube to be compared with, if there is none."""
    if result.tube is not None and result.tube.rho_r is not None and result.constants:
        return
    reason = next((item for item in result.reasons if item.verdict is result.verdict), None)
    why = "certification stopped" if reason is None else reason.sentence
    message = f"there is no tube that a simulation could leave ({result.verdict}: {why})"
    help = advice(reason.relax if reason else ()) or "tubecert certify tells more"
    verdict = result.verdict if result.verdict is Verdict.REFUTED else Verdict.UNDECIDED
    raise TubecertError([Finding(code="TC703", message=message, help=help)], verdict.exit_code)


def setting_of(
    spec: Spec, result: Result, duration: Fraction | None = None, plan: Plan | None = None
) -> Setting:
    """The setting of a specification and its certification, which has a tube; `plan` is one of a family.

    Raises `TubecertError` where the certificate lacks what is needed, or the plan is too short.
    """
    tube, metric = result.tube, result.metric
    if tube is None or tube.half_widths is None or metric is None or metric.lower is None:
        raise incomplete("that is simulated", "it has no tube")
    model, rows, rho = build(spec), tube.coordinates, float(tube.rho)
    coordinates = None if rows is None else Coordinates(tuple(tuple(map(Fraction, row)) for row in rows))
    S = np.eye(len(model.states)) if coordinates is None else np.array(coordinates.rows, dtype=float)
    single = plan or plan_of(spec, model, result.plan.exact_knots())
    horizon, field = horizon_of(spec, duration), Fields(model, coordinates)
    centre = Tape(single.start, ()).run_floats([], ())  # x*(0), (n,)
    wanted = spec.simulation.h if spec.simulation and spec.simulation.h else spec.uncertainty.h
    reach = math.sqrt(metric.lower.below) * rho
    upper = metric.upper.above if metric.upper and math.isfinite(metric.upper.above) else None
    # a S'S <= M <= A S'S with nearly the same a and A over the tube: geodesics hardly bend there
    even = upper is not None and upper <= _EVEN * (reach / rho) ** 2
    return Setting(
        model=model,
        plan=single,
        horizon=horizon,
        times=output_times(single, horizon),
        degree=_EVEN_DEGREE if even else _DEGREE,
        limit=_LIMIT * rho * float(np.linalg.norm(np.linalg.inv(S), 2)),
        S=S,
        E=_wind(model, field),
        rest=_rest(model, field),
        spec=spec,
        result=result,
        rho=rho,
        reach=reach,
        half_widths=tube.half_widths,
        x0=centre if plan is not None else np.array([float(value) for value in spec.x0]),
        centre=centre,
        within=0.0 if spec.within is None else float(spec.within),
        spread=np.array([float(high - low) / 2 for low, high in spec.start_box] or [0.0] * len(spec.x0)),
        uncertainty=class_of(result, model, reach, upper),
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


def loop_of(setting: Setting, controller: Controller, choice: Choice) -> Loop:
    """A loop with its gains; raises `TubecertError` if there are none for it."""
    if setting.model.gained:
        where = setting.spec.location("system.B")
        message = "parameters known by ranges stand in B, and the loops are stated for a known B"
        help = "give each of them one value: --set system.parameters.NAME=VALUE"
        raise TubecertError([Finding(code="TC705", message=message, location=where, help=help)])
    loop, kind = Loop(controller=controller), name_of(choice.source)
    if not loop.filters:
        return loop
    gains, covered = _gains(setting, loop, choice)
    return replace(
        loop,
        gains=gains,
        gains_are=f"certified by {kind}" if covered else CHOSEN,
        promise=promise(setting, kind) if covered and loop.adapts else None,
    )


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


def promise(setting: Setting, name: Name) -> Promise | None:
    """What a kind of certificate promises about the adaptive loop; None if it certifies nothing."""
    recipe, sup = setting.proven(name), setting.sup
    if recipe is None:
        return None
    k = sup("feedback_gain") * setting.reach  # (2.3) |k| <= du dbar
    radius = float(recipe.projection_radius)  # R_H
    bounds = {
        "distance": setting.reach,  # d(x*, x) < dbar
        "deviation": setting.rho,  # 1.4 (i)
        "k": k,
        "u": sup("u_star") + k + radius,  # (0.4), |u_a| <= R_H
        "sigma_error": sup("h") + radius,  # (2.10)
        "xtilde": _prediction_error(setting, recipe),
    }
    decay = _decay(setting, recipe) if isinstance(recipe, DistanceRecipe) else None  # A bounds the tube only
    return Promise(
        bounds=bounds,
        half_widths=setting.half_widths,
        ranges={own.input: own.bounds[name.key] for own in setting.result.inputs if name.key in own.bounds},
        ultimate=setting.result.sections[name.key].ultimate_radius,
        decay=decay,
    )


def _prediction_error(setting: Setting, recipe: Gains) -> float:
    """Dxt/sqrt(Gamma), (2.11): of A with its own constant Dxt; of B with s1 = Dht + Dhx Y, and (7.8) beside a wind."""
    Gamma, sup = float(recipe.adaptation_rate), setting.sup
    if isinstance(recipe, RateRecipe):
        return sup("prediction_error") / math.sqrt(Gamma)
    s1 = sup("h_t") + sup("h_x") * float(recipe.speed)
    most, q = sup("h") + float(recipe.projection_radius), 2 * float(recipe.predictor_gain)
    drag = setting.beside("size") / q
    if not drag:
        return math.sqrt((2 * most * s1 / q + most**2) / Gamma)
    return math.hypot(most / math.sqrt(Gamma), drag + math.sqrt(drag**2 + 2 * most * s1 / (q * Gamma)))


def _decay(setting: Setting, recipe: DistanceRecipe) -> Decay:
    """(2.15) with H0, and S and e of the recipe."""
    return Decay(
        rate=float(setting.model.rate),
        bandwidth=float(recipe.bandwidth),
        start=setting.sup("initial_distance"),
        beta=setting.sup("metric_input_gain"),
        defect=setting.sup("plan_defect_metric") + setting.beside("push"),
        first=setting.sup("h_initial"),
        rest=float(recipe.uncertainty),
        error=float(recipe.prediction_error),
    )

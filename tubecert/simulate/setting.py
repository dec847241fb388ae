"""What is simulated: plan, times, starts, and each loop with its gains and what a certificate promises about it.

LoopGains come from a certificate, or are chosen; only what a certificate covers can be falsified.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
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
from tubecert.findings import Finding, Location
from tubecert.kinds import HARDWARE
from tubecert.model import ControlAffineModel, build
from tubecert.simulate.certified import Certified, certified_plan, read_numbers
from tubecert.simulate.held import growth, least_rate
from tubecert.simulate.loops import DESIGNS, Controller
from tubecert.simulate.problem import LoopGains, LoopProblem, MachineRun, unbounded
from tubecert.simulate.promise import KINDS, Kind, Promise, kind_for, promise
from tubecert.simulate.uncertainty import Class, Sources, class_of, noises
from tubecert.spec import Spec
from tubecert.trajectory import Plan

TIMES: Final = 501  # output times of the loops that are drawn
_LAYER: Final = 0.25  # of what |B'M gamma_s| can reach in the tube, for adversaries that push
_TOLERANCE: Final = 1e-3  # of the tube's least radius, asked of the integrator
_LIMIT: Final = 100  # of the greatest radius: what is further away from the plan is not followed any more
CHOSEN: Final = "chosen, not certified"


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the command line says about gains: which certificate, and what replaces its numbers."""

    source: str = "distance"
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    sample_time: Fraction | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loop:
    """A closed loop: the problem, where its gains come from, and the promise about it, if there is one.

    `caution` says what is wrong with it before it is simulated, if anything is.
    """

    problem: LoopProblem
    origin: str
    promise: Promise | None
    caution: str = ""

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
        return self.problem.terms.estimates


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Setting:
    """Everything that the loops share: `x0` (n,), `centre` = x*(0), radius `within` of allowed starts, or 0.

    `spread` (n,): how far from x0 they may be, state by state. `E` (n, k) is that of the wind. `uncertainty` is the
    class of every loop but that of a machine, whose class is `on_machine`.
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
    on_machine: Class | None
    E: Matrix
    rest: Matrix
    h: tuple[Expression, ...] | None
    layer: float

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

    def class_of(self, loop: Loop) -> Class:
        """What may act on a loop."""
        return self.on_machine if loop.problem.terms.measures and self.on_machine else self.uncertainty

    @property
    def rho(self) -> float:
        """The radius of the tube, in z."""
        return self.certified.rho

    @property
    def S(self) -> Array:
        """The coordinates z = S x of the tube, (n, n)."""
        return self.certified.S

    @property
    def least_radius(self) -> float:
        """|x - x*| below this is |S (x - x*)| <= rho."""
        return self.rho / float(np.linalg.norm(self.S, 2))

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
        """The error of |x| that the integrator is asked for."""
        return _TOLERANCE * self.least_radius

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
        on_machine=_class_on_machine(spec, certified, model, centre),
        E=_wind(model, result),
        rest=_rest(model, result),
        h=None if wanted is None else tuple(term.expression for term in wanted),
        layer=_LAYER * certified["metric_input_gain"] * certified.reach,
    )


def _class_on_machine(
    spec: Spec, certified: Certified, model: ControlAffineModel, centre: Array
) -> Class | None:
    """The class of certificate H, with its noise and wind; None if H is not certified."""
    own, hardware = certified.machine, spec.hardware
    if own is None or hardware is None:
        return None
    pinv = np.linalg.pinv(certified.S @ _inputs_at(model, centre)) @ certified.S
    noise = [float(q) for q in hardware.noise] if isinstance(hardware.noise, tuple) else 1.0
    sources = Sources(
        pace=certified.rate,
        k=len(model.E[0]) if model.E else 0,
        wind=float(own.recipe.wind),
        table=noises(float(own.recipe.noise) * np.array(noise), pinv),
        noise_rate=math.inf if hardware.noise_rate is None else float(hardware.noise_rate),
        signal=class_of(certified).rate_at(float(own.recipe.speed)),
        box=unbounded(len(spec.inputs)) if own.clip is None else np.array(own.clip).T,
        ranges=_ranges(model),
    )
    return class_of(certified, len(spec.states), len(spec.inputs), sources)


def _beside(certified: Certified, model: ControlAffineModel) -> Sources | None:
    """What acts beside h on loops that see everything; None if nothing does."""
    if not model.E and not model.parameters:
        return None
    return Sources(
        pace=certified.rate,
        k=len(model.E[0]) if model.E else 0,
        wind=float(model.wind_bound or 0),
        table=np.zeros((1, len(model.states))),
        noise_rate=math.inf,
        signal=0.0,
        box=unbounded(len(model.inputs)),
        ranges=_ranges(model),
    )


def _ranges(model: ControlAffineModel) -> Array:
    """Those of the parameters, (p, 2)."""
    return np.array([[float(low), float(high)] for _, (low, high) in model.parameters]).reshape(-1, 2)


def _rest(model: ControlAffineModel, result: Result) -> Matrix:
    """What unknown parameters do that no input can; the rest of it is a part of h, as large as the class allows."""
    if not model.drift:
        return ()
    matched = Beside(_fields(model, result)).matched
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


def _inputs_at(model: ControlAffineModel, x: Array) -> Array:
    """B (n, m) at a state (n,)."""
    m = len(model.inputs)
    values = [*x, *np.zeros(m)]
    return (
        Tape([e for row in model.B for e in row], (*model.states, *model.inputs))
        .run_floats(values, ())
        .reshape(-1, m)
    )


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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tuning:
    """The gains of a loop, the kind of certificate they belong to, and whether they are those that it proves.

    `words` say where they come from.
    """

    gains: LoopGains | None
    kind: Kind | None
    certified: bool
    words: str


def loop_of(
    setting: Setting, controller: Controller, choice: Choice, control_rate: Fraction | None = None
) -> Loop:
    """A loop with its gains; raises `TubecertError` if there are none for it, or none at the control rate."""
    if DESIGNS[controller].terms.measures:
        return _loop_on_machine(setting, choice)
    if setting.model.gained and DESIGNS[controller].terms.filters:
        raise TubecertError([_known_gains_only(setting, controller)])
    tuning = _tuning(setting, controller, choice)
    covered = DESIGNS[controller].terms.predicts and control_rate is None and tuning.certified
    if control_rate is not None:
        tuning = _held(setting, tuning, choice, control_rate)
    problem = _problem(
        setting, controller, tuning.gains, None if control_rate is None else float(control_rate)
    )
    promised = promise(setting.certified, tuning.kind) if covered and tuning.kind else None
    return Loop(problem=problem, origin=tuning.words, promise=promised, caution=_caution(setting, problem))


def _problem(
    setting: Setting,
    controller: Controller,
    gains: LoopGains | None = None,
    control_rate: float | None = None,
    machine: MachineRun | None = None,
) -> LoopProblem:
    return LoopProblem(
        model=setting.model,
        plan=setting.plan,
        controller=controller,
        horizon=setting.horizon,
        times=setting.times,
        gains=gains,
        control_rate=control_rate,
        limit=_LIMIT * setting.greatest_radius,
        P=setting.S.T @ setting.S,
        machine=machine,
        E=setting.E,
        rest=setting.rest,
    )


def _loop_on_machine(setting: Setting, choice: Choice) -> Loop:
    """The loop of theorem H; with another sample time (the delay in proportion) or bandwidth it is not certified."""
    kind, own, hardware = KINDS[HARDWARE.option], setting.certified.machine, setting.spec.hardware
    if own is None or hardware is None:
        raise TubecertError([_no_machine(setting)])
    r = own.recipe
    sample_time, bandwidth = choice.sample_time or r.sample_time, choice.bandwidth or r.bandwidth
    slower = sample_time / r.sample_time
    machine = MachineRun(
        sample_time=float(sample_time),
        delay=float(slower * r.delay),
        bandwidth=math.inf if bandwidth is None else float(bandwidth),
        box=None if own.clip is None else np.array(own.clip).T,
        radius=float(r.clip_radius) if own.clip is None else math.inf,
        feedback_time=None if hardware.feedback_time is None else float(slower * r.feedback_time),
        held=hardware.held,
        predict=hardware.predict,
        raised=setting.certified.raised,
    )
    same = (sample_time, bandwidth) == (r.sample_time, r.bandwidth)
    return Loop(
        problem=_problem(setting, "hardware", machine=machine),
        origin=f"certified by {kind.name}" if same else CHOSEN,
        promise=promise(setting.certified, kind) if same else None,
    )


def _known_gains_only(setting: Setting, controller: Controller) -> Finding:
    return Finding(
        code="TC705",
        message=f"parameters known by ranges stand in B: the controller {controller} is stated for a known B",
        location=setting.spec.location("system.B"),
        help="simulate hardware, or ccm without adaptation",
    )


def _no_machine(setting: Setting) -> Finding:
    hardware = setting.spec.hardware
    help = "add a section hardware to the specification" if hardware is None else "see its section hardware"
    message = "the certificate does not certify the controller hardware"
    return Finding(code="TC705", message=message, help=f"{help}, or simulate other controllers")


def _caution(setting: Setting, problem: LoopProblem) -> str:
    """That the adaptation is unstable at the control rate, and at which it is not; nothing if it is stable."""
    gains, rate = problem.gains, problem.control_rate
    if not problem.terms.adapts or rate is None or gains is None or gains.adaptation_rate is None:
        return ""
    own = (
        gains.A_m(len(setting.x0)),
        setting.S @ _inputs_at(setting.model, setting.centre),
        gains.adaptation_rate,
    )
    if growth(*own, 1 / rate) <= 1:
        return ""
    least = least_rate(*own, rate)
    remedy = f": it needs {near(least, 4)} Hz" if math.isfinite(least) else ""
    return (
        f"the adaptation with Gamma = {near(gains.adaptation_rate, 4)} is unstable at {near(rate)} Hz{remedy}"
    )


def _tuning(setting: Setting, controller: Controller, choice: Choice) -> _Tuning:
    design = DESIGNS[controller]
    if not design.terms.filters:
        return _Tuning(gains=None, kind=None, certified=False, words="no adaptation")
    kind = kind_for(controller, choice.source)
    wanted = {name: getattr(choice, name) for name in ("bandwidth", *design.needs)}
    replaced = {name: float(value) for name, value in wanted.items() if value is not None}
    section = setting.certified.proven(kind.name.key)
    found = {} if section is None else dict(section.recipe)
    missing = [name for name in wanted if name not in {**found, **replaced}]
    if missing:
        raise TubecertError([_no_gains(controller, kind, missing)])
    numbers = {**found, **replaced}
    gains = LoopGains(
        bandwidth=numbers["bandwidth"],
        projection_radius=numbers.get("projection_radius", _radius(setting)),
        predictor_gain=_predictor(setting, controller, numbers),
        adaptation_rate=numbers.get("adaptation_rate"),
        smooth=_smooth(setting, controller),
        sample_time=numbers.get("sample_time") if design.terms.samples else None,
    )
    same = all(found.get(name) == value for name, value in replaced.items())
    words = f"certified by {kind.name}" if same else CHOSEN
    return _Tuning(gains=gains, kind=kind, certified=same, words=words)


def _held(setting: Setting, tuning: _Tuning, choice: Choice, rate: Fraction) -> _Tuning:
    """The tuning for a controller that is held between the samples of a computer: no certificate covers it."""
    if tuning.gains is not None and tuning.gains.sample_time is not None:
        tuning = _on_ticks(setting, tuning, tuning.gains.sample_time, choice.sample_time, rate)
    if not tuning.certified:
        return tuning
    return replace(tuning, words=f"{tuning.words}, but not for a controller that is held")


def _on_ticks(
    setting: Setting, tuning: _Tuning, sample_time: float, chosen: Fraction | None, rate: Fraction
) -> _Tuning:
    """The tuning with a sample time of whole control periods.

    That of a certificate becomes the largest multiple below it; one that was chosen must be a multiple.
    """
    Ts = Fraction(repr(sample_time)) if chosen is None else chosen
    every = math.floor(Ts * rate)
    if chosen is not None and every != chosen * rate:
        raise TubecertError([_off_ticks(setting, chosen, rate)])
    if every < 1:
        raise TubecertError([_too_slow(setting, Ts, rate)])
    if every == Ts * rate:
        return tuning
    assert tuning.gains is not None
    held = float(every / rate)
    shortened = f"the sample time {near(sample_time, 4)} s cut to {every} control periods, {near(held, 4)} s"
    gains = replace(tuning.gains, sample_time=held)
    return replace(tuning, gains=gains, words=f"{tuning.words}, {shortened}")


def _off_ticks(setting: Setting, chosen: Fraction, rate: Fraction) -> Finding:
    every = math.floor(chosen * rate)
    fitting = " or ".join(str(count / rate) for count in (every, every + 1) if count)
    period = float(1 / rate)
    return Finding(
        code="TC707",
        message=f"the sample time {near(chosen)} s is no multiple of the control period {near(period)} s",
        location=_place_of_rate(setting, rate),
        help=f"choose --sample-time {fitting}, or another control rate",
    )


def _too_slow(setting: Setting, Ts: Fraction, rate: Fraction) -> Finding:
    return Finding(
        code="TC707",
        message=f"the control period {near(1 / rate)} s is longer than the sample time {near(Ts)} s",
        location=_place_of_rate(setting, rate),
        help=f"the control rate must be {math.ceil(1 / Ts)} Hz at least, or choose a longer --sample-time",
    )


def _place_of_rate(setting: Setting, rate: Fraction) -> Location | None:
    """Where the specification sets the control rate; None if the command line does."""
    simulation = setting.spec.simulation
    if simulation is None or simulation.control_rate != rate:
        return None
    return setting.spec.location("simulation.control_rate")


def _no_gains(controller: Controller, kind: Kind, missing: list[str]) -> Finding:
    options = " and ".join(f"--{name.replace('_', '-')}" for name in missing)
    return Finding(
        code="TC705",
        message=f"{kind.name} certifies no gains for the controller {controller}",
        help=f"choose {options} (then nothing is covered by the certificate), or another --gains",
    )


def _radius(setting: Setting) -> float:
    """R_H where no certificate gives one: Dh, with what the smooth layer needs."""
    smooth = setting.spec.adaptation.smooth
    return setting.uncertainty.h * math.sqrt(1 + float(smooth or 0)) * (1 + 1e-6) or 1.0


def _smooth(setting: Setting, controller: Controller) -> float | None:
    smooth = setting.spec.adaptation.smooth
    return None if smooth is None or not DESIGNS[controller].terms.adapts else float(smooth)


def _predictor(setting: Setting, controller: Controller, numbers: Mapping[str, float]) -> float | Array:
    """A_m: the certificate's g, else the specification's matrix, else the bandwidth as g."""
    A_m = setting.spec.adaptation.A_m
    if not DESIGNS[controller].terms.samples and A_m != "auto":
        return np.array([[float(entry) for entry in row] for row in A_m])
    return numbers.get("predictor_gain", numbers["bandwidth"])

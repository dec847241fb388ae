"""The loops of a setting, with their gains: a certificate's, what replaces them, what a computer makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final

import numpy as np

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.errors import TubecertError
from tubecert.findings import Finding, Location
from tubecert.kinds import HARDWARE
from tubecert.simulate.held import growth, least_rate
from tubecert.simulate.loops import DESIGNS, Controller
from tubecert.simulate.problem import LoopGains, LoopProblem, MachineRun
from tubecert.simulate.promise import KINDS, Kind, kind_for, promise
from tubecert.simulate.setting import Loop, Setting, inputs_at

_LIMIT: Final = 100  # of the greatest radius: what is further away from the plan is not followed any more
_DEGREE: Final = 5  # of the polynomials that geodesics are
_EVEN, _EVEN_DEGREE = 1.01, 3  # where M varies by a factor of less over the tube, cubic ones are as near
CHOSEN: Final = "chosen, not certified"


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """What the command line says about gains: which certificate, and what replaces its numbers."""

    source: str = "distance"
    bandwidth: Fraction | None = None
    adaptation_rate: Fraction | None = None
    sample_time: Fraction | None = None


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
        degree=_EVEN_DEGREE if _even(setting) else _DEGREE,
        P=setting.S.T @ setting.S,
        machine=machine,
        E=setting.E,
        rest=setting.rest,
    )


def _even(setting: Setting) -> bool:
    """Whether a S'S <= M <= A S'S with nearly the same a and A over the tube: geodesics hardly bend there."""
    own = setting.certified
    return own.upper is not None and own.upper <= _EVEN * (own.reach / own.rho) ** 2


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
        setting.S @ inputs_at(setting.model, setting.centre),
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

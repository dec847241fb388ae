"""Compiled code of a certificate C in its loop: plant and predictor are integrated together, and it acts all the time.

In: a setting, and compiled code. Out: what `export.driven` tells of a machine. Runge and Kutta's rule asks the law and
the predictor at every stage; at the beginning of every step the reference is asked as well. Nothing is proven.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.continuous.compiled import Compiled
from tubecert.export.continuous.reference import Reference
from tubecert.export.controller import Continuous
from tubecert.export.driven import Driven, Given, Plant, Seen, following
from tubecert.export.reference import Around, Handed
from tubecert.progress import Phase, Progress, Step
from tubecert.simulate.monte_carlo import case, disturbance_of
from tubecert.simulate.setting import Setting

_FEWEST: Final = 4  # steps of a sample
_TURN: Final = 0.2  # of what the fastest part of the loop decays in a step
_GAINS: Final = ("feedback_gain", "metric_input_gain")  # du and beta: B k is at most du beta d


def driven(
    setting: Setting,
    code: Compiled,
    controller: Continuous,
    given: Given,
    report: Progress | None = None,
) -> Driven:
    """Random runs and adversaries, as `simulate` draws them; every run is a lane of `code`."""
    kind = setting.uncertainty
    cases = [case(setting, kind, given.seed, number) for number in range(given.count)]
    around = controller if controller.boxes is None else following(controller, setting.plan)
    plant = Plant(setting, around, disturbance_of(setting, kind, cases))
    planner = None if controller.boxes is None else Around(controller=around)
    reference = Reference(controller=controller)
    x = np.array([item.start for item in cases])
    seen, Ts = Seen(np.zeros(given.count)), float(controller.sample_time)
    samples = int(setting.horizon / Ts * (1 + 1e-12))
    steps = _steps(setting, controller)
    xhat = code.start(x)
    seen.compare(xhat, reference.start(x))
    for k in range(samples):
        if report is not None and k % 20 == 0:
            report(Step(phase=Phase.DRIVE, done=k, of=samples))
        plant.turn(x)
        plant.measured(x)  # the state itself: what is said of noise is of a machine
        if k:
            code.step(x, xhat)
            reference.step(x, xhat)
        for j in range(steps):
            _hand(code, planner, k * Ts + j * Ts / steps)
            reference.handed = code.handed
            _compare(code, reference, (j * Ts / steps, x, xhat), seen)
            x, xhat = _moved(plant, (code, planner), (k * Ts, j * Ts / steps, Ts / steps), x, xhat)
            seen.told += int((code.status > 1).sum())
            plant.look(x, k * Ts + (j + 1) * Ts / steps, seen)
    return seen.driven(given, samples, float(controller.level), code.seconds)


def _hand(code: Compiled, planner: Around | None, t: float) -> None:
    """Of a family: the plan at a time."""
    if planner is not None:
        x, u = planner.plan(np.asarray(t))
        code.handed = Handed(x, u, u)


def _steps(setting: Setting, controller: Continuous) -> int:
    """Of the integration, in a sample."""
    feedback = math.prod(setting.certified[name] for name in _GAINS)
    fast = float(controller.bandwidth + controller.predictor_gain) + setting.certified.rate + feedback
    return max(_FEWEST, math.ceil(float(controller.sample_time) * fast / _TURN))


def _compare(code: Compiled, reference: Reference, at: tuple[float, Array, Array], seen: Seen) -> None:
    """Inputs and xhat' of the code and of the reference."""
    since, x, xhat = at
    found = np.concatenate(code.answer(since, x, xhat), axis=1)
    u, _ = reference.law(np.asarray(since), x)
    seen.compare(found, np.concatenate([u, reference.predictor(x, xhat, u)], axis=1))


def _moved(
    plant: Plant,
    acting: tuple[Compiled, Around | None],
    span: tuple[float, float, float],
    x: Array,
    xhat: Array,
) -> tuple[Array, Array]:
    """States and xhat after a step, which begins `since` s after the sample at `begin`."""
    begin, since, h = span
    code, planner = acting

    def slope(at: float, x: Array, xhat: Array) -> tuple[Array, Array]:
        _hand(code, planner, begin + since + at)
        u, rate = code.answer(since + at, x, xhat)
        return plant.rate(x, begin + since + at, u), rate

    a, p = slope(0.0, x, xhat)
    b, q = slope(h / 2, x + h / 2 * a, xhat + h / 2 * p)
    c, r = slope(h / 2, x + h / 2 * b, xhat + h / 2 * q)
    d, s = slope(h, x + h * c, xhat + h * r)
    return x + h / 6 * (a + 2 * b + 2 * c + d), xhat + h / 6 * (p + 2 * q + 2 * r + s)

"""Controllers for tests of export, put together from recipes by hand: nothing is certified."""

from __future__ import annotations

from fractions import Fraction
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from tubecert.conditions.hardware import HardwareRecipe
from tubecert.conditions.sampled import SampledRecipe
from tubecert.export.assembly import assembled
from tubecert.export.blocks import Machine
from tubecert.export.continuous.assembly import Loop, together
from tubecert.export.controller import Boxes, Continuous, Controller

from tubecert.model import build
from tubecert.spec import Knots, Picard, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.pieces import piecewise_plan

CONFIGS = Path(__file__).parents[1] / "configs"
HASH = "sha256:" + "0123456789abcdef" * 4

# B(x): with W = I its columns are Killing fields if they turn
TURNING = """
tubecert: 1
name: turning
system:
  states: [p, v, w]
  inputs: [u, s]
  tables: {bend: {interpolation: cubic, points: [[-1, -0.3], [-0.05, 0], [-0.01, 0.02], [0, 0], [0.03, 0.1], [1, 0.2]]}}
  f: ["-p + v/5", "p/2 - v/10 + tanh(w)/7 + bend(p)/3", "-w + sin(p)*exp(-v)"]
  B: [["-v/4", 0], ["1 + p/4", 0], [0, 1]]
safe_set: {p: [-1, 1], v: [-1, 1], w: [-1, 1]}
uncertainty: {h: ["0.1*sin(t)", 0]}
trajectory: {kind: equilibrium, at: [0, 0, 0]}
metric: {rate: 0.5, dual_metric: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
tube: {epsilon: 0.1, rho_a: 0.1}
"""
PATH = """
tubecert: 1
name: path
system: {states: [p, v], inputs: [u], f: [v, "p - v/2"], B: [[0], [1]]}
safe_set: {p: [-2, 2], v: [-2, 2]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.1, rho_a: 0.1}
"""
# at rest, so that nothing but functions, constants and the size of the tube make its rounding
STEEP = """
tubecert: 1
name: steep
system: {states: [p, v], inputs: [u], f: [v, "40*sin(p) + 30*exp(v) - 30 - v/3"], B: [[0], [1]]}
safe_set: {p: [-2, 2], v: [-2, 2]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.1, rho_a: 0.1}
"""
BENT = (CONFIGS / "state_dependent_input.yaml").read_text("utf-8") + (
    "hardware: {rate: 500, delay: 0.0005, geodesic: {nodes: 3, sweeps: 2}}\n"
)
# any plan that keeps to boxes
ANY = """
tubecert: 1
name: family
system: {states: [p, v], inputs: [u], f: [v, "p - v/2 + sin(v)/9"], B: [[0], [1]]}
safe_set: {p: [-3, 3], v: [-3, 3]}
uncertainty: {h: ["0.1*sin(t)"]}
trajectory: {kind: any, x: {p: [-1, 0.9], v: [-0.5, 0.4]}, u: {u: [-2, 1.9]}, defect: 0.01}
initial_state: {within: 0.02}
metric: {rate: 0.4, dual_metric: [[1, -0.5], [-0.5, 1]]}
tube: {epsilon: 0.6, rho_a: 0.1}
"""
KNOTS = Knots(
    t=tuple(map(Fraction, ("0", "0.013", "0.02", "0.3", "0.31"))),
    x=tuple(
        tuple(map(Fraction, row))
        for row in (("0", "0"), ("0", "0.001"), ("0", "0"), ("0.1", "0"), ("0.1", "0.1"))
    ),
    u=tuple((Fraction(q),) for q in ("0", "0.2", "-0.1", "0.3", "0")),
    interpolation="linear",
)


def recipe(**values: Any) -> HardwareRecipe:
    """A recipe of 500 Hz with numbers as they are on the orbit."""
    given: dict[str, Any] = {
        "sample_time": Fraction(1, 500),
        "delay": Fraction(1, 2000),
        "feedback_time": Fraction(1, 500),
        "bandwidth": Fraction("75.96"),
        "noise": Fraction(1, 1000),
        "wind": Fraction(0),
        "clip_radius": Fraction("2.15"),
        "level": Fraction("0.18539"),
        "floor": Fraction("0.05"),
        "speed": Fraction("8.1"),
        "bias": Fraction("0.1"),
        "ripple": Fraction("0.07"),
        "prediction": None,
    }
    return HardwareRecipe(**(given | values))


def machine(text: str, plan: Plan | None = None, **values: Any) -> Machine:
    """A machine for a specification."""
    spec = load_text(text, "spec.yaml")
    model, trajectory = build(spec), spec.trajectory
    x, u = (tuple(term.expression for term in terms) for terms in (trajectory.x, trajectory.u))
    given: dict[str, Any] = {
        "name": spec.name,
        "hash": HASH,
        "model": model,
        "plan": Plan(x, u, trajectory.horizon) if plan is None else plan,
        "recipe": recipe(),
        "reach": Fraction("0.19"),
        "clip": (),
        "coordinates": None,
        "held": False,
        "horizon": trajectory.horizon,
        "ranges": ((-4.0, 4.0),) * len(spec.inputs),
        "boxes": None if trajectory.bundle is None else Boxes(x=trajectory.bundle.x, u=trajectory.bundle.u),
    }
    return Machine(**(given | values))


def _orbit(**values: Any) -> Machine:
    text = (CONFIGS / "hardware_orbit.yaml").read_text("utf-8")
    return machine(text, **({"clip": ((Fraction(-2), Fraction("1.9")),)} | values))


def _path(**values: Any) -> Machine:
    plan = piecewise_plan(build(load_text(PATH)), KNOTS)
    own = recipe(sample_time=Fraction(1, 100), feedback_time=Fraction(1, 100), **values)
    return machine(PATH, plan, recipe=own, horizon=Fraction("0.31"))


GIVEN = {
    # a moving plan, u* in continuous time, a box as the clip
    "orbit": _orbit(),
    # u* held from sample to sample
    "held_orbit": _orbit(held=True),
    # a feedback that has a clock of its own, at every third sample
    "seldom_orbit": _orbit(recipe=recipe(feedback_time=Fraction(3, 500))),
    # B(x), a table, two inputs, a ball as the clip, a predicted state, a delay of one sample, coordinates of the tube
    "turning": machine(
        TURNING,
        recipe=recipe(delay=Fraction(1, 500), prediction=Fraction("0.01"), clip_radius=Fraction("0.2")),
        coordinates=(("1", "0", "0"), ("0", "2", "0"), ("0", "1/3", "1")),
    ),
    # a plan through knots, of which several meet one sample, and no filter
    "path": _path(bandwidth=None),
    # a metric that depends on the state, and B(x): its geodesics are computed
    "bent": machine(
        BENT,
        recipe=recipe(level=Fraction("0.05"), clip_radius=Fraction("0.3")),
        feedback_gain=Fraction("1.85"),
        geodesic=Picard(nodes=3, sweeps=2),
    ),
    # the same as "path", with a prediction in which u* moves
    "predicting_path": _path(prediction=Fraction("0.01")),
}
# of no other tests: a slow machine with a wide clip
SLOW = machine(
    STEEP,
    recipe=recipe(sample_time=Fraction(1, 2), feedback_time=Fraction(1, 2), clip_radius=Fraction(300)),
)
CONTROLLERS = {name: partial(assembled, given) for name, given in GIVEN.items()}
orbit, turning = CONTROLLERS["orbit"], CONTROLLERS["turning"]


def loop(text: str, plan: Plan | None = None, **values: Any) -> Loop:
    """A loop of certificate C for a specification."""
    own = machine(text, plan)
    given: dict[str, Any] = {
        "name": own.name,
        "hash": HASH,
        "model": own.model,
        "plan": own.plan,
        "recipe": SampledRecipe(
            sample_time=Fraction(1, 100),
            bandwidth=Fraction("25.5"),
            predictor_gain=Fraction("30.25"),
            projection_radius=Fraction("0.9"),
            speed=Fraction("8.1"),
        ),
        "reach": Fraction("0.19"),
        "coordinates": None,
        "horizon": own.horizon,
        "ranges": ((-4.0, 4.0),) * len(own.model.inputs),
        "feedback_gain": Fraction("6.302"),
        "boxes": own.boxes,
    }
    return Loop(**(given | values))


def _together(name: str) -> Continuous:
    return together(looped(name))


@cache
def looped(name: str) -> Loop:
    """One of `CONTINUOUS`."""
    if name == "orbit":  # a moving plan
        return loop((CONFIGS / "two_state_orbit.yaml").read_text("utf-8"))
    if name == "turning":  # B(x), a table, two inputs, coordinates of the tube
        return loop(TURNING, coordinates=(("1", "0", "0"), ("0", "2", "0"), ("0", "1/3", "1")))
    if name == "family":  # any plan
        return loop(ANY)
    return loop(PATH, piecewise_plan(build(load_text(PATH)), KNOTS), horizon=Fraction("0.31"))  # knots


@cache
def of_family(name: str) -> Machine:
    """One of `FAMILIES`: u* is played, or held, and there the feedback has a clock of its own and a horizon."""
    if name == "played":
        return machine(ANY)
    return machine(ANY, held=True, horizon=Fraction(3), recipe=recipe(feedback_time=Fraction(3, 500)))


def _of_family(name: str) -> Controller:
    return assembled(of_family(name))


FAMILIES = {name: partial(_of_family, name) for name in ("played", "held")}
CONTINUOUS = {name: partial(_together, name) for name in ("orbit", "turning", "path", "family")}


def wandering(controller: Controller, samples: int, lanes: int, seed: int) -> np.ndarray:
    """Measurements (K, N, n) near the plan: they drift, jump, and shake."""
    from tubecert.export.reference import Reference

    generator, reference = np.random.default_rng(seed), Reference(controller=controller)
    n = len(controller.states)
    drift = np.cumsum(generator.normal(size=(samples, lanes, n)), axis=0) * 1e-3
    drift[samples // 2 :] += 0.05 * generator.normal(size=(1, lanes, n))
    plans = []
    for k in range(samples):
        reference.sample = k
        plans.append(reference.plan(reference.time())[0])
    return np.array(plans) + drift + 1e-4 * generator.normal(size=drift.shape)

"""Sampled loops for tests of simulation: tables by hand, stages by the theorem's own fixed point, proven."""

from fractions import Fraction
from functools import lru_cache

import numpy as np
from handmade import source

from tubecert.loop_design.proposal import propose
from tubecert.model import build
from tubecert.sampled_loop.record import Claim, Nominal, Result, Tables
from tubecert.sampled_loop.remainders import Remainders
from tubecert.sampled_loop.setting import Loop
from tubecert.sampled_loop.theorem import check
from tubecert.simulation.sampled.setting import Setting, setting_of
from tubecert.spec import canonical, load_text
from tubecert.trajectory.make import plan_of
from tubecert.verdict import Verdict

SCALAR = """
tubecert: 1
name: scalar
system: {states: [x], inputs: [u], f: ["0.5*x"], B: [[1]]}
safe_set: {x: [-5, 5]}
trajectory: {kind: equilibrium, at: [0], input: [0]}
initial_state: {at: [0.3]}
hardware: {sample_time: 0.1, delay: 0.04, noise: {x: 0.01}}
disturbance: {E: [[1]], bound: [0.2]}
"""
CART = """
tubecert: 1
name: cart
system: {states: [p, v], inputs: [F], f: [v, 0], B: [[0], [1]]}
safe_set: {p: [-9, 9], v: [-9, 9]}
uncertainty: {h: ["0.2*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
initial_state: {box: {p: [-0.1, 0.1], v: [-0.1, 0.1]}}
hardware: {rate: 20, delay: 0.02, noise: 0.001}
disturbance: {E: [[0], [1]], bound: 0.1}
obstacles: [{states: [p, v], disc: {center: [2, 0], radius: 0.5}}]
"""
PENDULUM = """
tubecert: 1
name: pendulum
system: {states: [p, v], inputs: [u], parameters: {g: [0.9, 1.1]}, f: [v, "-g*sin(p) - 0.1*v"], B: [[0], [1]]}
safe_set: {p: [-1, 1], v: [-1, 1]}
trajectory: {kind: any, x: {p: [-0.2, 0.2], v: [-0.2, 0.2]}, u: {u: [-0.3, 0.3]}, defect: 0.01, input_rate: 1}
initial_state: {within: 0.02}
hardware: {rate: 50, delay: 0.015, noise: 0.0005}
"""
ABOUT = {  # A, B, E and the gain
    "scalar": (SCALAR, 0.5, 1, 1, [[-3]]),
    "cart": (CART, [[0, 1], [0, 0]], [[0], [1]], [[0], [1]], [[-4, -4]]),
    "pendulum": (PENDULUM, [[0, 1], [-1, -0.1]], [[0], [1]], np.zeros((2, 0)), [[-4, -4]]),
}


@lru_cache
def proven(name: str) -> Result:
    """What is proven of a loop with a gain."""
    text, *matrices, gain = ABOUT[name]
    A, B, E = (np.atleast_2d(np.array(value, dtype=float)) for value in matrices)
    spec, N = load_text(text), np.array(gain, dtype=float)
    model = build(spec)
    loop = Loop(spec=spec, model=model, plan=plan_of(spec, model), knots=None, slow=True, A=A, B=B, E=E)
    own = Tables(np.zeros((0, 0)), np.zeros((0, len(A))), np.zeros((len(N), 0)), N)
    inequalities, stages = propose(Remainders(loop, 64), own)
    checked = check(loop, own, stages, inequalities.recipe)
    assert checked.verdict is Verdict.CERTIFIED, checked.lacks
    return Result(
        verdict=checked.verdict,
        spec=source(canonical(spec)),
        claim=Claim(horizon=loop.horizon, afterwards=loop.afterwards, hold=loop.hold),
        nominal=Nominal(A, B, E),
        controller=own,
        tube=stages,
        inputs=checked.inputs,
        clearance=checked.clearance,
        recipe=inequalities.recipe,
    )


def setting(name: str, *changes: tuple[str, str], duration: str | None = None) -> Setting:
    """Its setting; `changes` of the text make another plant, whose certificate is a lie."""
    text = ABOUT[name][0]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return setting_of(load_text(text), proven(name), duration and Fraction(duration))

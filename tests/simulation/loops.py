"""Sampled loops for tests of simulation, proven."""

from dataclasses import replace
from fractions import Fraction
from functools import lru_cache

import numpy as np
from small_loops import SCALAR, result_of
from texts import replaced

from tubecert.sampled_loop.record import Result, Tables
from tubecert.simulation.sampled.setting import Setting, setting_of
from tubecert.spec import load_text
from tubecert.verdict import Verdict

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
    "scalar": (SCALAR, [0.5], [1], [1], [[-3]]),
    "cart": (CART, [0, 1, 0, 0], [0, 1], [0, 1], [[-4, -4]]),
    "pendulum": (PENDULUM, [0, 1, -1, -0.1], [0, 1], [], [[-4, -4]]),
}


@lru_cache
def proven(name: str) -> Result:
    """What is proven of a loop with a gain."""
    *question, gain = ABOUT[name]
    N = np.array(gain, dtype=float)
    m, n = N.shape
    result = result_of(*question, Tables(np.zeros((0, 0)), np.zeros((0, n)), np.zeros((m, 0)), N))
    assert result.verdict is Verdict.CERTIFIED, result.lacks
    return result


def setting(name: str, *changes: tuple[str, str], duration: str | None = None, **claims: object) -> Setting:
    """Its setting; `changes` of the text make another plant, and other `claims` a certificate that is a lie."""
    text, result = replaced(ABOUT[name][0], *changes), replace(proven(name), **claims)
    return setting_of(load_text(text), result, duration and Fraction(duration))

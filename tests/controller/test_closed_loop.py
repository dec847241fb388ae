"""The exported controller in the loop that it was certified for: every time is that of the theorem."""

import numpy as np
import pytest
from scipy.linalg import expm

from tubecert.controller.compiled import Controller
from tubecert.controller.data import data_of
from tubecert.loop_design.certification import certify
from tubecert.spec import load_text

SPEC = """
tubecert: 1
name: cart
system: {states: [p, v], inputs: [F], f: [v, "-v"], B: [[0], [1]]}
safe_set: {p: [-3, 3], v: [-3, 3]}
trajectory: {kind: expressions, x: [sin(2*t), 2*cos(2*t)], u: [2*cos(2*t) - 4*sin(2*t)], horizon: 4, afterwards: repeat}
hardware: {sample_time: 0.05, delay: 0.075, noise: {p: 0.001, v: 0.002}, hold: HOLD}
initial_state: {at: [0, 2]}
limits: {F: [-20, 20]}
"""
PERIOD, DELAY, LANES = 0.05, 0.075, 64
BLOCK = expm(np.array([[0, 1, 0], [0, -1, 1], [0, 0, 0]]) * PERIOD / 2)  # half a sample under a held input


def push(t):
    return 2 * np.cos(2 * t) - 4 * np.sin(2 * t)


def errors(controller, hold, lost=range(0)):
    """|x - x*| at every sample, (400, n): the worst of many runs with noise of full size."""
    draw, controller.state[...] = np.random.default_rng(1), 0
    x, first = np.tile([0.0, 2.0], (LANES, 1)), DELAY / 2 if hold == "middle" else 0.0
    waiting = [
        np.full(LANES, push(first)),
        np.full(LANES, push(DELAY - PERIOD / (2 if hold == "middle" else 1))),
    ]
    found = []
    for k in range(400):
        t = k * PERIOD
        found.append(abs(x - [np.sin(2 * t), 2 * np.cos(2 * t)]).max(axis=0))
        y = x + draw.choice([-1.0, 1.0], (LANES, 2)) * [0.001, 0.002]
        waiting.append(controller.step(y * np.nan if k in lost else y)[:, 0])
        for u in waiting[:2]:  # the delay is one sample and a half
            x = np.column_stack([x, u]) @ BLOCK[:2].T
        waiting.pop(0)
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["middle", "left"])
def test_the_loop_stays_in_its_tube_and_returns_to_it(hold):
    spec = load_text(SPEC.replace("HOLD", hold), "cart.yaml")
    proven = certify(spec)
    widths = [float(max(stage.half_widths[name] for stage in proven.result.tube)) for name in "pv"]
    controller = Controller(data_of(proven), LANES)
    assert (errors(controller, hold) < widths).all()
    assert not controller.state["status"].any()
    found = errors(controller, hold, lost=range(100, 103)) / widths
    assert found[100:150].max() > 1
    assert found[-150:].max() < 1, "after three samples that are missing it is back"

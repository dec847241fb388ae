"""The exported controller in the loop that it was certified for: every time is that of the theorem."""

import numpy as np
import pytest
from scipy.linalg import expm

from tubecert.controller.compiled import BAD, Controller
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
A, B = np.array([[0.0, 1.0], [0.0, -1.0]]), np.array([0.0, 1.0])


def moved(x, u, time):
    """x after some time under a held input, exactly."""
    block = expm(np.block([[A, B[:, None]], [np.zeros((1, 3))]]) * time)
    return x @ block[:2, :2].T + np.outer(u, block[:2, 2])


def planned(t):
    return np.array([np.sin(2 * t), 2 * np.cos(2 * t)])


def push(t):
    return 2 * np.cos(2 * t) - 4 * np.sin(2 * t)


def errors(own, lost=range(0)):
    """|x - x*| over the half-widths at every sample, (400, n): the worst of many runs with noise of full size."""
    draw, middle = np.random.default_rng(1), own.hold == "middle"
    x = np.tile(planned(0.0), (LANES, 1))
    before = [push(DELAY / 2 if middle else 0.0), push(DELAY - PERIOD / 2 if middle else DELAY - PERIOD)]
    waiting, found = [np.full(LANES, u) for u in before], []
    for k in range(400):
        found.append(abs(x - planned(k * PERIOD)).max(axis=0) / own.widths)
        noise = draw.choice([-1.0, 1.0], (LANES, 2)) * [0.001, 0.002]
        y = np.full_like(x, np.nan) if k in lost else x + noise
        waiting.append(own.controller.step(y)[:, 0])
        assert (own.controller.status & BAD == BAD * (k in lost)).all() or (lost and k >= lost[0])
        for u in waiting[:2]:  # the delay is one sample and a half
            x = moved(x, u, PERIOD / 2)
        waiting.pop(0)
    return np.array(found)


class Own:
    """A certified loop; `hold` is how u* is held."""

    def __init__(self, hold):
        found = certify(
            load_text(SPEC.replace("HOLD", hold), "cart.yaml"), settings={}, report=None, command=""
        )
        self.hold, self.controller = hold, Controller(data_of(found), LANES)
        self.widths = np.array([float(max(s.half_widths[name] for s in found.result.tube)) for name in "pv"])


@pytest.mark.slow
@pytest.mark.parametrize("hold", ["middle", "left"])
def test_the_loop_stays_in_its_tube_and_returns_to_it(hold):
    own = Own(hold)
    assert errors(own).max() < 1
    assert not own.controller.status.any()
    own.controller.start()
    found = errors(own, lost=range(100, 103))
    assert found[100:150].max() > 1
    assert found[-150:].max() < 1, "after three samples that are missing it is back"

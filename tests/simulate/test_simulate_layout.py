"""Where things are in the compiled lanes: blocks of y, terms of the loops, and what is known of the state."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from systems import matrix_of, plain_model

from tubecert.simulate.compiled import entry
from tubecert.simulate.fast import _rate, generator
from tubecert.simulate.grid import fast_part
from tubecert.simulate.loops import CONTROLLERS, DESIGNS
from tubecert.simulate.problem import LoopGains, LoopProblem
from tubecert.spec.simulation import CONTROLLERS as NAMES
from tubecert.trajectory import constant_plan

TWO = replace(
    plain_model(("x1", "x2"), ("-x1 + x2", "sin(x1) - x2"), [["1", "1/2"], ["-1/4", "2"]]),
    W=matrix_of([["1", "-1/2"], ["-1/2", "1"]], ()),
    rate=Fraction(1, 2),
)
GAINS = LoopGains(bandwidth=7.0, projection_radius=100.0, predictor_gain=3.0, adaptation_rate=11.0)


def problem(controller):
    plan, times = constant_plan([0, 0], [0, 0], None), np.linspace(0, 1, 5)
    return LoopProblem(model=TWO, plan=plan, controller=controller, horizon=1.0, times=times, gains=GAINS)


@entry
def rate(fast, y, h, B, dy):
    _rate(fast, False, y, h, B, dy)


@pytest.mark.slow
@pytest.mark.parametrize("controller", [name for name in CONTROLLERS if DESIGNS[name].terms.filters])
def test_both_forms_of_the_right_hand_sides_are_those_of_the_theory(controller):
    """The matrix of the exact flow and the rate that RK4 integrates: (0.6) less (0.1), (0.7), (0.8), written out."""
    rng = np.random.default_rng(3)
    B = np.array([[1.0, 0.5], [-0.25, 2.0]])
    xt, sigma, u_a, v, h = (rng.normal(size=2) for _ in range(5))
    y, zero = np.concatenate([xt, sigma, u_a, v]), np.zeros(2)
    parts = {
        "reference": [zero, zero, -7 * (u_a + h), B @ u_a],
        "l1": [-3 * xt + B @ (sigma - h), -11 * B.T @ xt, -7 * (u_a + sigma), B @ u_a],
    }[controller]
    fast = fast_part(problem(controller), np.array([0.1]), 0)
    L, E = generator(fast, B)
    found = np.zeros(fast.at.size)
    rate(fast, y, h, B, found)
    np.testing.assert_allclose(found, np.concatenate(parts), atol=1e-13)
    np.testing.assert_allclose(L @ y + E @ h, found, atol=1e-13)


def test_loops_are_named_alike_everywhere():
    assert NAMES == CONTROLLERS
    assert not DESIGNS["nominal"].disturbed
    assert all(DESIGNS[name].disturbed for name in CONTROLLERS if name != "nominal")
    assert all(hasattr(GAINS, need) for design in DESIGNS.values() for need in design.needs)

"""Wind and unknown parameters in simulated loops: what acts, and that no certified bound is exceeded."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import proven
import pytest
from scipy.integrate import solve_ivp
from simulated import FLAT, alone
from systems import SMALL

from tubecert.simulation.adaptive import engine
from tubecert.simulation.adaptive.campaign import cases, simulate
from tubecert.simulation.adaptive.judge import compare
from tubecert.simulation.adaptive.loops import Disturbance
from tubecert.simulation.adaptive.setting import Choice, loop_of, setting_of
from tubecert.spec import load_text

RANGES = SMALL.replace("0.3*sin(x)", "m*sin(x)").replace(
    "  inputs: [u]", "  inputs: [u]\n  parameters: {m: [0.28, 0.32], c: [-0.02, 0.02]}"
)
STIRRED = RANGES.replace('"-x + y"', '"-x + y + c*cos(x)"').replace("input: [0]", "input: [0], horizon: 6")
GUSTS = STIRRED + 'disturbance: {E: [["cos(x)"], ["1 + y"]], bound: 0.01}\n'
CONTROLLERS = {"none": "ccm", "B": "l1"}


@lru_cache
def stirred(kind):
    return setting_of(load_text(GUSTS, "s.yaml"), proven.result(GUSTS, bare=True, conditions=kind))


def loop(kind):
    return loop_of(stirred(kind), CONTROLLERS[kind], Choice())


@pytest.mark.slow
def test_a_run_is_that_of_the_plant_with_its_parameters():
    """The feedback alone against scipy: x' = f(x, theta) + B (k - what is told of h) written out."""
    setting = stirred("none")
    case = replace(setting, times=np.linspace(0, 2, 5), horizon=2.0), loop("none")
    model = setting.model
    still = Disturbance.from_expressions(None, model, 1)
    theta = np.array([[0.31], [0.02]])
    moved = still._replace(theta=theta)
    x0 = np.array([[0.05, 0.0]])
    found = alone(case, x0, moved, tolerance=1e-5)
    M = np.linalg.inv(np.array([[1, -0.3], [-0.3, 2]]))
    B = np.array([0.0, 1.0])

    def f(x):
        return np.array([-x[0] + x[1], -x[1] + 0.3 * np.sin(x[0])])

    def slope(t, x):
        m = M @ x
        grown = m @ (f(x) + 0.8 * x)
        k = -grown / (B @ m) if grown > 0 else 0.0
        return f(x) + B * k + np.array([0.02 * np.cos(x[0]), 0.0])  # what no input reaches

    own = solve_ivp(slope, (0, 2), x0[0], rtol=1e-10, atol=1e-12, t_eval=case[0].times)
    np.testing.assert_allclose(found.x[0], own.y.T, atol=1e-5)
    at_rest = alone(case, x0, still, tolerance=1e-5)
    assert np.abs(at_rest.x - found.x).max() > 1e-3


@pytest.mark.slow
def test_no_bound_is_exceeded_by_adversaries_whose_parameters_differ():
    setting, own = stirred("B"), loop("B")
    drawn = cases(setting, 3, range(60))
    (runs,) = engine.integrate([(setting, own, drawn)], tolerance=setting.tolerance)
    found = compare(setting, runs, own.promise)
    assert own.promise is not None
    assert not found.violations
    assert not found.left_the_tube
    assert not found.no_result
    thetas = drawn.h.theta.T
    assert thetas.shape == (60, 2)
    assert np.all((thetas >= [0.28, -0.02]) & (thetas <= [0.32, 0.02]))
    assert len(np.unique(thetas[:, 0])) > 3


@pytest.mark.slow
def test_a_wind_blows_on_the_loop_of_b_and_breaks_nothing():
    text = FLAT + "disturbance: {E: [[1, 0], [0, 1]], bound: 1/100}\n"
    setting = setting_of(load_text(text), proven.result(text, bare=True, conditions="all"))
    own = loop_of(setting, "l1", Choice())
    assert own.promise.decay.defect > 0.009 * setting.sup("wind_push") > 0  # the plan has none
    (found,) = simulate(setting, [own], count=15, seed=2).attacks
    assert found.adversary.comparison.worst["distance"].share > 0.1
    for comparison in (found.random.comparison, found.adversary.comparison):
        assert not comparison.violations
        assert not comparison.no_result

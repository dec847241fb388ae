"""The constants of certificate H: closed forms, sampling, and what scales how."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from systems import matrix_of
from tubecert.bounds.hardware import HardwareSuprema, clip_box, corners

from tubecert.bounds.constants import Constant
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import parse, symbol
from tubecert.model import ControlAffineModel
from tubecert.trajectory import Plan, constant_plan

RATE = Fraction(1, 2)
A = np.array([[-1.0, 2.0], [-3.0, 0.5]])
W = np.array([[4.0, -1.0], [-1.0, 3.0]])


def model_of(f, B, W, h=None):
    names = tuple(f"x{i + 1}" for i in range(len(f)))
    return ControlAffineModel(
        states=names,
        inputs=tuple(f"u{j + 1}" for j in range(len(B[0]))),
        f=matrix_of([f], names)[0],
        B=matrix_of(B, names),
        W=matrix_of(W, names),
        rate=RATE,
        h=None if h is None else matrix_of([h], (*names, "t"))[0],
    )


def suprema_of(model, x, u=None, *, rho=0.5, horizon=None, time=None):
    """Over the tube of radius `rho` about a plan, given as texts in t."""
    t = {"t": symbol("t")}
    curve = tuple(parse(e, symbols=t).expression for e in x)
    inputs = tuple(parse(e, symbols=t).expression for e in u or ["0"] * len(model.inputs))
    return HardwareSuprema(model, Plan(curve, inputs, horizon), rho, time, Effort())


def tight(found: Constant, value: float, share: float = 0.01) -> None:
    """A proven enclosure of a known value."""
    assert found.below <= value * (1 + 1e-12) + 1e-12
    assert value * (1 - 1e-12) - 1e-12 <= found.above <= value * (1 + share) + 1e-9


@pytest.fixture(scope="module")
def linear():
    f = [" + ".join(f"({a})*x{j + 1}" for j, a in enumerate(row)) for row in A]
    return suprema_of(model_of(f, [["0"], ["1"]], [[str(e) for e in row] for row in W]), ["0.1", "-0.2"])


def test_a_linear_system_with_a_constant_metric(linear):
    theta = np.linalg.inv(np.linalg.cholesky(W))
    back = np.linalg.inv(theta)
    F = A @ W + W @ A.T + 2 * float(RATE) * W
    tight(linear.feedback_slope(), np.abs(np.linalg.eigvalsh(theta @ F @ theta.T)).max())
    tight(linear.drift_slope_metric(), np.linalg.norm(theta @ A @ back, 2))
    tight(linear.drift_difference(), 0.5 * np.linalg.norm(A, 2))
    largest = linear.metric_bounds()[1]
    tight(
        linear.drift_difference_metric(largest, linear.drift_slope_metric()),
        0.5 * np.linalg.norm(theta @ A, 2),
    )
    tight(linear.feedback_curvature(), 0.0)
    tight(linear.plan_tilt(linear.metric_input_gain()), 0.0)


def test_noise_per_state_is_that_of_the_worst_corner(linear):
    noise = (Fraction(1, 10), Fraction(1, 5))
    points = np.array([[0.1, 0.2], [0.1, -0.2]]).T
    theta = np.linalg.inv(np.linalg.cholesky(W))
    tight(linear.noise_metric(noise), np.linalg.norm(theta @ points, axis=0).max())
    tight(linear.noise_size(noise), np.hypot(0.1, 0.2))
    tight(linear.noise_explained(noise), 0.2)
    tight(linear.noise_metric(None), np.linalg.norm(theta, 2))
    tight(linear.noise_size(None), 1.0)
    assert len(corners((Fraction(1),) * 4)) == 8
    assert len(corners((Fraction(1), Fraction(0), Fraction(1)))) == 2


@pytest.mark.slow
def test_a_curved_drift_in_one_dimension():
    s = suprema_of(model_of(["sin(x1)"], [["1"]], [["2"]]), ["t"], ["cos(3*t)"], horizon=Fraction(2))
    # F = 2 cos(x) 2 + 2 rate 2, over W = 2: 2 cos(x) + 1 on [-.5, 2.5]
    tight(s.feedback_slope(), 3.0)
    tight(s.feedback_curvature(), 2.0)
    tight(s.plan_speed(Constant.exactly(0.0)), 1.0)
    tight(s.input_rate(), 3.0)
    # sin(x + z) - sin(x) = 2 sin(z/2) cos(x + z/2), less than |z|
    curved = replace(s, model=model_of(["sin(x1)"], [["1"]], [["2 + x1**2/10"]]))
    tight(curved.drift_difference(), 2 * np.sin(0.25))
    tight(s.drift_difference(), 0.5)


def test_what_jumps_has_no_rate():
    model = model_of(["-x1"], [["1"]], [["1"]])
    s = HardwareSuprema(model, constant_plan([Fraction(0)], [Fraction(1)], None), 0.5, None, Effort())
    assert s.input_rate() == Constant.exactly(0.0)


def test_the_clip_box_contains_h_and_0():
    model = model_of(["-x1"], [["1"]], [["1"]], h=["3 + x1**2"])
    assert clip_box(suprema_of(model, ["0"])) == ((Fraction(0), pytest.approx(3.25, rel=0.02)),)
    assert clip_box(suprema_of(model, ["0"]))[0][1] >= Fraction("3.25")
    below = replace(model, h=tuple(-e for e in model.h))
    assert clip_box(suprema_of(below, ["0"])) == ((pytest.approx(-3.25, rel=0.02), Fraction(0)),)

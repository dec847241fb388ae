"""The loops where u* jumps at knots, and with two inputs on a ball, against scipy's DOP853 from one jump to the next.

Everything is written here a second time in numpy, from the theory: plan, feedback, predictor, projection, adaptation.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulated import alone
from systems import F_TWO, W_TWO, matrix_of, plain_model

from tubecert.expression import cos, sin, symbol
from tubecert.model import ControlAffineModel
from tubecert.simulation.adaptive.loops import Disturbance, Loop, LoopGains, Problem
from tubecert.spec import Knots
from tubecert.trajectory.pieces import piecewise_plan

T, X, Y, Z = symbol("t"), symbol("x1"), symbol("x2"), symbol("x3")
RADIUS = 0.6  # of the projection: less than |h|


@dataclass(frozen=True, kw_only=True)
class System:
    """A model, and the same once more in numpy."""

    model: ControlAffineModel
    h_terms: tuple
    f: object
    h: object
    B: np.ndarray
    M: np.ndarray
    rate: float


def system(states, *, f, B, W, rate, h):
    rows, weights = (np.array([[float(Fraction(e)) for e in row] for row in part]) for part in (B, W))
    model = replace(plain_model(states, f[0], B), W=matrix_of(W, ()), rate=Fraction(rate))
    M = np.linalg.inv(weights)
    return System(model=model, h_terms=h[0], f=f[1], h=h[1], B=rows, M=M, rate=float(Fraction(rate)))


ONE_INPUT = system(
    ("x1", "x2"),
    f=(F_TWO, lambda x: np.array([-x[0] + 2 * x[1], -0.25 * x[1] ** 3 - 3 * x[0] + 4 * x[1]])),
    B=[["1/2"], ["-2"]],
    W=W_TWO,
    rate="1.74",
    h=((2 * sin(2 * T) + Fraction(1, 10) * X,), lambda t, x: np.array([2 * np.sin(2 * t) + 0.1 * x[0]])),
)
TWO_INPUTS = system(
    ("x1", "x2", "x3"),
    f=(
        ("-x1 + x2", "sin(x1) - x2 + x3", "x1*x2 - 1/2*x3"),
        lambda x: np.array([-x[0] + x[1], np.sin(x[0]) - x[1] + x[2], x[0] * x[1] - 0.5 * x[2]]),
    ),
    B=[["0", "0"], ["1", "1/2"], ["-1/4", "2"]],
    W=[["1", "-1/2", "0"], ["-1/2", "1", "0"], ["0", "0", "1"]],
    rate="1/2",
    h=(
        (sin(3 * T) + Fraction(1, 5) * Y, cos(2 * T) - Fraction(1, 5) * X),
        lambda t, x: np.array([np.sin(3 * t) + 0.2 * x[1], np.cos(2 * t) - 0.2 * x[0]]),
    ),
)


def course(case, inputs, span):
    """Knots (t, x, u) of a held u*: the states between are integrated, and rounded to decimals."""
    t, x = np.round(np.arange(len(inputs) + 1) * span, 9), [np.full(len(case.B), 0.1)]
    for u in inputs:
        done = solve_ivp(lambda _, z, u=u: case.f(z) + case.B @ u, (0, span), x[-1], rtol=1e-10, atol=1e-12)
        x.append(np.round(done.y[:, -1], 8))
    return t, np.array(x), np.array([*inputs, inputs[-1]])


def exact(rows):
    return tuple(tuple(Fraction(repr(float(e))) for e in row) for row in rows)


def planned(case, t, x, u):
    knots = Knots(t=exact([t])[0], x=exact(x), u=exact(u), interpolation="hold")
    return piecewise_plan(case.model, knots)


def hermite(case, t, x, u):
    """x* in piece k: the cubic through both knots with the slopes of the dynamics under that piece's u*."""

    def at(k, now):
        length = t[k + 1] - t[k]
        s = (now - t[k]) / length
        a, b = (case.f(z) + case.B @ u[k] for z in (x[k], x[k + 1]))
        ends = (1 + 2 * s) * (1 - s) ** 2 * x[k] + s**2 * (3 - 2 * s) * x[k + 1]
        return ends + s * (1 - s) ** 2 * length * a - s**2 * (1 - s) * length * b

    return at


def feedback(case, x, x_star, u_star):
    """The QP in closed form: geodesics of a constant metric are segments."""
    step = x - x_star
    m = case.M @ step
    ahead = case.f(x) + case.B @ u_star - case.f(x_star) - case.B @ u_star
    phi0, phi1 = 2 * m @ ahead + 2 * case.rate * step @ m, 2 * case.B.T @ m
    return -phi0 * phi1 / (phi1 @ phi1) if phi0 > 0 else np.zeros(len(phi1))


class Reference:
    """z = (x, xtilde, sigma_hat, u_a), integrated from one jump or switch to the next."""

    def __init__(self, case, controller, gains, knots):
        self.case, self.controller, self.gains = case, controller, gains
        self.knots, self.curve = knots, hermite(case, *knots)
        self.n, self.m = case.B.shape
        self.sliding = False

    def split(self, z):
        n, m = self.n, self.m
        return np.split(z, [n, 2 * n, 2 * n + m])

    def push(self, z):
        _, xt, _, _ = self.split(z)
        return -self.case.B.T @ xt

    def derivative(self, k):
        case, gains = self.case, self.gains

        def rate(t, z):
            x, xt, s, u = self.split(z)
            h = case.h(t, x)
            u_star = self.knots[2][k]
            applied = u_star + feedback(case, x, self.curve(k, t), u_star) + u + h
            out = np.zeros_like(z)
            dx, dxt, ds, du = self.split(out)
            dx[:] = case.f(x) + case.B @ applied
            if self.controller == "ccm":
                return out
            dxt[:] = -gains.predictor_gain * xt + case.B @ (s - h)
            du[:] = -gains.bandwidth * (u + s)
            ds[:] = gains.adaptation_rate * self.projected(s, self.push(z))
            return out

        return rate

    def projected(self, s, y):
        nu, R = self.gains.smooth, self.gains.projection_radius
        if nu is not None:
            F = ((1 + nu) * s @ s - R**2) / (nu * R**2)
            return y - F * s * (s @ y) / (s @ s) if F > 0 and y @ s > 0 else y
        return y - s * (s @ y) / (s @ s) if self.sliding else y

    def run(self, start, times):
        """z at the times (K, .)."""
        horizon, knots = times[-1], self.knots[0]
        marks = np.unique(np.round([*times, *knots[knots < horizon]], 12))
        z = np.zeros(2 * self.n + 2 * self.m)
        z[: self.n] = start
        rows = {}
        for a, b in pairwise([*marks, horizon + 1]):
            rows[a] = z.copy()
            if b > horizon:
                break
            k = int(np.searchsorted(knots, 0.5 * (a + b))) - 1
            z = self.between(k, a, b, z)
        return np.array([rows[np.round(t, 12)] for t in times])

    def between(self, k, a, b, z):
        """From a to b within one piece; a hard projection switches where its sphere is met and left."""

        def meets(t, z):
            return np.linalg.norm(self.split(z)[2]) - self.gains.projection_radius

        def leaves(t, z):
            return self.split(z)[2] @ self.push(z)

        meets.terminal = leaves.terminal = True
        meets.direction, leaves.direction = 1, -1
        hard = self.controller == "l1" and self.gains.smooth is None
        smooth = {"max_step": 1e-3} if self.controller == "l1" and not hard else {}
        while a < b:
            events = ([leaves] if self.sliding else [meets]) if hard else None
            accurate = {"method": "DOP853", "rtol": 1e-10, "atol": 1e-11, "events": events, **smooth}
            done = solve_ivp(self.derivative(k), (a, b), z, **accurate)
            assert done.success
            a, z = done.t[-1], done.y[:, -1].copy()
            if done.status == 1:
                self.sliding = not self.sliding
                s = self.split(z)[2]
                s *= self.gains.projection_radius / np.linalg.norm(s) * (1 - (0 if self.sliding else 1e-12))
        return z


def compared(case, loop, inputs, *, span, K, tolerance=1e-5):
    """Our runs and the reference at K times over the whole plan; `loop` is a controller and its gains."""
    controller, gains = loop
    knots = course(case, inputs, span)
    horizon = float(knots[0][-1])
    times, plan = np.linspace(0, horizon, K), planned(case, *knots)
    problem = Problem(model=case.model, plan=plan, horizon=horizon, times=times, S=np.eye(len(case.B)))
    start = knots[1][0] + np.linspace(0.2, -0.1, len(case.B))
    disturbance = Disturbance.from_expressions(case.h_terms, case.model, 1)
    found = alone(
        (problem, Loop(controller=controller, gains=gains)), start[None], disturbance, tolerance=tolerance
    )
    assert not found.found.stopped.any()
    assert found.error[0] <= 5 * tolerance
    return found, Reference(case, controller, gains, knots).run(start, times)


def agree(found, expected, fast=1e-4):
    """x to what is told, xtilde to 5e-5; sigma_hat to Gamma times less."""
    n, m = found.x.shape[2], found.u_a.shape[2]
    x, xt, s, u = np.split(expected, [n, 2 * n, 2 * n + m], axis=1)
    assert np.abs(found.x[0] - x).max() <= min(found.error[0], 5e-5)
    assert np.abs(found.xtilde[0] - xt).max() < 5e-5
    assert np.abs(found.u_a[0] - u).max() < 5e-4
    assert np.abs(found.sigma_hat[0] - s).max() < fast


JUMPS = [np.array([u]) for u in (1.0, -0.5, 2.0, 0.0, -1.5, 0.7)]
L1 = LoopGains(bandwidth=20.0, projection_radius=50.0, predictor_gain=2.0, adaptation_rate=2e4)


@pytest.mark.slow
@pytest.mark.parametrize(("controller", "gains"), [("ccm", None), ("l1", L1)], ids=["ccm", "l1"])
def test_inputs_that_jump_at_knots(controller, gains):
    """Knots and output times are incommensurable here."""
    found, expected = compared(ONE_INPUT, (controller, gains), JUMPS, span=0.13, K=8)
    assert np.ptp(found.u_plan[:, 0]) > 2
    agree(found, expected)


PAIRS = [np.array(u) for u in ((0.3, -0.2), (-0.4, 0.5), (0.2, 0.1))]


@pytest.mark.slow
def test_one_input_whose_estimate_comes_to_its_ends():
    gains = LoopGains(bandwidth=10.0, projection_radius=1.0, predictor_gain=2.0, adaptation_rate=400.0)
    found, expected = compared(ONE_INPUT, ("l1", gains), JUMPS, span=0.3, K=41)
    agree(found, expected, fast=5e-4)
    assert 5 < (np.abs(found.sigma_hat) > 1 - 1e-9).sum() < 41
    assert np.abs(found.sigma_hat).max() <= 1 + 1e-9


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [None, 0.2], ids=["hard", "smooth"])
def test_two_inputs_whose_estimate_slides_along_the_ball(smooth):
    gains = LoopGains(
        bandwidth=10.0, projection_radius=RADIUS, predictor_gain=2.0, adaptation_rate=300.0, smooth=smooth
    )
    found, expected = compared(TWO_INPUTS, ("l1", gains), PAIRS, span=0.5, K=31)
    agree(found, expected, fast=5e-4)
    size = np.linalg.norm(found.sigma_hat[0], axis=1)
    assert size.max() <= RADIUS * (1 + 1e-9)
    at_rim = size > (RADIUS * (1 - 1e-9) if smooth is None else RADIUS / np.sqrt(1.2))
    assert 5 < at_rim.sum() < len(size)
    angle = np.unwrap(np.arctan2(*found.sigma_hat[0][at_rim].T))
    assert np.ptp(angle) > 0.5  # along the rim, not only at one place


@pytest.mark.slow
def test_tolerances_are_kept_where_inputs_jump():
    """The error estimate is no smaller than the error."""
    for tolerance in (1e-3, 1e-5):
        found, expected = compared(ONE_INPUT, ("l1", L1), JUMPS, span=0.13, K=8, tolerance=tolerance)
        assert np.abs(found.x[0] - expected[:, :2]).max() <= max(found.error[0], 1e-9)


@pytest.mark.slow
def test_no_run_of_a_sliding_estimate_is_further_off_than_it_tells():
    """20 runs of one vector, from starts of their own, to the accuracy that campaigns ask for."""
    gains = LoopGains(bandwidth=10.0, projection_radius=RADIUS, predictor_gain=2.0, adaptation_rate=300.0)
    knots = course(TWO_INPUTS, PAIRS[:2], 0.4)
    times = np.linspace(0, 0.8, 5)
    problem = Problem(
        model=TWO_INPUTS.model, plan=planned(TWO_INPUTS, *knots), horizon=0.8, times=times, S=np.eye(3)
    )
    starts = knots[1][0] + np.random.default_rng(1).uniform(-0.4, 0.4, (20, 3))
    found = alone(
        (problem, Loop(controller="l1", gains=gains)),
        starts,
        Disturbance.from_expressions(TWO_INPUTS.h_terms, TWO_INPUTS.model, 20),
        tolerance=1e-3,
    )
    slid = 0
    for lane, start in enumerate(starts):
        expected = Reference(TWO_INPUTS, "l1", gains, knots).run(start, times)
        wrong = np.linalg.norm(found.x[lane] - expected[:, :3], axis=1).max()
        assert wrong <= found.error[lane] <= 5e-3
        slid += np.linalg.norm(found.sigma_hat[lane, 1:], axis=1).max() > RADIUS * (1 - 1e-9)
    assert slid == 20

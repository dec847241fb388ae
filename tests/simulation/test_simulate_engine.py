"""The integrator against scipy's DOP853 on right-hand sides written here in numpy, and against its own orders."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from simulated import alone
from systems import plain_model
from texts import CONFIGS

from tubecert.expression import constant, sin, symbol
from tubecert.model import ControlAffineModel, build
from tubecert.simulation.adaptive.engine import Vector, integrate
from tubecert.simulation.adaptive.loops import Cases, Disturbance, Loop, LoopGains, Problem, of_some
from tubecert.simulation.adaptive.times import output_times
from tubecert.spec import Knots, load_text
from tubecert.trajectory.pieces import piecewise_plan
from tubecert.trajectory.plan import constant_plan

X, Y, T = symbol("x1"), symbol("x2"), symbol("t")
W2 = np.array([[4.25828, -0.93423], [-0.93423, 3.76692]])
RATE = 1.74


def spec_model(name):
    return build(load_text((CONFIGS / name).read_text(encoding="utf-8"), name))


TWO = spec_model("two_state_orbit.yaml")
PLAN = constant_plan([Fraction(0)] * 2, [Fraction(0)], None)


def wavy_h():
    return (2 * sin(2 * T) + Fraction(1, 10) * X,)


def drift(x):
    return np.array([-x[0] + 2 * x[1], -0.25 * x[1] ** 3 - 3 * x[0] + 4 * x[1]])


B2 = np.array([[0.5], [-2.0]])


def least(phi0, phi1):
    """The QP in closed form."""
    return -phi0 * phi1 / (phi1 @ phi1) if phi0 > 0 else np.zeros(1)


def h2(t, x):
    return np.array([2 * np.sin(2 * t) + 0.1 * x[0]])


def problem(controller, horizon=2.0, K=5, model=TWO, *, plan=PLAN, gains=None, **options):
    options = {"S": np.eye(len(model.states)), "times": np.linspace(0, horizon, K)} | options
    own = Problem(model=model, plan=plan, horizon=horizon, **options)
    return own, Loop(controller=controller, gains=gains)


def projection(s, y, gains):
    """Proj(s, y) of the theory, smooth; no loop here comes to the radius of a hard one."""
    if gains.smooth is None:
        return y
    nu, R = gains.smooth, gains.projection_radius
    F = ((1 + nu) * s @ s - R**2) / (nu * R**2)
    return y - F * s * (s @ y) / (s @ s) if F > 0 and y @ s > 0 else y


def loop(controller, gains, *, f, B, k, h):
    """z' in numpy: z = (x, xtilde, sigma_hat, u_a) as far as the loop has them."""

    def rate(t, z):
        b, disturbance = B(z), h(t, z)
        own = f(t, z[:2]) + b @ k(t, z[:2])
        if controller == "nominal":
            return own
        if controller == "ccm":
            return own + b @ disturbance
        if controller == "reference":
            return np.concatenate([own + b @ (z[2:] + disturbance), -gains.bandwidth * (z[2:] + disturbance)])
        xt, s, u = z[2:4], z[4:5], z[5:6]
        predicted = -gains.predictor_gain * xt + b @ (s - disturbance)
        ds = gains.adaptation_rate * projection(s, -b.T @ xt, gains)
        return np.concatenate([own + b @ (u + disturbance), predicted, ds, -gains.bandwidth * (u + s)])

    return rate


def right_hand_side(controller, gains, f=lambda t, x: drift(x)):
    """The loops of the two-state system, whose metric is constant, about the plan 0."""

    def k(t, x):
        m = np.linalg.inv(W2) @ x
        return least(2 * m @ (f(t, x) - f(t, 0 * x)) + 2 * RATE * m @ x, 2 * B2.T @ m)

    return loop(controller, gains, f=f, B=lambda x: B2, k=k, h=h2)


def dop853(rate, z0, t, tolerance=1e-11, **options):
    options |= {"method": "DOP853", "t_eval": t, "rtol": tolerance, "atol": tolerance}
    done = solve_ivp(rate, (t[0], t[-1]), z0, **options)
    assert done.success
    return done.y.T


START = np.array([[0.4, -0.3]])
SIZES = {"nominal": 0, "ccm": 0, "reference": 1, "l1": 4}


@pytest.mark.slow
@pytest.mark.parametrize("controller", SIZES)
def test_loops_agree_with_dop853(controller):
    gains = LoopGains(bandwidth=25.0, projection_radius=50.0, predictor_gain=2.0, adaptation_rate=4e4)
    case = problem(controller, gains=gains)
    z0 = np.concatenate([START[0], np.zeros(SIZES[controller])])
    expected = dop853(right_hand_side(controller, gains), z0, case[0].times)
    found = alone(case, START, Disturbance.from_expressions(wavy_h(), TWO, 1), tolerance=1e-5)
    assert not found.found.stopped.any()
    assert np.abs(found.x[0] - expected[:, :2]).max() <= found.error[0] <= 5e-5
    if controller == "l1":
        assert np.abs(found.xtilde[0] - expected[:, 2:4]).max() < 1e-5
        assert np.abs(found.sigma_hat[0] - expected[:, 4:5]).max() < 1e-4
        assert np.abs(found.u_a[0] - expected[:, 5:6]).max() < 1e-5
    size = [np.sqrt(x @ np.linalg.inv(W2) @ x) for x in found.x[0]]
    assert np.allclose(found.distance[0], size, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["ccm", "l1"])
@pytest.mark.parametrize("radius", [50.0, 1.0])
def test_a_wind_moves_the_state_and_not_what_is_predicted(controller, radius):
    """x' = ... + E w, so xtilde' = ... - E w; with the smaller radius the projection works."""
    gains = LoopGains(
        bandwidth=10.0, projection_radius=radius, predictor_gain=2.0, adaptation_rate=400.0, smooth=0.2
    )
    E, f = np.array([0.4, -0.7]), right_hand_side(controller, gains)

    def rate(t, z):
        blown = np.clip(3 * np.sin(2 * t + 0.4), -1, 1) * E
        return f(t, z) + np.concatenate([blown, -blown, np.zeros(2)])[: len(z)]

    z0 = np.concatenate([START[0], np.zeros(SIZES[controller])])
    case = problem(controller, gains=gains, E=tuple((constant(Fraction(repr(float(e)))),) for e in E))
    expected = dop853(rate, z0, case[0].times, max_step=1e-3)
    h = Disturbance.from_expressions(wavy_h(), TWO, 1)
    blowing = {"wind": 1.0, "blowing": [1.0], "gusting": [2.0, 0.4]}
    h = h._replace(**{name: np.array([value]).T for name, value in blowing.items()})
    found = alone(case, START, h, tolerance=1e-5)
    assert np.abs(found.x[0] - expected[:, :2]).max() <= found.error[0] <= 5e-5
    if controller == "l1":
        assert np.abs(found.xtilde[0] - expected[:, 2:4]).max() < 2e-5
        assert np.abs(found.sigma_hat[0] - expected[:, 4:5]).max() < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("aim", [1, 2])
def test_a_wind_that_aims(aim):
    """Along E'M x, or along E'B c with c = B'M x, but for a thin layer where that turns round."""
    E, M, f = np.array([[0.4, 0.1], [-0.7, 0.2]]), np.linalg.inv(W2), right_hand_side("ccm", None)

    def rate(t, z):
        v = M @ z if aim == 1 else B2 @ (B2.T @ M @ z)
        w = E.T @ v
        return f(t, z) + E @ w / np.sqrt(w @ w + (0.05 * 2.0) ** 2) * 0.5

    case = problem("ccm", E=tuple(tuple(constant(Fraction(repr(float(e)))) for e in row) for row in E))
    h = Disturbance.from_expressions(wavy_h(), TWO, 1)._replace(layer=np.array([2.0]))
    blowing = {"wind": 0.5, "aim": float(aim), "blowing": [0.0, 0.0], "gusting": [0.0, np.pi / 2]}
    h = h._replace(**{name: np.array([value]).T for name, value in blowing.items()})
    found = alone(case, START, h, tolerance=1e-5)
    assert np.abs(found.x[0] - dop853(rate, START[0], case[0].times)).max() <= found.error[0] <= 5e-5


def scalar(f, B):
    """One state; W = B^2 satisfies C3 for every B(x)."""
    return ControlAffineModel(
        states=("x1",), inputs=("u",), f=(f,), B=((B,),), W=((B * B,),), rate=Fraction(1), h=None
    )


def levels(case, x0, h, count):
    """x at the output times (K, n) for one level of steps after the other."""
    vector = Vector([(*case, Cases(x0.T, Disturbance.from_expressions(h, case[0].model, 1)))])
    return [vector.run(vector.steps(j), np.arange(1)).seen.x[..., 0] for j in range(count)]


ORIGIN = constant_plan([Fraction(0)], [Fraction(0)], None)
STEADY = X + Fraction(1, 2) * sin(X)
SMOOTH_H = (sin(2 * T) + Fraction(3, 10) * sin(X),)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("controller", "B", "rate", "least"),
    [
        ("ccm", constant(1), 1.0, 3.8),
        ("reference", constant(1), 1.0, 3.8),
        ("l1", constant(1), 100.0, 3.8),
        ("l1", 2 + sin(X), 100.0, 1.9),
    ],
)
def test_steps_have_order_four_and_two_where_B_moves(controller, B, rate, least):
    """A system whose feedback has no kinks; Gamma such that the steps resolve the oscillation."""
    gains = LoopGains(bandwidth=5.0, projection_radius=50.0, predictor_gain=2.0, adaptation_rate=rate)
    case = problem(controller, horizon=4.0, model=scalar(STEADY, B), plan=ORIGIN, gains=gains)
    found = levels(case, np.array([[0.5]]), SMOOTH_H, 5)
    errors = [np.abs(x - found[-1]).max() for x in found[:3]]
    order = np.log2(errors[0] / errors[2]) / 2
    assert order > least, (order, errors)


@pytest.mark.slow
def test_steps_far_longer_than_the_oscillation_are_accurate():
    """Gamma 1e10 turns 6000 rad in the longest step; the error is that of the slow part."""
    gains = LoopGains(bandwidth=5.0, projection_radius=50.0, predictor_gain=2.0, adaptation_rate=1e10)
    case = problem("l1", horizon=4.0, model=scalar(STEADY, constant(1)), plan=ORIGIN, gains=gains)
    found = levels(case, np.array([[0.5]]), SMOOTH_H, 4)
    errors = [np.abs(x - found[-1]).max() for x in found[:3]]
    assert errors[0] < 1e-4
    assert errors[2] < errors[0] / 30, errors


SLANTED = spec_model("state_dependent_input.yaml")


def flat(x2):
    """int_0^x2 ds/(2 + sin s)."""

    def primitive(s):
        return 2 / np.sqrt(3) * np.arctan((2 * np.tan(s / 2) + 1) / np.sqrt(3))

    return primitive(x2) - primitive(0.0)


def slanted_rate(controller, gains):
    """The loops of the system with B = (0, 2 + sin x2): its metric is constant in (x1, flat(x2))."""
    Mz = np.linalg.inv(np.array([[1.0, -0.5], [-0.5, 1.0]]))

    def B(x):
        return np.array([[0.0], [2 + np.sin(x[1])]])

    def f(t, x):
        return np.array([-x[0] + x[1], 0.5 * x[0] - x[1] + 0.1 * x[0] * x[1]])

    def k(t, x):
        dz = np.array([x[0], flat(x[1])])
        m = np.array([1.0, 1 / B(x)[1, 0]]) * (Mz @ dz)
        return least(2 * m @ f(t, x) + 2 * 1.5 * dz @ Mz @ dz, 2 * B(x).T @ m)

    def h(t, x):
        return np.array([0.2 * np.cos(t) + 0.1 * x[0]])

    return loop(controller, gains, f=f, B=B, k=k, h=h)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["reference", "l1"])
def test_state_dependent_inputs_agree_with_dop853(controller):
    gains = LoopGains(bandwidth=10.0, projection_radius=5.0, predictor_gain=4.0, adaptation_rate=2000.0)
    case = problem(controller, model=SLANTED, gains=gains)
    start = np.array([[0.2, -0.25]])
    z0 = np.concatenate([start[0], np.zeros(SIZES[controller])])
    expected = dop853(slanted_rate(controller, gains), z0, case[0].times)
    found = alone(case, start, Disturbance.from_expressions(SLANTED.h, SLANTED, 1), tolerance=1e-5)
    assert not found.found.stopped.any()
    assert np.abs(found.x[0] - expected[:, :2]).max() <= found.error[0] <= 5e-5
    assert found.distance[0, 0] == pytest.approx(
        np.sqrt(np.array([0.2, flat(-0.25)]) @ np.linalg.solve([[1, -0.5], [-0.5, 1]], [0.2, flat(-0.25)])),
        rel=1e-9,
    )


@pytest.mark.slow
def test_lanes_do_not_know_each_other():
    """Many lanes give what each gives alone, whatever the others do; a diverging one is stopped and named."""
    rng, N, n, m = np.random.default_rng(1), 40, 2, 1
    starts = rng.uniform(-0.3, 0.3, (N, n))
    starts[7] = [1e5, 1e5]
    d = Disturbance.from_expressions(None, UNSTABLE, N)._replace(
        amplitude=rng.normal(size=(2, m, N)),
        frequency=rng.uniform(0, 5, (2, N)),
        wave=rng.normal(size=(2, n, N)),
        phase=rng.uniform(0, 6, (2, N)),
        push=rng.uniform(0, 0.5, N),
        radius=np.full(N, 1.5),
    )
    d.push[7] = 0.0
    gains = LoopGains(bandwidth=20.0, projection_radius=3.0, predictor_gain=2.0, adaptation_rate=1e4)
    case = problem("l1", model=UNSTABLE, gains=gains, horizon=1.0)
    vector = alone(case, starts, d, tolerance=1e-5)
    assert np.flatnonzero(vector.found.stopped).tolist() == [7]
    assert vector.error[7] == np.inf
    assert np.isnan(vector.x[7, -1]).all()
    assert np.nanmax(np.abs(vector.h)) <= 1.5 * (1 + 1e-12)
    for lane in (0, 39):
        own = alone(case, starts[[lane]], of_some(d, np.array([lane])), tolerance=1e-5)
        assert np.allclose(own.x[0], vector.x[lane], rtol=0, atol=1e-12)  # BLAS sums in another order
        assert own.found.peak.distance[0] == pytest.approx(vector.found.peak.distance[lane], abs=1e-12)


# x1' = x2 + 0.1 x1^3 escapes in finite time from far away
UNSTABLE = replace(
    plain_model(("x1", "x2"), ("-x1 + x2 + x1**3", "-x2"), [["0"], ["1"]]),
    W=((constant(1), constant(0)), (constant(0), constant(1))),
    rate=Fraction(1, 10),
)


@pytest.mark.slow
def test_disturbances_are_what_they_say():
    """h at the output times, recomputed from its parts."""
    waves = {
        "amplitude": np.array([[[0.3]], [[0.2]]]),
        "frequency": np.array([[1.0], [3.0]]),
        "wave": np.array([[[0.5], [0.0]], [[0.0], [-1.0]]]),
        "phase": np.array([[0.1], [0.7]]),
    }
    others = {"push": 0.4, "radius": 0.6, "layer": 0.05}
    d = Disturbance.from_expressions((X * Fraction(1, 2),), TWO, 1)._replace(
        **waves, **{name: np.array([value]) for name, value in others.items()}
    )
    case = problem("ccm", K=9)
    found = alone(case, START, d, tolerance=1e-6)
    M = np.linalg.inv(W2)
    clipped = 0
    for t, x, h in zip(found.t, found.x[0], found.h[0], strict=True):
        c = B2[:, 0] @ M @ x
        value = 0.5 * x[0] + 0.3 * np.sin(t + 0.5 * x[0] + 0.1)
        value += 0.2 * np.sin(3 * t - x[1] + 0.7) + 0.4 * c / np.sqrt(c * c + 0.05**2)
        clipped += abs(value) > 0.6
        assert h[0] == pytest.approx(np.clip(value, -0.6, 0.6), abs=1e-12)
    assert 0 < clipped < 9


@pytest.mark.slow
def test_errors_are_measured_in_the_coordinates_of_the_tube():
    """A narrow tube in one state asked for its own accuracy of all states, in whatever unit these are."""
    S = np.array([[30.0, 0.0], [2.0, 0.5]])
    still = Disturbance.from_expressions(wavy_h(), TWO, 1)
    plain, own = (alone(problem("ccm", S=own), START, still, tolerance=1e9) for own in (np.eye(2), S))
    assert own.x == pytest.approx(plain.x, abs=1e-13)
    change = own.error[0] / plain.error[0]
    assert np.linalg.norm(S, -2) < change < np.linalg.norm(S, 2)
    assert change > 2


X_ROWS, U_ROWS = ("0 0", "1/5 1/10", "1/10 0"), ("0", "3/10", "3/10")


@pytest.mark.slow
def test_loops_along_several_plans_are_lanes_of_one_vector():
    """Two loops and two plans, with corners and jumps of their own: as each gives alone, but for their steps."""
    gains = LoopGains(bandwidth=25.0, projection_radius=3.0, predictor_gain=2.0, adaptation_rate=4e3)
    plans = [PLAN]
    for times in (("0", "0.71", "2"), ("0", "1.3", "2")):
        t, x, u = (
            tuple(tuple(Fraction(e) for e in row.split()) for row in part) for part in (times, X_ROWS, U_ROWS)
        )
        plans.append(piecewise_plan(TWO, Knots(t=tuple(e for (e,) in t), x=x, u=u, interpolation="hold")))
    still = Disturbance.from_expressions(wavy_h(), TWO, 1)
    batches = [
        (*problem(name, plan=plan, gains=gains), Cases(np.asarray(START).T, still))
        for plan in plans
        for name in ("ccm", "l1")
    ]
    for found, batch in zip(integrate(batches, tolerance=1e-5), batches, strict=True):
        (own,) = integrate([batch], tolerance=1e-5)
        assert np.abs(own.x - found.x).max() <= own.error[0] + found.error[0] <= 1e-4
        assert np.array_equal(own.x_plan, found.x_plan)
        assert np.array_equal(own.u_plan, found.u_plan)


@pytest.mark.parametrize(("knots", "count"), [(100, 251), (300, 301), (1000, 335)])
def test_output_times_are_corners_of_a_plan_that_has_many(knots, count):
    """So that both are ends of the same steps; of 1000 corners every third."""
    t = tuple(Fraction(2 * i, knots) for i in range(knots + 1))
    rows = tuple((Fraction(0), Fraction(0)) for _ in t)
    plan = piecewise_plan(
        TWO, Knots(t=t, x=rows, u=tuple((Fraction(i % 2),) for i in range(len(t))), interpolation="hold")
    )
    found = output_times(plan, 2.0)
    assert (len(found), found[0], found[-1]) == (count, 0.0, 2.0)
    assert (np.diff(found) > 0).all()
    if knots >= 250:
        assert np.abs(found * knots / 2 - np.round(found * knots / 2)).max() < 1e-9


@pytest.mark.slow
def test_an_f_that_depends_on_time_agrees_with_dop853():
    """Plan at 0, where f(t, 0) is not 0: predictor, feedback and plant see the same f(t, x)."""
    model = replace(TWO, f=(TWO.f[0] + sin(3 * T), TWO.f[1] + T * Fraction(1, 2)), time=(0, 2))
    gains = LoopGains(bandwidth=25.0, projection_radius=50.0, predictor_gain=2.0, adaptation_rate=4e2)

    rate = right_hand_side("l1", gains, lambda t, x: drift(x) + np.array([np.sin(3 * t), 0.5 * t]))
    case = problem("l1", horizon=1.0, model=model, gains=gains)
    expected = dop853(rate, np.concatenate([START[0], np.zeros(4)]), case[0].times)
    found = alone(case, START, Disturbance.from_expressions(wavy_h(), model, 1), tolerance=1e-5)
    assert not found.found.stopped.any()
    assert np.abs(found.x[0] - expected[:, :2]).max() <= found.error[0] <= 5e-5
    assert np.abs(found.xtilde[0] - expected[:, 2:4]).max() < 1e-5

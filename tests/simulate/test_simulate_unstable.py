"""Loops that are unstable: said in words and in time, not after minutes of smaller and smaller steps (U10)."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from simulated import setting
from tubecert.simulate.held import growth, least_rate

from tubecert.expression import as_expression, sin, symbol
from tubecert.model import ControlAffineModel
from tubecert.report.simulation import report, verdict_line
from tubecert.simulate.campaign import simulate
from tubecert.simulate.compare import compare
from tubecert.simulate.integrator import integrate
from tubecert.simulate.problem import Disturbance, LoopGains, LoopProblem
from tubecert.simulate.summary import summary
from tubecert.simulate.told import outcome
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.trajectory import constant_plan

T, X, Y = symbol("t"), symbol("x1"), symbol("x2")
PLAN = constant_plan([0, 0], [0], None)
FAST = LoopGains(bandwidth=30.0, projection_radius=0.6, predictor_gain=30.0, adaptation_rate=4e4)


def loop(controller="l1", *, f=(Y, -X - Y), gains=FAST, rate=100.0, horizon=10.0, limit=np.inf):
    rows = ((as_expression(0),), (as_expression(1),))
    W = (
        (as_expression(1), as_expression(Fraction(-1, 2))),
        (as_expression(Fraction(-1, 2)), as_expression(1)),
    )
    model = ControlAffineModel(
        states=("x1", "x2"), inputs=("u",), f=f, B=rows, W=W, rate=Fraction(2, 5), h=None
    )
    return LoopProblem(
        model=model,
        plan=PLAN,
        controller=controller,
        horizon=horizon,
        times=np.linspace(0, horizon, 101),
        gains=gains,
        control_rate=rate,
        limit=limit,
    )


def run(problem, start=(0.1, 0.0), tolerance=1e-3):
    h = Disturbance.from_expressions((Fraction(1, 2) * sin(3 * T),), problem.model, 1)
    return integrate(problem, np.array([start]), h, tolerance=tolerance)


@pytest.mark.slow
def test_growth_is_that_of_the_loop_step_by_step():
    rng = np.random.default_rng(3)
    A, B, dt, Gamma = -2 * np.eye(3), rng.normal(size=(3, 2)), 0.01, 50.0
    z, grown, count = rng.normal(size=5), 0.0, 20_000
    for _ in range(count):
        xt, s = z[:3], z[3:]
        xt = xt + dt * (A @ xt + B @ s)
        z = np.concatenate([xt, s - dt * Gamma * B.T @ xt])
        size = np.linalg.norm(z)
        z, grown = z / size, grown + np.log(size)
    assert growth(A, B, Gamma, dt) == pytest.approx(np.exp(grown / count), rel=1e-3)


def test_the_least_rate_is_where_growth_begins():
    A, B = -30 * np.eye(2), np.array([[0.0], [1.0]])
    least = least_rate(A, B, 4e4, 50.0)
    assert growth(A, B, 4e4, 1 / least) <= 1 < growth(A, B, 4e4, 1 / (0.99 * least))
    assert least == pytest.approx(np.sqrt(4e4) / 2, rel=0.2)  # dt sqrt(Gamma) |B| < 2, moved by A_m
    assert least_rate(np.eye(2), B, 1.0, 1.0) == np.inf


@pytest.mark.slow
def test_an_adaptation_that_bounces_is_given_up_early():
    """Every level of steps gives another run: the integrator went on to 2^14 times as many steps."""
    found = run(loop())
    assert not found.failures
    assert found.error[0] > 1e-3
    assert found.steps[0] <= 1000 * 2**4
    assert 0 < found.unresolved[0] < 5
    stable = run(loop(rate=400.0))
    assert stable.error[0] <= 1e-3
    assert np.isnan(stable.unresolved[0])


@pytest.mark.slow
def test_a_state_beyond_the_limit_is_not_followed():
    """At 0.1 Hz nothing stabilises x1'' = 9 x1: |x - x*| grows like e^(3 t)."""
    free = (Y, 9 * X)
    near, far = (run(loop("ccm", f=free, rate=0.1, horizon=6.0, limit=limit)) for limit in (2.0, 200.0))
    ends = []
    for found, limit in ((near, 2.0), (far, 200.0)):
        (failure,) = found.failures
        assert f"|x - x*| exceeds {limit:g}" in failure.reason
        assert limit / 3 < found.worst.deviation.value[0] <= limit
        assert np.isnan(found.x[0, found.t > failure.t + 0.1]).all()
        ends.append(failure.t)
    assert ends[0] < ends[1] < 6
    assert np.log(200 / 2) / 3 == pytest.approx(ends[1] - ends[0], rel=0.15)


@pytest.mark.slow
def test_a_state_that_is_no_number_is_not_followed():
    found = run(loop("ccm"), start=(np.nan, 0.0))
    (failure,) = found.failures
    assert failure.t == 0
    assert failure.reason == "the state diverges from the plan"


# what the user is told


def thinner(where, factor):
    """The setting with a tube that is thinner than it was certified."""
    own = where.certified
    return replace(where, certified=replace(own, rho=own.rho / factor, reach=own.reach / factor))


def words_of(campaign):
    data = summary(campaign, "none")
    parts = [verdict_line(data), *report(data, folder="x", files=1, verbose=False)]
    return data.to_json(), "\n".join(
        getattr(part, "plain", getattr(getattr(part, "renderable", None), "plain", "")) for part in parts
    )


@pytest.mark.slow
def test_an_adaptation_that_is_unstable_at_its_rate_is_told_and_not_attacked():
    where = setting("flat")
    thin = thinner(where, 9)
    chosen = Choice(adaptation_rate=Fraction(66_000), bandwidth=Fraction(30))
    unstable = loop_of(thin, "l1", chosen, Fraction(100))
    assert "is unstable at 100 Hz: it needs 129.1 Hz" in unstable.caution
    found = simulate(thin, [unstable], count=4, seed=0)
    assert outcome(found) == "no result"
    assert not found.attacks
    data, words = words_of(found)
    assert data["loops"][0]["caution"] == unstable.caution
    since = data["loops"][0]["unresolved"][0]["t"]
    assert 0 < since < 4
    assert unstable.caution in words
    assert f"from t = {since:.4g} s on the run depends on the steps" in words
    assert loop_of(where, "l1", Choice(), Fraction(1000)).caution == ""
    assert loop_of(where, "ccm", Choice(), Fraction(1)).caution == ""


@pytest.mark.slow
def test_when_the_tube_is_left_is_told():
    where = setting("flat")
    steep = thinner(where, 50)
    drawn = loop_of(steep, "l1", Choice(bandwidth=Fraction(1, 10), adaptation_rate=Fraction(1)))
    found = simulate(steep, [drawn], count=0, seed=0)
    lane, time = found.drawn[0].comparison.first_exit
    runs = found.drawn[0].runs
    outside = (runs.distance[0] > steep.reach) | (np.linalg.norm(runs.x[0], axis=1) > steep.rho)
    assert (lane, time) == (0, runs.t[np.argmax(outside)])
    data, words = words_of(found)
    assert data["outcome"] == "tube left"
    assert data["loops"][0]["first_exit"] == {"run": 0, "t": time}
    assert "first at t = " in words


@pytest.mark.slow
def test_a_run_in_the_tube_has_no_exit():
    where = setting("flat")
    found = simulate(where, [loop_of(where, "l1", Choice())], count=0, seed=0)
    assert found.drawn[0].comparison.first_exit is None
    assert compare(where, found.drawn[0].runs, None).unresolved == ()

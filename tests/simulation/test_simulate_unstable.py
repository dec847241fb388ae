"""Loops that leave the plan: stopped in time, and said in words (U10)."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from simulated import alone, setting
from simulated import runs as runs_by_hand
from systems import matrix_of, plain_model

from tubecert.expression import exp, symbol
from tubecert.report.simulation import page_of
from tubecert.report.terminal import Terminal
from tubecert.report.text import screen
from tubecert.simulation.adaptive.campaign import SPECIFIED, Campaign, Followed, simulate
from tubecert.simulation.adaptive.continuous import DIVERGED, reason
from tubecert.simulation.adaptive.judge import compare
from tubecert.simulation.adaptive.loops import Disturbance, Loop, Problem
from tubecert.simulation.adaptive.setting import Choice, loop_of
from tubecert.trajectory import constant_plan

T = symbol("t")
PLAN = constant_plan([0, 0], [0], None)


def loop(*, horizon=6.0, limit=1e6):
    W = matrix_of([["1", "-1/2"], ["-1/2", "1"]], ())
    plain = plain_model(("x1", "x2"), ("x2", "-x1 - x2"), [["0"], ["1"]])
    return Problem(
        model=replace(plain, W=W, rate=Fraction(2, 5)),
        plan=PLAN,
        horizon=horizon,
        times=np.linspace(0, horizon, 101),
        limit=limit,
        S=np.eye(2),
    )


def run(problem, start=(0.1, 0.0)):
    h = Disturbance.from_expressions((exp(3 * T),), problem.model, 1)
    return alone((problem, Loop(controller="ccm")), np.array([start]), h, tolerance=1e-3)


@pytest.mark.slow
def test_a_state_beyond_the_limit_is_not_followed():
    """Nothing compensates an h that grows as e^(3 t): |x - x*| grows with it."""
    near, far = (run(loop(limit=limit)) for limit in (200.0, 20_000.0))
    ends = []
    for found, limit in ((near, 200), (far, 20_000)):
        (why,), (end,) = found.found.stopped, found.found.ended
        assert f"|x - x*| exceeds {limit}" in reason(why, limit)
        assert limit / 3 < found.found.peak.deviation[0] <= limit
        assert np.isnan(found.x[0, found.t > end + 0.1]).all()
        ends.append(end)
    assert ends[0] < ends[1] < 6
    assert np.log(20_000 / 200) / 3 == pytest.approx(ends[1] - ends[0], rel=0.15)


@pytest.mark.slow
def test_a_state_that_is_no_number_is_not_followed():
    found = run(loop(), start=(np.nan, 0.0)).found
    assert (found.stopped, found.ended) == (DIVERGED, 0)


def thinner(where, factor):
    """The setting with a tube that is thinner than it was certified."""
    return replace(where, rho=where.rho / factor, reach=where.reach / factor)


def words_of(campaign):
    terminal = Terminal(stream=None, colored=False, width=200, interactive=False)
    return campaign.summary("none"), terminal.text(screen(page_of(campaign), [], verbose=False))


@pytest.mark.slow
def test_when_the_tube_is_left_is_told():
    where = setting("flat")
    steep = thinner(where, 50)
    drawn = loop_of(steep, "l1", Choice(bandwidth=Fraction(1, 10), adaptation_rate=Fraction(1)))
    found = simulate(steep, [drawn], count=0, seed=0)
    exit = found.loops[0].comparison.first_exit
    runs = found.loops[0].runs
    outside = (runs.distance[0] > steep.reach) | (np.linalg.norm(runs.x[0], axis=1) > steep.rho)
    assert (exit.run, exit.t) == (0, runs.t[np.argmax(outside)])
    data, words = words_of(found)
    assert data["outcome"] == "tube left"
    assert data["loops"][0]["first_exit"] == {"run": 0, "t": exit.t}
    assert "first at t = " in words


@pytest.mark.slow
def test_a_run_in_the_tube_has_no_exit():
    where = setting("flat")
    found = simulate(where, [loop_of(where, "l1", Choice())], count=0, seed=0)
    assert found.loops[0].comparison.first_exit is None
    assert compare(where, found.loops[0].runs, None).unresolved == ()


@pytest.mark.parametrize(
    ("error", "interrupted", "outcome", "word"),
    [
        (0.02, False, "no result", "l1: no result from t = 2.5 s on, where the run depends on the steps"),
        (0.02, True, "no result", "l1: no result from t = 2.5 s on"),
        (0.001, True, "interrupted", "interrupted flat: 1 run finished, in which d(x*, x) reached 0.5"),
        (0.001, False, "not falsified", "d(x*, x) reached 0.5 of its bound in 1 run"),
    ],
)
def test_what_is_no_result_and_what_is_missing_is_told(error, interrupted, outcome, word):
    where = setting("flat")
    own, t = loop_of(where, "l1", Choice()), np.linspace(0, 4, 41)
    still = np.zeros((1, 41, 2))
    distance = np.where(t == 4, 0.5 * where.reach, 0.0)[None]
    doubt = {
        "error": np.array([error * where.rho]),
        "unresolved": np.array([2.5 if error > 0.01 else np.nan]),
    }
    made = runs_by_hand(t, still, distance, **doubt)
    compared = compare(where, made, replace(own.promise, decay=None))
    drawn = Followed(kind="one", loop=own, runs=made, comparison=compared)
    kept = {"uncertainty": SPECIFIED, "attacks": (), "seed": 0, "interrupted": interrupted}
    data, words = words_of(Campaign(setting=where, loops=(drawn,), **kept))
    assert data["outcome"] == outcome
    assert data["loops"][0]["no_result"] == (outcome == "no result")
    assert word in words

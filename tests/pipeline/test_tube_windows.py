"""Windows from the specification to the report: what is bounded in each, what is proven, what simulation compares."""

from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import proven
import pytest
import systems
from tubecert.stages.windows import with_windows
from tubecert.trajectory.during import during

import tubecert as tc
from tubecert.pipeline import Options, question_of
from tubecert.pipeline.certification import plan, tube
from tubecert.simulate.promise import Levels
from tubecert.spec import load_text
from tubecert.stages.bounded import bound, enclose
from tubecert.stages.metric import prove_metric

F = Fraction
PLAN = """
trajectory:
  kind: expressions
  x: ["0.3*exp(-2*t)", "-0.3*exp(-2*t)"]
  u: ["0.3*exp(-2*t) - 0.3*sin(0.3*exp(-2*t))"]
  horizon: 2
"""
MOVING = (
    systems.SMALL.replace("trajectory: {kind: equilibrium, at: [0, 0], input: [0]}", PLAN.strip())
    .replace("{at: [0.05, 0]}", "{at: [0.31, -0.3]}")
    .replace("rho_a: 0.1}", "rho_a: 0.1, windows: [0.3, 0.9]}")
    + "hardware: {rate: 500, delay: 0.0005, noise: 0.0004}\nconditions: {decides: H}\n"
)


def found(text: str = MOVING):
    return proven.proven(text, bare=True)["result"]["hardware"]


@pytest.mark.slow
def test_windows_are_narrower_than_one():
    several, one = found(), found(MOVING.replace(", windows: [0.3, 0.9]", ""))
    assert several["verdict"] == one["verdict"] == "certified"
    radii = [window["radius"] for window in several["windows"]]
    assert max(radii) == several["radius"] < 0.8 * one["radius"]
    assert "windows" not in one
    assert [(w["begin"], w["end"]) for w in several["windows"]] == [(0.0, 0.3), (0.3, 0.9), (0.9, 2.0)]
    for window in several["windows"]:
        assert window["supremum"] < window["level"] <= several["level"]
        assert window["radius"] < window["tube"]
        assert window["half_widths"]["x"] <= several["half_widths"]["x"]
        assert several["inputs"]["u"][0] <= window["inputs"]["u"][0]
        assert window["inputs"]["u"][1] <= several["inputs"]["u"][1]


@pytest.fixture(scope="module")
def bounded():
    question = question_of(load_text(MOVING, "spec.yaml"), Options(gap=F(1, 20)))
    return bound(enclose(tube(plan(prove_metric(question)))))


@pytest.mark.slow
def test_constants_of_a_window_hold_in_it_and_before(bounded):
    """The bounds against points of the padded window; what is not in it may be larger."""
    rho = F(1, 10)
    windows = with_windows(bounded, [rho] * 3).machine.windows
    rng = np.random.default_rng(0)
    for window in windows:
        assert window.since == max(F(0), window.begin - F(9, 2000))
        t = rng.uniform(float(window.since), float(window.end), 4000)
        angle, r = rng.uniform(0, 2 * np.pi, 4000), float(rho) * np.sqrt(rng.uniform(0, 1, 4000))
        p = 0.3 * np.exp(-2 * t)
        u = p - 0.3 * np.sin(p)
        x, y = p + r * np.cos(angle), -p + r * np.sin(angle)
        drift = np.hypot(-x + y, -y + 0.3 * np.sin(x) + u)
        c = window.constants
        for value, constant in (
            (drift, c.drift_on_plan),
            (np.abs(u), c.u_star),
            (np.abs(0.1 * np.sin(t) + 0.05 * x), c.h),
            (np.abs(0.1 * np.cos(t)), c.h_t),
            (2 * np.hypot(p, p), window.machine.plan_speed),
        ):
            assert 0.9 * constant.above < value.max() <= constant.above
        low, high = window.inputs["u"]
        assert low <= u.min() <= u.max() <= high
    whole = bounded.problem.constants
    assert all(w.constants.drift_on_plan.above < whole.drift_on_plan.above for w in windows)
    assert windows[2].constants.h_initial == whole.h_initial


@pytest.mark.slow
def test_windows_are_bounded_side_by_side_as_one_by_one(bounded, monkeypatch):
    """The same bounds; where a value was found may differ in its last digit, as numpy may round alone and in rows."""

    def bounds():
        windows = with_windows(bounded, [F(1, 10), F(1, 20), F(1, 20)], gap=0.2).machine.windows
        found = [(*w.constants.items(), *w.machine.items()) for w in windows]
        return [(name, value.below, value.above) for each in found for name, value, _ in each if value]

    at_once = bounds()
    bounded.question.memory.kept.clear()
    monkeypatch.setattr("tubecert.bounds.parts.Parts._leads", lambda self, own: False)
    assert bounds() == at_once


@pytest.mark.slow
def test_a_part_of_a_plan(bounded):
    whole = bounded.enclosed.tube.plan
    part = during(whole, F(1, 2), F(1))
    assert part.time == {"t": (F(1, 2), F(1))}
    for since, until in ((F(1), F(1, 2)), (F(0), F(3)), (F(-1), F(1))):
        with pytest.raises(ValueError, match="part of the plan"):
            during(whole, since, until)


@pytest.mark.slow
def test_a_radius_beyond_the_tube_is_refused(bounded):
    for radii in ([F(1, 10)] * 2, [F(1, 10), F(1, 10), F(10)], [F(0)] * 3):
        with pytest.raises(ValueError, match="radius"):
            with_windows(bounded, radii)


@pytest.mark.slow
def test_the_report_tells_where_the_tube_is_widest(tmp_path):
    path = tmp_path / "moving.json"
    path.write_text(json.dumps(proven.proven(MOVING, bare=True)), encoding="utf-8")
    page = tc.report(tc.read(path)).html
    assert "3 windows: radius" in page
    assert "figure-along" in page
    assert page.count("from 0.3 to 0.9 s") >= 1


def test_simulation_compares_with_the_level_of_each_time():
    levels = Levels(ends=(0.3, 0.9, 2.0), levels=(3.0, 1.0, 2.0))
    assert levels(np.array([0.0, 0.29, 0.31, 0.9, 0.91, 2.0, 2.5])).tolist() == [3, 3, 1, 1, 2, 2, 2]


@pytest.mark.slow
def test_the_fast_transfer_at_500_hz():
    own = proven.shipped("two_state_windows", bare=True)["result"]["hardware"]
    assert own["verdict"] == "certified"
    assert own["radius"] < 0.056  # without windows .372; ten of equal length: .070
    assert own["windows"][-1]["radius"] < 0.032

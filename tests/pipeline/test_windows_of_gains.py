"""Windows of certificates B and C from the specification to the report, and what a loop that is played does in them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import proven
import pytest
from systems import GAINS_IN_WINDOWS, IN_WINDOWS
from tubecert.pipeline.windows import _has_parts
from tubecert.report.windows import nearest

import tubecert as tc
from tubecert.certificate.follows import InputData, PlanInputData
from tubecert.conditions.inputs import LimitedInput
from tubecert.conditions.problem import Formulas
from tubecert.enclosure.constant import Constant
from tubecert.pipeline import Options, question_of
from tubecert.report.reach import input_lines
from tubecert.simulate.compare import compare
from tubecert.simulate.integrator import integrate
from tubecert.simulate.monte_carlo import case, disturbance_of, monte_carlo
from tubecert.simulate.promise import Levels
from tubecert.simulate.setting import setting_of
from tubecert.simulate.tuning import Choice, loop_of
from tubecert.spec import load_text
from tubecert.verdict import Verdict

F = Fraction
ROUGHLY = {"gap": F(1, 20)}
GAINS = {"distance": "least_adaptation", "sampled": None}


def found(text: str = GAINS_IN_WINDOWS):
    return proven.proven(text, bare=True, **ROUGHLY)["result"]


@pytest.mark.slow
def test_windows_ask_for_less_and_prove_more():
    several, one = found(), found(re.sub(", windows: [^}]*", "", GAINS_IN_WINDOWS))
    assert several["verdict"] == one["verdict"] == "certified"
    assert (
        several["distance"]["least_adaptation"]["adaptation_rate"]
        < 0.9 * one["distance"]["least_adaptation"]["adaptation_rate"]
    )
    assert several["sampled"]["sample_time"] > 1.05 * one["sampled"]["sample_time"]
    for key in GAINS:
        assert "windows" not in one[key]
        windows = several[key]["windows"]
        assert [(w["begin"], w["end"]) for w in windows] == [(0.0, 0.3), (0.3, 0.9), (0.9, 2.0)]
        assert windows[0]["radius"] < 0.5 * several["tube"]["rho"]
        for window in windows:
            assert window["supremum"] < window["level"]
            assert window["radius"] <= window["tube"] * (1 + 1e-9) <= several["tube"]["rho"] * (1 + 1e-8)
            assert window["half_widths"]["y"] < several["tube"]["half_widths"]["y"] * (1 + 1e-9)
    (limited,) = several["inputs"]
    assert limited["verdict"] == "certified"
    own = several["distance"]["windows"]
    assert limited["bounds"]["distance"]["least"] == min(w["inputs"]["u"][0] for w in own)
    assert limited["bounds"]["distance"]["greatest"] == max(w["inputs"]["u"][1] for w in own)
    assert limited["windows"] == {key: ["certified"] * 3 for key in GAINS}
    assert "windows" not in one["inputs"][0]
    whole = one["inputs"][0]["bounds"]["distance"]
    assert whole["least"] < limited["bounds"]["distance"]["least"]


@pytest.mark.slow
def test_constants_of_a_window_hold_in_it():
    """The bounds against points of the window; what is not in it may be larger."""
    rng = np.random.default_rng(5)
    for window in found()["distance"]["windows"]:
        t = rng.uniform(window["begin"], window["end"], 4000)
        angle, r = rng.uniform(0, 2 * np.pi, 4000), window["tube"] * np.sqrt(rng.uniform(0, 1, 4000))
        p = 0.3 * np.exp(-2 * t)
        x, y = p + r * np.cos(angle), -p + r * np.sin(angle)
        u = p - 0.3 * np.sin(p)
        known = window["constants"]
        for name, points in (
            ("drift_on_plan", np.hypot(-x + y, -y + 0.3 * np.sin(x) + u)),
            ("h", np.abs(0.6 * np.sin(3 * t) + 0.3 * x * (1 + y))),
            ("h_t", np.abs(1.8 * np.cos(3 * t))),
        ):
            assert name not in known or 0.8 * known[name] < points.max() <= known[name]
        assert "drift_on_plan" in known
        assert window["inputs"]["u"][0] < u.min()
        assert u.max() < window["inputs"]["u"][1]


@pytest.mark.parametrize(
    ("decides", "has"), [("H", False), ("B", True), ("C", True), ("all", True), ("A", False)]
)
def test_beside_a_machine_only_what_decides_has_windows(decides, has):
    spec = load_text(IN_WINDOWS + f"conditions: {{decides: {decides}}}\n")
    problem = SimpleNamespace(formulas=Formulas.CORRECTED, gain=None)
    bounded = SimpleNamespace(problem=problem, machine=object(), question=question_of(spec, Options()))
    assert _has_parts(bounded) is has
    bounded.machine = None
    assert _has_parts(bounded)
    problem.formulas = Formulas.AS_PRINTED
    assert not _has_parts(bounded)


@pytest.mark.slow
def test_they_are_told_and_drawn(tmp_path):
    (tmp_path / "c.json").write_text(
        json.dumps(proven.proven(GAINS_IN_WINDOWS, bare=True, **ROUGHLY)), "utf-8"
    )
    page = tc.report(tc.read(tmp_path / "c.json"))
    told = page.markdown
    for letter in ("B", "C"):
        assert re.search(rf"The tube along the plan with [^\n]*\b{letter}\b", told) or letter in told
    assert "from 0.3 to 0.9 s" in told
    result = proven.result(GAINS_IN_WINDOWS, bare=True, **ROUGHLY)
    lines = list(input_lines(result, result.inputs[0]))
    assert any(
        re.fullmatch(r"u by window: most from [\d.]+ to [\d.]+ s \([\d.]+ %\), least .*", e) for e in lines
    )
    assert re.search(r"\| limits *\|", told)
    assert page.html.count("The tube along the plan with") >= 2


@pytest.mark.slow
def test_no_run_leaves_the_level_of_its_window():
    spec = load_text(GAINS_IN_WINDOWS)
    setting = setting_of(spec, proven.result(GAINS_IN_WINDOWS, bare=True, **ROUGHLY), F(2))
    loop = loop_of(setting, "l1", Choice())
    sample = monte_carlo(setting, loop, 6, 1)
    assert sample is not None
    found = compare(setting, sample.runs, loop.promise)
    assert found.violations == ()
    own = loop.promise.decay
    assert isinstance(own, Levels)
    assert own.ends == (0.3, 0.9, 2.0)
    (u,) = loop.promise.ranges
    assert [(w.begin, w.end) for w in u.windows] == [(0.0, 0.3), (0.3, 0.9), (0.9, 2.0)]
    low, high = u.over(np.array([0.1, 0.3, 1.0]))
    assert (low[0], high[0]) == (u.windows[0].least, u.windows[0].greatest)
    assert low[1] == min(w.least for w in u.windows[:2]), "at a boundary either window's"
    # an input that goes beyond the range of its window, though within that of another one
    short = replace(u, windows=(*u.windows[:2], replace(u.windows[2], greatest=u.windows[2].least + 0.1)))
    kind = setting.class_of(loop)
    own_case = case(setting, kind, 1, 0)
    runs = integrate(
        loop.problem,
        own_case.start[None],
        disturbance_of(setting, kind, [own_case]),
        tolerance=setting.tolerance,
    )
    assert compare(setting, runs, loop.promise).violations == ()
    found = compare(setting, runs, replace(loop.promise, ranges=(short,)))
    assert [item.name for item in found.violations] == ["input u in its window"]
    assert found.violations[0].time >= 0.9
    # levels that are less than what was met are left
    low = replace(own, levels=tuple(level / 60 for level in own.levels))
    found = compare(setting, sample.runs, replace(loop.promise, decay=low))
    assert any(item.name == "D(t)" for item in found.violations)


def test_limits_by_window_in_words():
    own = InputData(
        input="u",
        limits=(F(-1), F(3)),
        verdict=Verdict.UNDECIDED,
        plan=PlanInputData(least=Constant.exactly(0.0), greatest=Constant.exactly(1.0)),
        bounds={},
    )
    assert own.share((-1.0, 2.0)) == 1.0
    assert own.share((0.0, 2.0)) == 0.5
    windows = [
        SimpleNamespace(begin=F(0), end=F(1), inputs={"u": (-0.5, 3.5)}),
        SimpleNamespace(begin=F(1), end=F(2), inputs={"u": (0.0, 2.0)}),
    ]
    assert nearest(own, windows) == (
        "most from 0 to 1 s (125 %), least 50 %; beyond its limits in 1 of 2 windows"
    )
    assert nearest(own, windows[1:]) is None
    limited = LimitedInput(
        name="u", limits=own.limits, least=own.plan.least, greatest=own.plan.greatest, any_plan=False
    )
    assert limited.along([(-0.5, 3.5), (-1.0, 3.0), (-1.0000001, 0.0)]) == (
        "undecided",
        "certified",
        "undecided",
    )


def test_windows_without_a_horizon_are_refused():
    text = GAINS_IN_WINDOWS.replace("horizon: 2, ", "")
    with pytest.raises(tc.TubecertError):
        load_text(text)

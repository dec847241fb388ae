"""What is claimed is said: where the state starts, on screen and page; and what is said of W is read from W."""

import json
from fractions import Fraction

import pytest
from certificates import certified
from commands import run

from tubecert.certificate.result import MetricFile, Result, SolverData
from tubecert.enclosure.constant import Constant
from tubecert.report import certificate_brief, certificate_page, claimed, synthesis

PLANT = """
tubecert: 1
name: plant
system: {states: [p, v], inputs: [u], f: [0.2*v, -p], B: [[0], [1 + 0.5*v]]}
safe_set: {p: [-1, 1], v: [-0.5, 0.5]}
"""
SIXTH_OF_PI = "0.52359877559829887307710723054"  # of 30 digits
PLANS = {"x": {"angle": ["0", "0"], "speed": ["0", "0"]}, "u": {"u": ["0", "0"]}, "defect": "0"}


def about(start, **changes):
    """A result whose claim has this start."""
    data = certified(**changes)
    data["claim"]["start"] = start
    return Result.from_json(data)


def box(angle, speed):
    return {"box": {"angle": angle, "speed": [speed, speed]}}


STARTS = {
    "rest": ({"at": ["0", "0"]}, "at 0"),
    "point": ({"at": ["1/3", "0"]}, "at angle = 1/3 rad, all else 0"),
    "every state": ({"at": ["0.1", "-2"]}, "at angle = 0.1 rad, speed = -2 rad/s"),
    "box": (box(["-0.1", "0.1"], "0"), "anywhere with angle in [-0.1, 0.1] rad, all else 0"),
    "box and point": (box(["-0.1", "0.1"], "1"), "anywhere with angle in [-0.1, 0.1] rad, speed = 1 rad/s"),
    "a point with pi": (box([f"{SIXTH_OF_PI}6", f"{SIXTH_OF_PI}7"], "0"), "at angle = 30 deg, all else 0"),
    "ball": ({"within": "0.05"}, "within 0.05 of the start of the plan"),
}


@pytest.mark.parametrize("name", STARTS)
def test_screen_and_page_say_where_the_state_starts(name):
    start, words = STARTS[name]
    result = about(start)
    assert claimed.start_words(result) == words
    assert f"for all t >= 0 if it starts {words}, under" in certificate_page._meaning(result)
    assert ("start", words) in list(certificate_brief._brief(result))


def test_of_a_family_the_start_is_that_of_its_plan():
    result = about({"within": "0.05"})
    data = result.to_json()
    data["claim"]["plans"] = PLANS
    assert claimed.start_words(Result.from_json(data)) == "within 0.05 of the start of its plan"


def said_of(*entries):
    """The words about W (2, 2) in the report of a synthesis that was asked for a constant family."""
    known = {"below": 1.0, "above": 2.0}
    bounds = dict.fromkeys(("lower", "upper", "condition_number"), Constant(**known))
    a, b, c = entries
    file = MetricFile(
        format="tubecert-metric/1",
        rate=Fraction(3, 10),
        dual_metric=((a, b), (b, c)),
        verified_on={"p": (Fraction(-1), Fraction(1)), "v": (Fraction(-1), Fraction(1))},
        solver=SolverData(route="cegis", degree=0, variables=(), digits=5),
        **bounds,
    )
    return dict(synthesis._proven(file))["W"]


def test_what_is_said_of_w_is_read_from_its_expressions():
    assert "; W is constant, 5 digits (cegis)" in said_of("1.9813", "-0.5", "4")
    assert "; W depends on v, 5 digits" in said_of("1.9813", "-1.9817*(v + 2)", "4.1129*(v + 2)**2")
    assert "; W depends on p, v, 5 digits" in said_of("1", "0", "2 + cos(v)*exp(p)")


@pytest.mark.slow
def test_of_a_metric_in_fields_of_b_it_is_not_said_that_it_is_constant(tmp_path):
    path, target = tmp_path / "plant.yaml", tmp_path / "plant.metric.json"
    path.write_text(PLANT + "metric: {synthesise: {}}\n", "utf-8")
    done = run("synth", path, "--rate", "0.3", "-o", target)
    assert done.exit_code == 0
    assert "v" in json.dumps(json.loads(target.read_text("utf-8"))["dual_metric"])
    assert "W depends on v" in done.output

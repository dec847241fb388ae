"""An f that depends on t: C2 and every constant hold at all times of the horizon, for the producer and for recheck."""

from __future__ import annotations

import copy
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from rechecked import certified, examine, failing, respecified, sealed

from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import SpecError, TubecertError
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.pipeline import Options, synthesise
from tubecert.spec import load_text
from tubecert.spec.types import Synthesis

SPEC = (Path(__file__).parents[1] / "specs/ok/moving.yaml").read_text(encoding="utf-8")


def made():
    return copy.deepcopy(certified(SPEC, conditions="distance"))


def value(document, name):
    found = document["result"]["constants"][name]
    return found["below"], found["above"]


def test_the_rate_is_that_of_the_worst_time():
    """On B'v = 0, v = (1, 0): the rate is 1 - 0.1 sin(2t) + 0.3, least at 2t = pi/2; over [0, 1/10] at its end."""
    spec = load_text(SPEC)
    model = build(spec)
    for horizon, least in ((3, 1.2), (Fraction(1, 10), 1.3 - 0.1 * np.sin(0.2))):
        proof = verify_metric(replace(model, time=(Fraction(0), horizon)), spec.safe_set, Effort())
        assert proof.largest_rate.below <= least <= proof.largest_rate.above
        assert proof.largest_rate.above - proof.largest_rate.below < 0.01
    assert not proof.is_about(model, spec.safe_set)  # a proof for another horizon


@pytest.mark.slow
def test_constants_hold_at_all_times():
    document = made()
    rho = float(document["result"]["tube"]["rho"])
    generator = np.random.default_rng(1)
    t = generator.uniform(0, 3, 200_000)
    v = generator.normal(size=(2, len(t)))
    x, y = rho * v / np.linalg.norm(v, axis=0)
    f = np.array([-x + y + 0.1 * np.sin(2 * t) * x, -0.5 * y + 0.3 * np.cos(t) * np.sin(x) + 0.2 * t * x])
    below, above = value(document, "f")
    assert 0.99 * below <= np.linalg.norm(f, axis=0).max() <= above
    assert value(document, "drift_on_plan")[1] >= np.linalg.norm(f, axis=0).max()
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_what_the_plan_misses_is_bounded_at_all_times():
    """Rest where f(t, 0) = (0, 0.1 sin(t)) is no equilibrium: |p| is 0.1 at its largest."""
    text = SPEC.replace("+ 0.2*t*x", "+ 0.2*t*x + 0.1*sin(t)")
    document = copy.deepcopy(certified(text, conditions="distance"))
    below, above = value(document, "plan_defect")
    assert below <= 0.1 <= above < 0.101
    assert failing(examine(document)) == []


@pytest.mark.slow
def test_a_plan_that_moves_is_compared_with_f_at_its_time():
    """x* = 0.1 sin(t), y* and u* as f(t, x) demands: nothing is missing, and shifted by a moment something is."""
    y = "0.1*cos(t) + 0.1*sin(t) - 0.01*sin(2*t)*sin(t)"
    slope = "-0.1*sin(t) + 0.1*cos(t) - 0.02*cos(2*t)*sin(t) - 0.01*sin(2*t)*cos(t)"
    u = f"{slope} + 0.5*({y}) - 0.3*cos(t)*sin(0.1*sin(t)) - 0.02*t*sin(t)"
    resting = "{kind: equilibrium, at: [0, 0], input: [0], horizon: 3}"
    moving = f'{{kind: expressions, x: ["0.1*sin(t)", "{y}"], u: ["{u}"], horizon: 1}}'
    document = copy.deepcopy(certified(SPEC.replace(resting, moving), conditions="distance"))
    assert document["result"]["verdict"] == "certified"
    assert value(document, "plan_defect") == (0, 0)
    assert failing(examine(document)) == []

    def shifted(effective):
        f = effective["system"]["f"]
        effective["system"]["f"] = [e.replace("cos(t)", "cos(t + 0.01)") for e in f]

    assert failing(examine(respecified(document, shifted)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new"), [("0.2*t*x", "0.3*t*x"), ("0.3*cos(t)", "2.9*cos(t)"), ("0.1*sin(2*t)", "t")]
)
def test_another_f_is_not_confirmed(old, new):
    def changed(effective):
        f = effective["system"]["f"]
        assert any(old in e for e in f)
        effective["system"]["f"] = [e.replace(old, new) for e in f]

    assert failing(examine(respecified(made(), changed)))


@pytest.mark.slow
def test_a_longer_horizon_is_not_confirmed():
    """t x grows: what holds for 3 s does not for 9."""
    document = respecified(made(), lambda effective: effective["trajectory"].update(horizon="9"))
    document["result"]["claim"]["horizon"] = "9"
    try:
        assert failing(examine(sealed(document)))
    except TubecertError as error:  # the claim is another one
        assert "horizon" in str(error)  # noqa: PT017


@pytest.mark.slow
@pytest.mark.parametrize(
    "change",
    [
        lambda e: e["trajectory"].pop("horizon"),
        lambda e: e["system"].update(B=[["0.001*t"], ["1"]]),
        lambda e: e.update(disturbance={"E": [["1"], ["0"]], "bound": "0"}),
        lambda e: e["system"]["parameters"].update(c=["1", "2"]),
    ],
)
def test_what_no_theorem_covers_is_refused(change):
    with pytest.raises(TubecertError, match=r"f that depends on t|no expression"):
        examine(respecified(made(), change))


def test_no_metric_is_searched_for():
    spec = load_text(SPEC)
    wanted = load_text(
        SPEC.replace("0.1*sin(2*t)", "0.1")
        .replace("cos(t)", "1")
        .replace("t*x", "x")
        .replace("metric: {rate: 0.5, dual_metric: [[1, -0.3], [-0.3, 2]]}", "metric: {synthesise: {}}")
    ).synthesis
    assert isinstance(wanted, Synthesis)
    with pytest.raises(SpecError, match="metrics are not found"):
        synthesise(spec, wanted, Options())

"""B that depends on the state: constants against closed forms, C3 exact, C2 by both routes."""

from fractions import Fraction
from math import cos, sin

import pytest
from texts import CONFIGS, replaced

from tubecert.claims.statements import MetricKilling
from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.domain import BoxDomain
from tubecert.enclosure.pencil import ProjectedPencil
from tubecert.metric.verify import verify_metric
from tubecert.model import build
from tubecert.pipeline import Options, certify
from tubecert.spec import load_text

TEXT = (CONFIGS / "state_dependent_input.yaml").read_text(encoding="utf-8")


def spec(*changes):
    return load_text(replaced(TEXT, *changes), "spec.yaml")


@pytest.fixture(scope="module")
def result():
    return certify(spec(), Options()).to_json()


@pytest.mark.slow
def test_it_is_certified(result):
    assert result["verdict"] == "certified"


@pytest.mark.slow
def test_constants_agree_with_closed_forms(result):
    rho = result["tube"]["rho"]
    exact = {
        "B": 2 + sin(rho),
        "B_x": 1.0,
        "b_x": 1.0,
        "B_pinv": 1 / (2 - sin(rho)),
        "B_pinv_x": cos(rho) / (2 - sin(rho)) ** 2,
        "h": 0.2 + 0.1 * rho,
        "h_x": 0.1,
        "h_t": 0.2,
    }
    for name, value in exact.items():
        constant = result["constants"][name]
        assert constant["below"] <= value * (1 + 1e-9), name
        assert value <= constant["above"] * (1 + 1e-9), name
        assert constant["above"] <= 1.01 * value, name


@pytest.mark.slow
def test_the_largest_rate_is_the_closed_form(result):
    # C2 reads 2 (-1 - 0.5 (2 + sin x2)) + 2 rate <= 0
    low, high = result["metric"]["largest_rate"]
    exact = 1 + 0.5 * (2 - sin(0.5))
    assert low <= exact <= high
    assert high - low <= 0.01 * exact


@pytest.mark.parametrize(
    "change",
    [
        ('"(2 + sin(x2))**2"', '"(2 + sin(x2))**2 + 0.001*x2"'),
        ('B: [["0"], ["2 + sin(x2)"]]', 'B: [["0"], ["2 + sin(x2) + 0.001*x2"]]'),
        ('B: [["0"], ["2 + sin(x2)"]]', 'B: [["0.001*x1"], ["2 + sin(x2)"]]'),
    ],
)
def test_a_violated_killing_condition_is_refuted_at_a_point(change):
    result = certify(spec(change), Options()).to_json()
    assert result["verdict"] == "refuted"
    assert result["reasons"][0]["claim"] == "metric_killing"
    assert "at" in result["reasons"][0]


def test_too_high_a_rate_is_refuted():
    result = certify(spec(("rate: 1.5", "rate: 1.77")), Options()).to_json()
    assert result["verdict"] == "refuted"
    below, above = result["reasons"][0]["largest_rate"]
    assert 1.76 < below <= above < 1.77


def largest(chosen, model, absolute):
    """The supremum of the projected pencil on the whole set."""
    domain = BoxDomain(dict(zip(chosen.states, chosen.safe_set, strict=True)))
    objective = ProjectedPencil(
        model.drift_form, model.W, model.BBt, model.projector, inputs=len(model.inputs)
    )
    return supremum(objective, domain, Effort(gap=0.0, absolute=absolute))


def test_finslers_lemma_agrees_with_the_moving_annihilator():
    found = largest(spec(), build(spec()), 1e-3)
    exact = -2 * (1 + 0.5 * (2 - sin(0.5)))
    assert found.below <= exact * (1 - 1e-12)
    assert exact <= found.above
    assert found.above - found.below <= 1.1e-3


def test_without_a_fixed_pivot_the_metric_is_still_decided():
    # a unicycle-like B whose every pivot vanishes somewhere; the projected pencil decides
    text = """tubecert: 1
name: turning
system:
  states: [x, y, th]
  inputs: [u]
  f: ["-2*x", "-2*y", "-2*th"]
  B: [["cos(3*th)"], ["sin(3*th)"], ["0"]]
safe_set: {x: [-1, 1], y: [-1, 1], th: [-1, 1]}
uncertainty: {bounds: {h: 0.1, h_x: 0, h_t: 0}}
trajectory: {kind: equilibrium, at: [0, 0, 0]}
metric: {rate: 1, dual_metric: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}
tube: {epsilon: 0.1, rho_a: 0.1}
"""
    chosen = load_text(text, "spec.yaml")
    model = build(chosen)
    found = largest(chosen, model, 1e-2)
    assert found.below <= -4 <= found.above
    assert found.above <= -4 + 2e-2
    # W does not follow B, so C3 fails: the metric is refused, whatever C2 says
    assert isinstance(verify_metric(model, chosen.safe_set, Effort()).failed, MetricKilling)
    assert model.rate == Fraction(1)

"""Metrics for a machine: what a surrogate proposes is proven and certified, or dropped."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from rechecked import certified, examine, failing
from tubecert.library.designing import _in_coordinates, _loader
from tubecert.library.trading import Asked
from tubecert.pipeline.metric_search import sampled_system, search
from tubecert.search.metrics import Proposed, Surrogate
from typer.testing import CliRunner

from tubecert.cli.app import app
from tubecert.model import build
from tubecert.pipeline import Options, design, metric_search
from tubecert.pipeline.width import measure_of
from tubecert.search import metrics
from tubecert.spec import load_text

CART = """
tubecert: 1
name: cart
system: {states: [z, v], inputs: [F], f: [v, "-0.5*v"], B: [[0], [1]]}
safe_set: {z: [-1, 1], v: [-2, 2]}
uncertainty: {h: ["0.02*sin(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
tube: {half_widths: {z: 0.05}}
hardware: {rate: 200, delay: 0.002, noise: 0.0001}
disturbance: {E: [[0], [1]], bound: 0.02}
conditions: {decides: H}
"""
METRIC = "metric: {rate: 1.5, dual_metric: [[1, -2], [-2, 6]]}\n"


def surrogate_of(text):
    spec = load_text(text)
    model = build(replace(spec, metric=None))
    system = sampled_system(spec, model, np.zeros((1, 2)))
    return Surrogate(system, lambda widths: float(widths[0]))


def held(spec):
    return lambda own, scale: replace(spec, metric=own.metric)


@pytest.mark.slow
def test_the_surrogate_is_near_what_is_proven():
    told = surrogate_of(CART)(np.array([[1.0, -2.0], [-2.0, 6.0]]))
    own = certified(CART + METRIC, conditions="H")["result"]["hardware"]
    assert told.rate >= 1.5
    assert 0.5 * own["half_widths"]["z"] < told.widths[0] < 1.5 * own["half_widths"]["z"]


def test_the_surrogate_knows_no_level_for_what_is_no_metric_and_leads_back():
    told = surrogate_of(CART)
    assert told(np.array([[1.0, 2.0], [2.0, 1.0]])).cost > told(np.array([[1.0, 0.1], [0.1, 1.0]])).cost
    slow, fast = (told(np.array([[1.0, -rate], [-rate, 2 * rate**2]])) for rate in (1.0, 80.0))
    assert np.isfinite(slow.widths).all()
    assert not np.isfinite(fast.widths).any()
    assert fast.cost > slow.cost


def test_units_of_a_state_do_not_change_what_the_surrogate_says():
    """v in units of 1/10: the same half-width of z."""
    W = np.array([[1.0, -2.0], [-2.0, 6.0]])
    S = np.diag([1.0, 10.0])
    own = surrogate_of(CART)
    system = own.system
    other = replace(
        system,
        slopes=S @ system.slopes @ np.linalg.inv(S),
        near=S @ system.near @ np.linalg.inv(S),
        B=S @ system.B,
        wind=S @ system.wind,
        noise=S @ system.noise,
        room=S @ system.room,
    )
    assert Surrogate(other, own.measure)(S @ W @ S).widths[0] == pytest.approx(own(W).widths[0], rel=1e-9)


@pytest.mark.usefixtures("barely")
@pytest.mark.slow
def test_a_design_finds_metric_and_coordinates_for_its_machine_and_rechecks(tmp_path, monkeypatch):
    """From a ball with another metric, in which nothing is certified."""
    ball = CART.replace("half_widths: {z: 0.05}", "epsilon: 0.03, rho_a: 0.02")
    for module, name, value in (
        (design, "_FARTHEST", 0),
        (design, "_NARROWINGS", 0),
        (metric_search, "_CERTIFIED", 1),
        (metrics, "_EVALUATIONS", 40),
    ):
        monkeypatch.setattr(module, name, value)
    spec, target = tmp_path / "cart.yaml", tmp_path / "d.json"
    spec.write_text(ball + METRIC, encoding="utf-8")
    words = ["design", str(spec), "--metric", "search", "--minimise", "z", "-o", str(target), "--no-progress"]
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    assert done.exit_code == 0, done.output
    found = json.loads(target.read_text(encoding="utf-8"))
    assert failing(examine(found)) == []
    assert found["result"]["overrides"]["settings"] == {"tube": "{half_widths: {z: 0.05}}"}
    assert certified(ball + METRIC, conditions="H")["result"]["verdict"] == "undecided"
    width = found["result"]["hardware"]["half_widths"]["z"]
    other = certified(CART + METRIC, conditions="H")["result"]["hardware"]["half_widths"]["z"]
    assert width < other
    assert (
        json.loads((tmp_path / "d.metric.json").read_text(encoding="utf-8"))["format"] == "tubecert-metric/1"
    )


@pytest.mark.parametrize(
    ("tube", "told"),
    [
        ("epsilon: 0.03, rho_a: 0.02", "{half_widths: {z: 0.05, v: 0.05}}"),
        ("epsilon: 0.03, rho_a: 0.02, gap: auto", "{half_widths: {z: 0.05, v: 0.05}, gap: auto}"),
        ("epsilon: 0.03, rho_a: 0.02, coordinates: identity", None),
        ("epsilon: 0.03, rho_a: 0.02, coordinates: auto", None),
        ("half_widths: {z: 0.05}", None),
    ],
)
def test_a_ball_is_given_coordinates_unless_it_was_asked_for(tube, told):
    spec = load_text(CART.replace("half_widths: {z: 0.05}", tube) + METRIC)
    asked = Asked(load=_loader(spec), options=Options(), measure=measure_of(spec), progress=None, named=str)
    shaped = _in_coordinates(spec, asked)
    assert (None if shaped is None else dict(shaped.load(()).settings)["tube"]) == told
    if shaped is not None:
        assert dict(shaped.measure.units) == {"z": 1, "v": 1}


@pytest.mark.parametrize(
    "lie",
    [
        Proposed(W=np.array([[1.0, 0.0], [0.0, 1.0]]), rate=9.0, widths=np.array([1e-3, 1e-3]), cost=-9.0),
        Proposed(W=np.array([[1.0, 2.0], [2.0, 1.0]]), rate=1.0, widths=np.array([1e-3, 1e-3]), cost=-9.0),
    ],
)
def test_a_surrogate_that_lies_certifies_nothing(lie, monkeypatch):
    monkeypatch.setattr(metric_search, "metrics", lambda *arguments: [lie])
    spec = load_text(CART)
    found = search(spec, held(spec), measure_of(spec), Options())
    assert found.best is None
    assert all(each.size is None for each in found.candidates)

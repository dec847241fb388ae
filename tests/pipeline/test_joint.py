"""Metrics that move with the state, by the weights of sums of squares: near a target, better for H, never believed."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import exp, log

import numpy as np
import pytest
from rechecked import examine, failing
from tubecert.pipeline.joint import Joint, Judged, at_point
from tubecert.pipeline.metric_search import search
from tubecert.search.weights import Weights, descend, moves

from tubecert import certificate
from tubecert.model import build
from tubecert.pipeline import Options, certify, joint, metric_search
from tubecert.pipeline.width import measure_of
from tubecert.spec import load_text
from tubecert.spec.metric_file import with_metric_text
from tubecert.synthesis.family import metric_family
from tubecert.synthesis.problem import SynthesisProblem
from tubecert.synthesis.sos import propose_sos
from tubecert.verdict import Verdict

MOVES = """
tubecert: 1
name: moves
system: {states: [x, y], inputs: [u], f: ["-x + y", "0.5*x - y"], B: [["0"], ["2 + 0.2*y"]]}
safe_set: {x: [-0.5, 0.5], y: [-0.5, 0.5]}
uncertainty: {h: ["0.1*cos(t)"]}
trajectory: {kind: equilibrium, at: [0, 0], input: [0]}
metric:
  rate: 1.2
  dual_metric: [["1", "-0.25*(2 + 0.2*y)"], ["-0.25*(2 + 0.2*y)", "0.5*(2 + 0.2*y)**2"]]
tube: {epsilon: 0.1, rho_a: 0.1}
hardware: {rate: 1000, noise: 0.0001}
conditions: {decides: H}
"""
# in the frame (1, 0), (0, 2 + .2 y), or a multiple of it, C2 is -V_xx + V_xy (2 + .2 y) + rate V_xx <= 0
TARGET = np.array([[1.0, -0.4], [-0.4, 0.7]])


def held(spec):
    return lambda own, scale: replace(spec, metric=own.metric)


def solved(rate, target):
    """kappa and V, in the frame (1, 0), (0, 2 + .2 y)."""
    spec = load_text(MOVES)
    model = build(replace(spec, metric=None))
    family = metric_family(model, degree=0, safe_set=spec.safe_set)
    scale = np.array([1.0, 2.0]) / np.diag(at_point(family.frame, model, np.zeros(2)))
    problem = SynthesisProblem(
        model=model,
        safe_set=spec.safe_set,
        family=family,
        rate=rate,
        coordinates="auto",
        target=scale[:, None] * target * scale,
    )
    found = propose_sos(problem)
    return found.kappa, found.coefficients[0] / scale[:, None] / scale


def test_where_the_target_is_a_metric_it_is_what_is_found_and_else_the_nearest():
    """1 - .4*1.9 <= 1 - rate where y is least: the target has every rate up to 1.76, and no other."""
    kappa, V = solved(1.7, TARGET)
    assert kappa == pytest.approx(1, abs=1e-4)
    assert V / V[0, 0] == pytest.approx(TARGET, abs=1e-3)
    # at 1.95, V_xy <= -.5 V_xx is needed: the least kappa is that of a pencil, looked for on a grid
    kappa, V = solved(1.95, TARGET)
    assert V[0, 1] / V[0, 0] <= -0.5 + 1e-6
    L = np.linalg.inv(np.linalg.cholesky(TARGET))
    duals = np.array([[[1.0, -0.5], [-0.5, yy]] for yy in np.linspace(0.3, 2, 2000)])
    values = np.linalg.eigvalsh(L @ duals @ L.T)
    least = min(high / low for low, high in values if low > 0)
    assert least > 1.05
    assert kappa == pytest.approx(least, rel=1e-3)


def test_moves_do_what_they_say():
    b = np.array([[0.3], [2.0]])
    own = Weights(target=TARGET, rate=2.0)
    faster, gained, widened, sheared = (move(own, 0.2) for move in moves(b))
    assert faster.rate == pytest.approx(2 * exp(0.2))
    before, after = (float(b[:, 0] @ np.linalg.solve(T, b[:, 0])) for T in (TARGET, gained.target))
    assert after == pytest.approx(before * exp(-0.4))
    assert widened.target[1, 1] == pytest.approx(TARGET[1, 1] * exp(0.4))
    assert np.linalg.det(sheared.target) == pytest.approx(np.linalg.det(TARGET))
    for each in (gained, widened, sheared):
        assert np.linalg.eigvalsh(each.target)[0] > 0


def test_a_descent_finds_the_least_of_a_bowl_and_stops_where_it_was_told_to():
    asked = []

    def cost(own):
        asked.append(own)
        return log(own.rate / 3) ** 2 + log(own.target[1, 1] / own.target[0, 0] / 5) ** 2

    start = Weights(target=np.eye(2), rate=1.0)
    best = descend(start, cost, moves(np.array([[0.0], [1.0]])), 60)
    assert len(asked) <= 60
    assert best.rate == pytest.approx(3, rel=0.1)
    assert best.target[1, 1] / best.target[0, 0] == pytest.approx(5, rel=0.2)
    asked.clear()
    descend(start, cost, moves(np.array([[0.0], [1.0]])), 3)
    assert len(asked) == 3


@pytest.mark.slow
def test_weights_make_the_tube_of_a_machine_narrower_and_the_certificate_rechecks(monkeypatch):
    monkeypatch.setattr(joint, "_EVALUATIONS", 4)
    spec = load_text(MOVES)
    options = Options(gap=Fraction(1, 5), conditions="H")
    own = Joint(spec=spec, model=build(replace(spec, metric=None)), measure=measure_of(spec), options=options)
    found = own.run([(np.array([[1.0, -0.5], [-0.5, 2.0]]), 1.2)], np.zeros(2))
    assert [each.size for each in found] == sorted(each.size for each in found)
    result = certify(with_metric_text(spec, found[0].text, "found"), options)
    assert result.verdict is Verdict.CERTIFIED
    width = result.sections["hardware"].radius
    assert width == pytest.approx(found[0].size)
    assert width < 0.95 * found[-1].size
    assert failing(examine(certificate.seal(result.to_json(), {}))) == []


@pytest.mark.parametrize("rate", [5, 1000])
def test_weights_that_lie_certify_nothing(rate, monkeypatch):
    lie = f'{{"format": "tubecert-metric/1", "rate": {rate}, "dual_metric": [["1", "0"], ["0", "(2 + 0.2*y)**2"]]}}'
    monkeypatch.setattr(Joint, "run", lambda *arguments: [Judged(text=lie, size=1e-6)])
    monkeypatch.setattr(metric_search, "metrics", lambda *arguments: [])
    spec = replace(load_text(MOVES), metric=None)
    found = search(spec, held(spec), measure_of(spec), Options())
    assert found.best is None
    assert [each.size for each in found.candidates] == [None]

"""The language of specifications, read and evaluated by recheck on its own."""

from __future__ import annotations

import copy

import pytest
from rechecked import certified, examine, failing, respecified

FRICTION = """
tubecert: 1
name: friction
system:
  states: [p, v]
  inputs: [u]
  f: ["v", "-sin(p) - 0.2*tanh(v/0.2) - 0.1*v + 0.1*atan(p) + 0.01*asin(p/2)*sinh(v)"]
  B: [[0], [1]]
safe_set: {p: [-1, 1], v: [-1.5, 1.5]}
uncertainty: {h: ["0.05*sin(t) + 0.05*tanh(3*v) + 0.02*log(2 + p)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
initial_state: {at: [0.02, 0]}
metric: {rate: 0.5, dual_metric: [[1, "-0.6"], ["-0.6", "1.2"]]}
tube: {epsilon: 0.2, rho_a: 0.1}
adaptation: {A_m: -10}
"""


@pytest.mark.slow
def test_smooth_friction_is_certified_and_confirmed():
    document = certified(FRICTION, conditions="distance")
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new"), [("tanh(", "sinh("), ("atan(p)", "sinh(5*p)"), ("log(", "cosh(")])
def test_another_function_is_not_confirmed(old, new):
    """Every claim of the certificate as it was, the function in its place another one."""
    document = copy.deepcopy(certified(FRICTION, conditions="distance"))

    def changed(effective):
        f, h = effective["system"]["f"], effective["uncertainty"]["h"]
        f[1], h[0] = f[1].replace(old, new), h[0].replace(old, new)

    assert failing(examine(respecified(document, changed)))

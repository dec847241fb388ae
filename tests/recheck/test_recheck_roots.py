"""Recheck of systems with a root, such as the smooth form of v|v| that TC109 advises."""

import pytest
from rechecked import certified, examine, failing, terms

from tubecert.recheck.identity import vanish

DRAG = """
tubecert: 1
name: drag
system:
  states: [z, v]
  inputs: [F]
  f: [v, -9.81 - 0.2*v*sqrt(v**2 + 0.01)]
  B: [[0], [1]]
safe_set: {z: [-1, 3], v: [-2, 2]}
uncertainty: {bounds: {h: 0.8, h_x: 0, h_t: 1}}
trajectory:
  kind: expressions
  x: ["1 - 0.5*cos(t)", "0.5*sin(t)"]
  u: ["9.81 + 0.5*cos(t) + 0.1*sin(t)*sqrt((0.5*sin(t))**2 + 0.01)"]
  horizon: 10
metric: {rate: 2.26, dual_metric: [[4.5, -18], [-18, 89]]}
tube: {half_widths: {z: 0.2}}
"""


@pytest.mark.parametrize(
    ("text", "zero"),
    [
        ("sqrt(0.25*sin(x)**2 + 0.01) - sqrt((0.5*sin(x))**2 + 0.01)", True),
        ("sqrt(0.25*sin(x)**2 + 0.01) - sqrt(0.25*(1 - cos(x)**2) + 0.01)", True),
        ("y*sqrt(x**2 + 1) - sqrt(x*x + 1)*y", True),
        ("sqrt(x**2 + 1) + sqrt(x*x + 1)", False),
        ("sqrt(x**2 + 1) - sqrt(x**2 + 2)", False),
        ("sqrt(4*(x**2 + 1)) - sqrt(x**2 + 1)", False),
    ],
)
def test_roots_of_the_same_number_are_the_same(text, zero):
    assert vanish(terms([text], "xyz")) is zero


@pytest.mark.slow
def test_a_plan_whose_input_has_a_root_over_the_whole_horizon():
    """A root of a wide range has no bounds: the plan is cut until it has."""
    document = certified(DRAG, conditions="distance")
    assert document["result"]["verdict"] == "certified", document["result"]["reasons"]
    assert failing(examine(document)) == []

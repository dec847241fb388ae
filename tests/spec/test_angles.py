"""pi and degrees in a specification: sets shrink, starts and bounds grow, by less than anything matters."""

import json
from fractions import Fraction
from pathlib import Path

import balls
from flint import arb

from tubecert.recheck.document import Node
from tubecert.recheck.specification import read_specification
from tubecert.spec import canonical, load_text

FILE = """
tubecert: 1
name: small
system:
  states: [x, y]
  inputs: [u]
  parameters: {k: 2, w: 2*pi*k, v: w/pi}
  f: ["-x + y", "-y - w*x"]
  B: [[0], [1]]
safe_set: {x: [-pi/4, 45 deg], y: [-w, w]}
uncertainty: {bounds: {h: pi/10, h_x: 0, h_t: v}}
trajectory: {kind: equilibrium, at: [0, 0], horizon: pi}
initial_state: {within: 1 deg}
metric: {rate: 0.1, dual_metric: [[1, 0], [0, pi]]}
tube: {epsilon: 5 deg, rho_a: pi/100}
"""


precision = balls.precision(400)


def near(q: Fraction, exact: arb, side: int) -> bool:
    """On the side, and no more than 1e-28 away from it."""
    gap = (arb(q.numerator) / q.denominator - exact) * side
    return bool(gap > 0) and bool(gap < arb("1e-27"))


def test_sets_shrink_and_what_is_survived_grows() -> None:
    spec = load_text(FILE)
    pi = arb.pi()
    (x_lo, x_hi), (y_lo, y_hi) = spec.safe_set
    assert near(x_lo, -pi / 4, 1)
    assert near(x_hi, pi / 4, -1)
    assert near(y_lo, -4 * pi, 1)
    assert near(y_hi, 4 * pi, -1)
    bounds = spec.uncertainty.bounds
    assert bounds is not None
    assert bounds.h is not None
    assert near(bounds.h, pi / 10, 1)
    assert bounds.h_t is not None
    assert near(bounds.h_t, arb(4), 1)
    assert spec.within is not None
    assert near(spec.within, pi / 180, 1)
    assert spec.tube.epsilon is not None
    assert near(spec.tube.epsilon, pi / 36, -1)
    assert spec.trajectory.horizon is not None
    assert near(spec.trajectory.horizon, pi, 1)


def test_a_parameter_with_pi_stays_exact_in_expressions() -> None:
    spec = load_text(FILE)
    assert str(spec.f[1].expression) == "-4*pi*x - y"
    assert spec.parameters == (("k", Fraction(2)),)


def test_the_checker_reads_the_same_numbers(tmp_path: Path) -> None:
    """The canonical form has no pi in a number: both sides read the same rationals, and the file loads again."""
    data = canonical(load_text(FILE))
    assert canonical(load_text(json.dumps(data))) == data
    read = read_specification(Node(data, "spec"))
    spec = load_text(FILE)
    assert tuple(read.plant.safe_set.values()) == spec.safe_set
    assert (read.start.within, read.epsilon) == (spec.within, spec.tube.epsilon)

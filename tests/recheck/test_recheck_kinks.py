"""Kinks: an h with absolute values, whose largest slope and largest change with t lie on a kink (R8)."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import systems
from proven import proven
from rechecked import examine, terms

from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.errors import ExitCode
from tubecert.model import build
from tubecert.recheck.coordinates import Fields
from tubecert.recheck.cover import prove, within
from tubecert.recheck.curve import expressed
from tubecert.recheck.lipschitz import LipschitzBelow, slopes_below
from tubecert.recheck.tube import Round, Tube
from tubecert.spec import load_text
from tubecert.trajectory.make import plan_of

H = "0.01*(abs(x - 0.5*abs(y))*cos(3*t) + 0.2*norm(x, y)*x)"
SPEC = f"""\
tubecert: 1
name: kinks
system:
  states: [x, y]
  inputs: [u]
  f: [y, "-x"]
  B: [[0], [1]]
safe_set: {{x: [-1, 1], y: [-1, 1]}}
uncertainty: {{h: ["{H}"]}}
trajectory: {{kind: expressions, x: ["0.3*sin(t)", "0.3*cos(t)"], u: ["0"], horizon: 2}}
initial_state: {{within: 0.01}}
metric: {{rate: 0.3, dual_metric: [[1, -1], [-1, 3]]}}
tube: {{epsilon: 0.1, rho_a: 0.1}}
"""


def h(t, x, y):
    return 0.01 * (abs(x - 0.5 * abs(y)) * np.cos(3 * t) + 0.2 * np.hypot(x, y) * x)


def largest_slope():
    """Of difference quotients over 1e-6, at random and where the slope is largest."""
    rng = np.random.default_rng(8)
    t = np.concatenate([rng.uniform(0, 2, 400_000), np.full(100_000, 2.0)])
    angle, far = rng.uniform(0, 2 * np.pi, len(t)), 0.2 * np.sqrt(rng.uniform(0, 1, len(t)))
    x, y = 0.3 * np.sin(t) + far * np.cos(angle), 0.3 * np.cos(t) + far * np.sin(angle)
    d = 1e-6
    by = [(h(t, x + d, y) - h(t, x, y)) / d, (h(t, x, y + d) - h(t, x, y)) / d]
    return np.linalg.norm(by, axis=0).max()


@pytest.fixture(scope="module")
def bound():
    spec = load_text(SPEC)
    model = build(spec)
    effort = Effort(gap=1e-3, budget=5_000)
    suprema = Suprema(model, plan_of(spec, model), 0.2, (Fraction(0), Fraction(2)), effort)
    return suprema.lipschitz(suprema.h)


@pytest.mark.slow
def test_the_lipschitz_constant_needs_few_boxes(bound):
    """Natural extensions needed two millions for 1 %."""
    assert bound.above - bound.below < 1e-3 * bound.above
    assert 0.998 * bound.above < largest_slope() < bound.above * (1 + 1e-6)


def tube():
    x, y, still = terms(["0.3*sin(t)", "0.3*cos(t)", "0"], "t")
    curve = expressed([x, y], [still], "t", Fraction(2))
    return Tube(curve, Round(Fraction(1, 5)), ("x", "y"), ("u",), {"t": (Fraction(0), Fraction(2))})


@pytest.mark.slow
@pytest.mark.parametrize(("more", "holds"), [(Fraction(1, 1000), True), (Fraction(-1, 1000), False)])
def test_recheck_cuts_boxes_where_a_sign_changes(bound, more, holds):
    """|dh/dt| is largest, 0.03*0.5, at t = pi/2 and x* + (0.2, 0), where |y| has its kink."""
    (uncertain,) = terms([H], "xyt")
    found = prove(slopes_below([[uncertain]], "t", Fraction(15, 1000) * (1 + more)), tube(), 1_000)
    assert found.holds is holds
    fields = Fields(SimpleNamespace(states=("x", "y")), None)
    limit = Fraction(bound.above) * (1 + 3 * more)
    assert prove(LipschitzBelow([uncertain], fields, limit), tube(), 3_000).holds is holds


@pytest.mark.slow
def test_when_the_time_is_up_the_rest_is_undecided():
    document = proven(systems.SMALL, conditions="distance")
    memory = {}
    found = examine(document, memory=memory, seconds=0.0)
    assert not memory
    assert (found.verdict, found.exit_code) == ("undecided", ExitCode.UNDECIDED)
    assert {item.outcome.why for item in found.claims} == {"not examined: the time was up"}
    with within(0.0):
        stopped = prove(slopes_below([terms([H], "xyt")], "t", Fraction(15, 1000)), tube(), 10**9)
    assert stopped.boxes <= 8
    assert stopped.why.endswith(", when the time was up")


def test_a_kink_that_does_not_change_in_time_is_not_looked_at():
    """0.3 |cos 3t| at t = 0, whatever the sign of x is; 20 000 boxes were not enough for it."""
    h = terms(["0.1*sin(3*t) + 0.1*abs(x)"], "xyt")
    found = prove(slopes_below([h], "t", Fraction(301, 1000)), tube(), 200)
    assert found.holds, found
    assert not prove(slopes_below([h], "t", Fraction(299, 1000)), tube(), 200).holds
    assert not prove(
        slopes_below([terms(["0.1*sin(3*t)*abs(x)"], "xyt")], "t", Fraction(1, 10)), tube(), 200
    ).holds

"""What u* does on a plan: closed forms, sampled plans of every kind, and the place where it is largest."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions, texts

from tubecert.bounds.suprema import Suprema
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.tape import Tape
from tubecert.expression import ZERO, parse, symbol
from tubecert.model import build
from tubecert.spec import Knots, load_text
from tubecert.trajectory import Plan
from tubecert.trajectory.make import plan_of
from tubecert.trajectory.pieces import piecewise_plan

SYSTEM = """
tubecert: 1
name: two_inputs
system: {{states: [x, y], inputs: [u, v], f: ["-x + y", "-y"], B: [[1, 0], [0, 1]]}}
safe_set: {{x: [-9, 9], y: [-9, 9]}}
uncertainty: {{bounds: {{h: 1, h_x: 0, h_t: 1}}}}
initial_state: {{within: 0.1}}
metric: {{dual_metric: [[1, 0], [0, 1]], rate: 0.1}}
trajectory: {plan}
"""
SHARP = 1e-4
NUMBERS = fractions(-5, 5, 1000)


def suprema(plan):
    spec = load_text(SYSTEM.format(plan=plan))
    model = build(spec)
    return Suprema(model, plan_of(spec, model), 0.1, None, Effort())


def test_an_expression_has_the_range_of_its_closed_form():
    found = suprema(
        '{kind: expressions, x: ["sin(t)", "0"], u: ["cos(t) + sin(t)", "2 - t**2/4"], horizon: 3}'
    )
    least, greatest = found.input_range(0, SHARP)
    for value, own in ((math.cos(3) + math.sin(3), least), (math.sqrt(2), greatest)):
        assert own.below <= value <= own.above
        assert own.above - own.below <= max(0.011 * abs(value), SHARP)
    assert greatest.at.t == pytest.approx(math.pi / 4, abs=0.1)
    assert least.at.t == pytest.approx(3, abs=1e-3)
    least, greatest = found.input_range(1, SHARP)
    assert least.below <= -0.25 <= least.above
    assert greatest.below <= 2 <= greatest.above


def test_an_input_that_touches_0_is_enclosed_to_a_share_of_its_limits():
    found = suprema('{kind: expressions, x: ["0", "0"], u: ["1 - cos(t)", "0"], horizon: 7}')
    least, _ = found.input_range(0, SHARP)
    assert -SHARP <= least.below <= 0 <= least.above <= SHARP


def test_a_plan_at_rest_is_exact():
    found = suprema("{kind: equilibrium, at: [0, 0], input: [0.3, pi/4]}")
    for index, value in ((0, Fraction("0.3")), (1, Fraction(math.pi) / 4)):
        for own in found.input_range(index, SHARP):
            slack = Fraction(1, 10**14)
            assert Fraction(own.below) - slack <= value <= Fraction(own.above) + slack
            assert own.above - own.below <= 1e-15
    least, _ = found.input_range(0, SHARP)
    assert Fraction(least.below) <= Fraction("0.3") <= Fraction(least.above)


def test_of_a_family_it_is_the_box():
    found = suprema("{kind: any, x: {x: [-1, 1], y: [0, 0]}, u: {u: [-0.3, 2], v: [0.1, 0.1]}}")
    least, greatest = found.input_range(0, SHARP)
    assert Fraction(least.below) <= Fraction("-0.3")
    assert least.below > -0.3001
    assert 2 <= greatest.above < 2.0001
    least, greatest = found.input_range(1, SHARP)
    assert Fraction(least.below) <= Fraction("0.1") <= Fraction(greatest.above)


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.tuples(NUMBERS, NUMBERS), min_size=2, max_size=6),
    st.sampled_from(["hold", "linear"]),
    fractions("1/10", 1, 100),
)
def test_through_knots_it_is_the_range_of_the_knots_that_count(u, interpolation, cut):
    """The plan ends within its last piece: what comes after the horizon is no part of it."""
    model = build(load_text(SYSTEM.format(plan="{kind: equilibrium, at: [0, 0]}")))
    t = tuple(Fraction(k) for k in range(len(u)))
    knots = Knots(t=t, x=((Fraction(0),) * 2,) * len(u), u=tuple(u), interpolation=interpolation)
    plan = piecewise_plan(model, knots, t[-1] - 1 + cut)
    found = Suprema(model, plan, 0.1, None, Effort())
    for index in (0, 1):
        values = [row[index] for row in u]
        end = values[-2] if interpolation == "hold" else values[-2] + cut * (values[-1] - values[-2])
        values = [*values[:-1], end]
        least, greatest = found.input_range(index, SHARP)
        slack = Fraction(1, 10**9)
        assert Fraction(least.below) <= min(values)
        assert Fraction(least.above) + slack >= min(values)
        assert Fraction(greatest.above) >= max(values)
        assert Fraction(greatest.below) - slack <= max(values)
        assert abs(Fraction(least.below) - min(values)) <= Fraction(SHARP) + abs(min(values)) / 50
        assert abs(Fraction(greatest.above) - max(values)) <= Fraction(SHARP) + abs(max(values)) / 50


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(texts(smooth=True, leaves=4))
def test_no_sample_is_outside(text):
    t = symbol("t")
    e = parse(text, symbols={"x": t, "y": t * t / 4, "t": t}).expression
    model = build(load_text(SYSTEM.format(plan="{kind: equilibrium, at: [0, 0]}")))
    plan = Plan((ZERO, ZERO), (e, ZERO), Fraction(2))
    found = Suprema(model, plan, 0.1, None, Effort(budget=20_000))
    least, greatest = found.input_range(0, SHARP)
    moments = np.linspace(0, 2, 401)
    values = Tape([e], ("t",)).run_floats([moments], moments.shape)[0]
    size = 1e-9 * (1 + np.abs(values).max())
    assert least.below - size <= values.min()
    assert values.max() <= greatest.above + size
    assert least.above >= values.min() - 0.02 * (1 + abs(values.min()))

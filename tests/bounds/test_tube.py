"""The tube as a domain: cuts lose no point, points called inside are inside, and the safe set is judged exactly."""

import math
from fractions import Fraction
from itertools import pairwise

import balls
import numpy as np
import pytest
from balls import evaluate, possible
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions
from systems import at_rest, model_of

from tubecert.enclosure.branch_and_bound import Effort, supremum
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.pencil import scalar
from tubecert.expression import PI, Expression, constant, parse, substitute, symbol
from tubecert.trajectory import Plan
from tubecert.tube import Tube, containment

t, x, y, z, u = (symbol(name) for name in "txyzu")
STATES = ("x", "y", "z")
HORIZON = Fraction(31, 10)
TEXTS = {
    "line": (("t/3 - 1", "2 - t", "1/7"), ("t**2",)),
    "circle": (("cos(2*t)", "sin(2*t)", "t/10"), ("3*sin(t) - 1",)),
    "wild": (("sin(5*t)*exp(-t/2)", "t**3/9 - t", "sqrt(1 + t)"), ("cos(7*t)",)),
    "rest": (("1/3", "-2/7", "0.1"), ("1/9",)),
}


precision = balls.precision(300, quiet=True)


def read(text: str) -> Expression:
    return parse(text, symbols={"t": t}).expression


def plan_of(name: str) -> Plan:
    states, inputs = TEXTS[name]
    return Plan(tuple(read(e) for e in states), tuple(read(e) for e in inputs), HORIZON)


def tube_of(name: str, rho: float, **more) -> Tube:
    plan = plan_of(name)
    return Tube(plan, rho, states=STATES, inputs=("u",), time=(Fraction(0), HORIZON), **more)


def along(name: str, when: Fraction):
    """x*(t) and u*(t) in ball arithmetic."""
    states, inputs = TEXTS[name]
    return [evaluate(e, {"t": when}) for e in states], [evaluate(e, {"t": when}) for e in inputs]


times = fractions(0, HORIZON, 1000)
unit = st.floats(-1, 1)


@st.composite
def tube_points(draw, name, rho):
    """A time and a point of the closed ball at that time (rational, within 1e-12 of where it was drawn)."""
    when = draw(times)
    direction = np.array(draw(st.tuples(unit, unit, unit)))
    length = np.linalg.norm(direction)
    direction = direction / length if length > 1e-3 else np.array([1.0, 0.0, 0.0])
    reach = draw(st.sampled_from([0.0, 0.5, 0.999, 1.0])) * rho * (1 - 1e-12)
    centre, inputs = along(name, when)
    point = [Fraction(float(c.mid()) + reach * d) for c, d in zip(centre, direction, strict=True)]
    return when, point, centre, inputs


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
@pytest.mark.parametrize("variables", [("x", "y", "z", "t"), ("z", "u", "x", "t"), ("y", "t"), ("u", "t")])
@given(data=st.data(), rho=st.sampled_from([1e-3, 0.25, 2.0]))
@settings(max_examples=25, deadline=None)
def test_cutting_a_box_loses_no_point_of_the_tube(name, variables, data, rho):
    when, point, _, inputs = data.draw(tube_points(name, rho))
    values = {**dict(zip(STATES, point, strict=True)), "t": when}
    lo, hi = [], []
    for v in variables:
        if v == "u":  # the box of an input may be anything that contains it
            lo.append(-np.inf)
            hi.append(np.inf)
            continue
        below, above = (data.draw(st.sampled_from([0.0, 1e-6, 0.01, 0.3, 5.0])) for _ in range(2))
        lo.append(np.nextafter(float(values[v]) - below, -np.inf))
        hi.append(np.nextafter(float(values[v]) + above, np.inf))
    tube = tube_of(name, rho)
    low, high, alive = tube.contract(variables, np.array([lo]), np.array([hi]))
    assert alive[0]
    for k, v in enumerate(variables):
        if v == "u":
            assert possible(inputs[0], low[0, k], high[0, k])
        else:
            assert Fraction(low[0, k]) <= values[v] <= Fraction(high[0, k])
            assert low[0, k] >= lo[k]
            assert high[0, k] <= hi[k]


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
@given(data=st.data())
@settings(max_examples=25, deadline=None)
def test_the_first_boxes_cover_the_tube(name, data):
    when, point, _, inputs = data.draw(tube_points(name, 0.4))
    variables = ("x", "z", "u", "t")
    lo, hi = tube_of(name, 0.4).boxes(variables)
    values = [point[0], point[2], None, when]
    inside = np.ones(len(lo), dtype=bool)
    for k, value in enumerate(values):
        if value is not None:
            inside &= [Fraction(a) <= value <= Fraction(b) for a, b in zip(lo[:, k], hi[:, k], strict=True)]
        else:
            inside &= [possible(inputs[0], a, b) for a, b in zip(lo[:, k], hi[:, k], strict=True)]
    assert inside.any()


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTS)
@given(
    at=st.lists(st.tuples(*[st.floats(-3, 3)] * 5), min_size=1, max_size=6),
    rho=st.sampled_from([1e-6, 0.3, 2.0]),
)
@settings(max_examples=25, deadline=None)
def test_points_called_inside_are_inside(name, at, rho):
    variables = ("x", "u", "y", "z", "t")
    lo, hi = tube_of(name, rho).inside(variables, np.array(at))
    assert len(lo)  # moved into the ball, they are found
    for low, high in zip(lo, hi, strict=True):
        when = Fraction(low[4])
        assert 0 <= when <= HORIZON
        assert low[4] == high[4]
        centre, inputs = along(name, when)
        places = [low[0], low[2], low[3]]
        square = sum((arb(float(p)) - c) ** 2 for p, c in zip(places, centre, strict=True))
        assert not square > arb(rho) ** 2
        assert square <= arb(rho) ** 2 * (1 + arb(2) ** -200)
        assert possible(inputs[0], low[1], high[1])
        assert high[1] - low[1] < 1e-10


def test_points_on_the_border_are_reached_to_nine_digits():
    tube = tube_of("rest", 0.5)
    lo, _ = tube.inside(("x", "y", "z"), np.array([[9.0, 0.0, 0.0], [1 / 3, -2 / 7, 0.1]]))
    centre = np.array([1 / 3, -2 / 7, 0.1])
    assert 0.5 * (1 - 2e-9) < np.linalg.norm(lo[0] - centre) <= 0.5
    assert np.array_equal(lo[1], centre)


def test_a_box_out_of_reach_is_dropped():
    tube = tube_of("rest", 0.25)
    corner = 0.25 / math.sqrt(3) + 1e-3
    lo = np.array([[1 / 3 + corner, -2 / 7 + corner, 0.1 + corner], [0.3, -0.3, 0.1]])
    _, _, alive = tube.contract(("x", "y", "z"), lo, lo + 1.0)
    assert alive.tolist() == [False, True]


def test_cuts_are_as_tight_as_the_ball():
    tube = tube_of("rest", 0.5)
    centre = np.array([1 / 3, -2 / 7, 0.1])
    lo, hi = (centre + np.array([0.3, -1, -1]))[None], (centre + 1)[None]
    low, high, _ = tube.contract(("x", "y", "z"), lo, hi)
    assert np.allclose((high - centre)[0], [0.5, 0.4, 0.4], atol=1e-12)
    assert np.allclose((low - centre)[0], [0.3, -0.4, -0.4], atol=1e-12)


def test_time_is_searched_only_if_the_plan_moves():
    assert tube_of("circle", 0.1).variables(("x",)) == ("x", "t")
    assert tube_of("rest", 0.1).variables(("x",)) == ("x",)
    assert tube_of("rest", 0.1).variables(("x", "t")) == ("x", "t")


def test_further_ranges_are_searched_too():
    tube = tube_of("circle", 0.5, extra={"w": (Fraction(1), Fraction(2))})
    found = supremum(scalar(symbol("w") * x), tube, Effort())
    assert abs(found.above - 3) < 0.05
    assert found.below <= 3 <= found.above


@pytest.mark.slow
def test_a_smaller_tube_has_smaller_suprema():
    sums = [
        supremum(SumOfNorms([((x,), (y,), (z,))]), tube_of("wild", rho), Effort()) for rho in (0.1, 0.2, 0.4)
    ]
    for inner, outer in pairwise(sums):
        assert inner.below < outer.above
        assert inner.above <= outer.above * 1.01


@pytest.mark.parametrize("name", TEXTS)
@given(start=times, width=st.sampled_from([0.0, 1e-9, 0.01, 0.5]), part=fractions(0, 1, 9))
@settings(max_examples=25, deadline=None)
def test_a_plan_encloses_itself_over_a_window(name, start, width, part):
    lo = float(start)
    hi = lo + width
    when = Fraction(lo) + part * (Fraction(hi) - Fraction(lo))
    states, inputs = plan_of(name).enclose(np.array([lo]), np.array([hi]))
    exact, fed = along(name, when)
    for k, value in enumerate(exact):
        assert possible(value, states.lo[0, k], states.hi[0, k])
        assert states.hi[0, k] - states.lo[0, k] <= 20 * width + 1e-12
    assert possible(fed[0], inputs.lo[0, 0], inputs.hi[0, 0])


def test_the_defect_of_a_plan_is_exact():
    model = model_of(STATES, ["-x + z", "x**2 - y", "-z"], [["0"], ["0"], ["1"]])
    assert all(row[0] is constant(0) for row in at_rest("0", "0", "0").defect(model))
    defect = plan_of("line").defect(model)
    # x*' = (1/3, -1, 0); f = (-(t/3 - 1) + 1/7, (t/3 - 1)^2 - (2 - t), -1/7); B u = (0, 0, t^2)
    for when in (Fraction(0), Fraction(1), Fraction(5, 2)):
        a = when / 3 - 1
        expected = (Fraction(1, 3) + a - Fraction(1, 7), -1 - a**2 + 2 - when, Fraction(1, 7) - when**2)
        values = [e.fraction for e in substitute([row[0] for row in defect], {"t": constant(when)})]
        assert tuple(values) == expected


def test_a_moving_plan_needs_a_horizon():
    with pytest.raises(ValueError, match="horizon"):
        _ = Plan((t,), (), None).time


def judge(name, rho, *sides):
    safe = tuple((Fraction(str(a)), Fraction(str(b))) for a, b in sides)
    return containment(plan_of(name), Fraction(rho), STATES, safe, Effort())


def test_a_tube_within_the_safe_set_is_certified():
    assert judge("circle", 0.25, (-1.26, 1.26), (-1.26, 1.26), (-0.26, 0.57)).verdict == "certified"


@pytest.mark.slow
def test_a_tube_that_leaves_is_refuted_with_the_worst_time_and_point():
    found = judge("circle", 0.25, (-1.26, 1.26), (-1.2, 1.26), (-0.26, 0.5))
    assert (found.verdict, found.state, found.side) == ("refuted", "z", "upper")
    assert found.t == pytest.approx(3.1)
    assert found.x[2] == pytest.approx(0.31 + 0.25)
    assert found.excess == pytest.approx(0.06, abs=1e-6)
    low = judge("circle", 0.25, (-1.26, 1.26), (-1.2, 1.26), (-0.26, 0.57))
    assert (low.state, low.side) == ("y", "lower")
    assert low.t == pytest.approx(3 * math.pi / 4, abs=1e-2)
    assert low.x[1] == pytest.approx(-1.25, abs=1e-6)


def test_a_constant_plan_is_judged_in_exact_arithmetic():
    # 1/3 + rho against the face at exactly 1/3 + rho, and one part in 10^30 inside it
    rho = Fraction(1, 4)
    face = Fraction(1, 3) + rho
    wide = (Fraction(-9), Fraction(9))
    plan = plan_of("rest")
    assert containment(plan, rho, STATES, ((-wide[1], face), wide, wide), Effort()).verdict == "certified"
    less = face - Fraction(1, 10**30)
    found = containment(plan, rho, STATES, ((-wide[1], less), wide, wide), Effort())
    assert found.verdict == "refuted"
    assert found.excess > 0


def test_a_plan_at_an_irrational_point():
    plan = Plan((PI / 4,), (), Fraction(1))
    low, high = Fraction("0.53539"), Fraction("1.03540")
    assert containment(plan, Fraction(1, 4), ("x",), ((low, high),), Effort()).verdict == "certified"
    less = ((low, Fraction("1.03539")),)
    assert containment(plan, Fraction(1, 4), ("x",), less, Effort()).verdict == "refuted"


def test_too_close_to_tell_is_undecided():
    plan = Plan((symbol("t") - symbol("t") ** 2,), (), Fraction(1))
    # the largest value, 1/4, is known only to a part in 10^7
    found = containment(plan, Fraction(1, 4), ("x",), ((Fraction(-1), Fraction(1, 2)),), Effort())
    assert found.verdict in ("undecided", "certified")
    less = ((Fraction(-1), Fraction("0.4999")),)
    assert containment(plan, Fraction(1, 4), ("x",), less, Effort()).verdict == "refuted"


def test_a_ball_projected_to_what_does_not_move_needs_no_time():
    tube = tube_of("line", 0.5)
    assert tube.variables(("z",)) == ("z",)
    assert tube.variables(("x", "z")) == ("x", "z", "t")
    assert tube.variables(("u",)) == ("u", "t")
    found = supremum(scalar(symbol("z") ** 2), tube, Effort())
    assert found.above == pytest.approx((1 / 7 + 0.5) ** 2, rel=1e-3)
    assert found.below <= (1 / 7 + 0.5) ** 2 <= found.above

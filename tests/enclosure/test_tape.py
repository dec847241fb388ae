"""Straight-line programs on floats and intervals, against ball arithmetic on the text."""

from fractions import Fraction

import balls
import numpy as np
import pytest
from balls import evaluate, possible
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import NAMES, points, read, texts

from tubecert.enclosure.interval import Interval
from tubecert.enclosure.tape import Tape
from tubecert.expression import constant, norm, sin, sqrt, symbol

SETTINGS = settings(max_examples=60, deadline=None)
x, y = symbol("x"), symbol("y")


precision = balls.precision(400)

boxes = st.fixed_dictionaries(
    {name: st.tuples(st.floats(-2, 2), st.sampled_from([0.0, 1e-9, 0.1, 1.0])) for name in NAMES}
)
parts = st.fixed_dictionaries(
    {name: st.sampled_from([Fraction(0), Fraction(1), Fraction(2, 7)]) for name in NAMES}
)


@pytest.mark.slow
@given(text=texts(), box=boxes, part=parts)
@SETTINGS
def test_intervals_contain_the_value_of_the_text(text, box, part):
    ends = {name: (lo, lo + width) for name, (lo, width) in box.items()}
    inner = {
        name: Fraction(lo) + part[name] * (Fraction(hi) - Fraction(lo)) for name, (lo, hi) in ends.items()
    }
    tape = Tape([read(text)], NAMES)
    found = tape.run([Interval(np.array([ends[n][0]]), np.array([ends[n][1]])) for n in NAMES], (1,))
    assert possible(evaluate(text, inner), found.lo[0, 0], found.hi[0, 0])


@pytest.mark.slow
@given(text=texts(), point=points)
@SETTINGS
def test_thin_intervals_and_floats_agree_with_the_text(text, point):
    tape = Tape([read(text)], NAMES)
    at = [np.array([float(point[name])]) for name in NAMES]
    exact = evaluate(text, {name: Fraction(float(q)) for name, q in point.items()})
    thin = tape.run([Interval.exact(v) for v in at], (1,))
    assert possible(exact, thin.lo[0, 0], thin.hi[0, 0])
    value = float(exact.mid())
    if abs(value) < 1e100 and thin.hi[0, 0] - thin.lo[0, 0] < 1e-3:
        floats = tape.run_floats(at, (1,))[0, 0]
        spread = thin.hi[0, 0] - thin.lo[0, 0]
        assert abs(floats - value) <= 4 * spread + 1e-14 * abs(value) + 1e-300


@pytest.mark.slow
@given(several=st.lists(texts(leaves=6), min_size=2, max_size=5), box=boxes)
@SETTINGS
def test_many_outputs_share_slots_without_harm(several, box):
    values = [Interval(np.array([lo]), np.array([lo + width])) for lo, width in box.values()]
    expressions = [read(text) for text in several]
    outputs = [*expressions, expressions[0], x, constant(Fraction(1, 3)), *reversed(expressions)]
    together = Tape(outputs, NAMES).run(values, (1,))
    for row, e in enumerate(outputs):
        alone = Tape([e], NAMES).run(values, (1,))
        assert together.lo[row, 0] == alone.lo[0, 0]
        assert together.hi[row, 0] == alone.hi[0, 0]


def test_slots_are_reused():
    e = x
    for _ in range(300):
        e = sin(e) + y
    assert len(Tape([e], ("x", "y"))._memory) <= 5


def test_argument_that_is_used_twice_survives():
    s = sin(x)
    e = (s * s + s) * (s + sin(s)) + s
    point = {"x": Fraction(3, 4), "y": Fraction(0), "t": Fraction(0)}
    found = Tape([e], ("x",)).run([Interval.exact(np.array([0.75]))], (1,))
    text = "(sin(x)*sin(x) + sin(x))*(sin(x) + sin(sin(x))) + sin(x)"
    assert possible(evaluate(text, point), found.lo[0, 0], found.hi[0, 0])
    assert found.hi[0, 0] - found.lo[0, 0] < 1e-13


@pytest.mark.parametrize(
    "text", ["1/x", "sqrt(x)", "tan(2*x)", "x**-3", "1/(x - x**2)", "sqrt(x)/sqrt(x)", "exp(1/x)"]
)
def test_what_is_undefined_on_the_box_is_unbounded_and_never_nan(text):
    tape = Tape([read(text)], NAMES)
    wide = Interval(np.array([-1.0]), np.array([1.0]))
    found = tape.run([wide, wide, wide], (1,))
    assert not np.isnan(found.lo).any()
    assert not np.isnan(found.hi).any()
    if text != "exp(1/x)":
        assert found.lo[0, 0] == -np.inf
    assert found.hi[0, 0] == np.inf


def test_a_sine_of_anything_is_at_most_one():
    wide = Interval(np.array([-1.0]), np.array([1.0]))
    found = Tape([sin(1 / x)], ("x",)).run([wide], (1,))
    assert (found.lo[0, 0], found.hi[0, 0]) == (-1, 1)


def test_constants_beyond_the_floats_bound_nothing_but_break_nothing():
    huge = constant(Fraction(10) ** 400)
    tape = Tape([huge * x, x / huge], ("x",))
    found = tape.run([Interval.exact(np.array([2.0]))], (1,))
    assert found.hi[0, 0] == np.inf
    assert found.lo[0, 0] >= 1e308
    assert found.lo[1, 0] <= 0 < found.hi[1, 0]
    assert tape.run_floats([np.array([2.0])], (1,)).shape == (2, 1)


def test_batches_broadcast():
    e = [x * y, norm([x, y]), sqrt(1 + x * x), constant(2)]
    a = np.linspace(-1, 1, 7)
    found = Tape(e, ("x", "y")).run([Interval(a, a + 0.1), Interval.exact(a)], (7,))
    assert found.lo.shape == (4, 7)
    assert np.all(found.lo[1] <= np.hypot(a, a))
    assert np.all(found.lo[3] == 2)
    floats = Tape(e, ("x", "y")).run_floats([a, a], (7,))
    assert np.allclose(floats[1], np.hypot(a, a))


def test_an_unknown_symbol_is_refused():
    with pytest.raises(ValueError, match="z is not an input"):
        Tape([symbol("z")], ("x",))

"""Functions of tables in every arithmetic, against scipy's interpolants and exact values at rational points."""

import pickle
from fractions import Fraction

import numpy as np
import pytest
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PchipInterpolator

from tubecert.enclosure import lookup as intervals
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.tape import Tape
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ExpressionError, Lookup, derivative, full_text, is_zero, parse, symbol
from tubecert.expression.graph import table as tabled
from tubecert.expression.lookup import cubic_slopes, monotone_slopes
from tubecert.recheck import lookup as balls
from tubecert.recheck.boxes import Field
from tubecert.recheck.grammar import read
from tubecert.recheck.terms import looked_up, slopes, variable

_numbers = st.integers(-60, 60).map(lambda n: Fraction(n, 7))


@st.composite
def tables(draw, least=2):
    count = draw(st.integers(least, 7))
    x = sorted(draw(st.lists(_numbers, min_size=count, max_size=count, unique=True)))
    y, d = (draw(st.lists(_numbers, min_size=count, max_size=count)) for _ in range(2))
    return Lookup("curve", tuple(x), tuple(y), tuple(d))


def derived(table, order):
    for _ in range(order):
        table = table.derivative
    return table


def at_rechecks(table):
    own = balls.Table(table.name, tuple(zip(table.knots, table.values, table.slopes, strict=True)))
    for _ in range(table.order):
        own = own.slope
    return own


def inside(table, ends):
    """Points of the table in proportion to numbers from 0 to 1, ascending."""
    first, last = table.knots[0], table.knots[-1]
    return sorted(first + Fraction(q) * (last - first) for q in ends)


EXAMPLE = Lookup(
    "curve",
    tuple(map(Fraction, (-2, "-0.3", 0, 1, "2.5"))),
    tuple(map(Fraction, (-1, 0, "0.2", 3, 2))),
    tuple(map(Fraction, (0, 1, -2, "0.5", 1))),
)


@pytest.mark.slow
@given(tables(4))
@settings(max_examples=40, deadline=None)
def test_slopes_are_those_of_scipy(table):
    x, y = (np.array([float(q) for q in row]) for row in (table.knots, table.values))
    size = 1 + max(abs(y)) / min(np.diff(x))
    monotone = [float(q) for q in monotone_slopes(table.knots, table.values)]
    np.testing.assert_allclose(monotone, PchipInterpolator(x, y).derivative()(x), atol=1e-9 * size)
    cubic = [float(q) for q in cubic_slopes(table.knots, table.values)]
    np.testing.assert_allclose(cubic, CubicSpline(x, y).derivative()(x), atol=1e-7 * size)


@pytest.mark.parametrize("count", [2, 3])
def test_slopes_of_few_points_are_those_of_scipy(count):
    x, y = (Fraction(0), Fraction(1), Fraction(3))[:count], (Fraction(1), Fraction(4), Fraction(3))[:count]
    floats = [[float(q) for q in row] for row in (x, y)]
    for ours, theirs in ((monotone_slopes, PchipInterpolator), (cubic_slopes, CubicSpline)):
        found = [float(q) for q in ours(x, y)]
        np.testing.assert_allclose(found, theirs(*floats).derivative()(floats[0]), atol=1e-12)


@pytest.mark.slow
@given(tables(), st.lists(st.floats(0, 1), min_size=1, max_size=5))
@settings(max_examples=40, deadline=None)
def test_the_function_is_hermites(table, ends):
    x, y, d = (np.array([float(q) for q in row]) for row in (table.knots, table.values, table.slopes))
    theirs = CubicHermiteSpline(x, y, d)
    points = inside(table, ends)
    floats = np.clip(np.array([float(q) for q in points]), x[0], x[-1])
    for order in (0, 1):
        own = derived(table, order)
        size = 1e-9 * (1 + max(abs(theirs(np.linspace(x[0], x[-1], 50), order)).max(), 1) / min(np.diff(x)))
        np.testing.assert_allclose([float(own.at(q)) for q in points], theirs(floats, order), atol=size)
        np.testing.assert_allclose(intervals.values(own, floats), theirs(floats, order), atol=size)
        assert [at_rechecks(own).value(q) for q in points] == [own.at(q) for q in points]


@pytest.mark.slow
@given(tables(), st.lists(st.floats(0, 1), min_size=2, max_size=6), st.integers(0, 4))
@settings(max_examples=40, deadline=None)
def test_both_enclosures_contain_every_value(table, ends, order):
    """And are as narrow as the values, and a rounding, where these are many."""
    own = derived(table, order)
    points = inside(table, ends)
    x = Interval.of(points[0]).hull(Interval.of(points[-1]))
    inner = [points[0] + Fraction(k, 40) * (points[-1] - points[0]) for k in range(41)]
    inner += [knot for knot in table.knots if points[0] <= knot <= points[-1]]
    exact = [value for q in inner if (value := own.at(q)) is not None]
    found = intervals.enclosure(own, x).sanitised()
    ball = balls.over(at_rechecks(own), arb(float(x.lo)).union(arb(float(x.hi))))
    for value in exact:
        assert np.isinf(found.lo) or Fraction(float(found.lo)) <= value <= Fraction(float(found.hi))
        assert ball.contains(arb(value.numerator) / value.denominator) or ball.is_nan()
    jumps = any(points[0] <= knot <= points[-1] for knot in table.knots[1:-1])
    if order < 3 and not (jumps and order == 2):
        spread = float(max(exact) - min(exact))
        curved = float(points[-1] - points[0]) ** 2 / 40 * 6 * max(map(abs, _thirds(table)))
        assert float(found.hi - found.lo) <= 1.001 * spread + curved + 1e-6 * (1 + _size(own))
    elif order >= 3:
        assert ball.is_nan() == np.isinf(found.lo) == jumps


def _thirds(table):
    """Bounds of what a quadratic or a cubic does between samples: second and third derivatives."""
    return [float(c) * (table.knots[-1] - table.knots[0] + 1) for piece in table.pieces for c in piece[2:]]


def _size(table):
    return max(abs(float(c)) for piece in table.pieces for c in piece)


def test_a_turning_point_inside_is_not_missed():
    """Between 1 and 2.5 the cubic turns twice; the ends alone would say [2, 3]."""
    found = intervals.enclosure(EXAMPLE, Interval(np.array([1.0]), np.array([2.5])))
    ball = balls.over(at_rechecks(EXAMPLE), arb(1).union(arb("2.5")))
    values = [float(EXAMPLE.at(1 + Fraction(3 * k, 2_000))) for k in range(1_001)]
    assert found.lo[0] == pytest.approx(min(values), abs=1e-5)
    assert found.hi[0] == pytest.approx(max(values), abs=1e-5)
    assert float(ball.lower()) <= min(values)
    assert float(ball.upper()) >= max(values)


@pytest.mark.parametrize("beyond", [-2.1, 2.6, np.nan, np.inf])
def test_beyond_its_ends_nothing_is_known(beyond):
    with np.errstate(all="ignore"):  # as tapes do
        assert np.isnan(intervals.values(EXAMPLE, np.array([beyond]))).all()
        found = intervals.enclosure(EXAMPLE, Interval(np.array([min(0.0, beyond)]), np.array([beyond])))
    assert np.isnan(found.lo).all()
    assert balls.over(at_rechecks(EXAMPLE), arb(0).union(arb(beyond))).is_nan()
    assert EXAMPLE.at(Fraction(-3)) is None


def test_the_ends_belong_to_it():
    for end in (EXAMPLE.knots[0], EXAMPLE.knots[-1]):
        at = Interval.of(end)
        assert np.isfinite(intervals.enclosure(EXAMPLE, at).lo)
        assert balls.over(at_rechecks(EXAMPLE), arb(float(end))).is_finite()


def test_texts_derivatives_and_pickles():
    parsed = parse("2*curve(x)**2 + y", symbols={v: symbol(v) for v in "xy"}, tables={"curve": EXAMPLE})
    text = full_text(parsed.expression, parsed.obligations)
    assert text == "2*curve(x)**2 + y"
    assert len(parsed.obligations) == 2
    term, owed = read(text, {v: variable(v) for v in "xy"}, tables={"curve": at_rechecks(EXAMPLE)})
    assert [duty.kind for duty in owed] == ["positive", "positive"]
    slope = derivative(parsed.expression, "x")
    x = np.array([0.4, 1.7])
    ours = Tape([parsed.expression, slope], ("x", "y")).run_floats([x, x], (2,))
    for row, root in zip(ours, (term, slopes([term], "x")[0]), strict=True):
        for value, at in zip(row, x, strict=True):
            assert (
                Field([root])
                .at([arb(at)] * len(Field([root]).variables))[0]
                .overlaps(arb(value, abs(value) * 1e-12))
            )
    assert pickle.loads(pickle.dumps(slope)) is slope


def test_what_folding_drops_is_still_owed():
    tables = {"curve": EXAMPLE}
    parsed = parse("0*curve(x) + y", symbols={v: symbol(v) for v in "xy"}, tables=tables)
    text = full_text(parsed.expression, parsed.obligations)
    assert len(parse(text, symbols={v: symbol(v) for v in "xy"}, tables=tables).obligations) == 2
    assert parse("curve(1)", symbols={}, tables=tables).expression.fraction == 3
    with pytest.raises(ExpressionError, match="lies outside of the table, which goes from -2 to"):
        parse("curve(7)", symbols={}, tables=tables)


def test_a_table_is_known_by_what_it_says():
    other = Lookup("curve", EXAMPLE.knots, EXAMPLE.values, EXAMPLE.slopes[::-1])
    ours, theirs = (
        parse("curve(x)", symbols={"x": symbol("x")}, tables={"curve": each}).expression
        for each in (EXAMPLE, other)
    )
    assert is_zero(ours - theirs) is not True
    assert is_zero(ours * (ours + 1) - ours**2 - ours) is True


BOXES = st.lists(st.tuples(st.floats(-1.9, 2.4), st.floats(-1.9, 2.4)), min_size=1, max_size=2)


@pytest.mark.slow
@given(BOXES, st.integers(0, 2))
@settings(max_examples=30, deadline=None)
def test_expansions_contain_every_value_across_knots(sides, order):
    """Of a matrix with a table or a derivative of it, expanded as far as its knots allow; recheck's as well."""
    own = derived(EXAMPLE, order)
    x, y = sides[0], sides[-1]
    lo, hi = np.array([[min(x), min(y)]]), np.array([[max(x), max(y)]])
    e = parse("y*x + y**2", symbols={v: symbol(v) for v in "xy"}).expression
    entry = e * tabled(own, symbol("x")) + symbol("y")
    expansion = MatrixFunction([((entry,),)]).expand(lo, hi)
    whole = expansion.over_vertices(expansion.filled(0))
    high, low = (expansion.mid[0] + whole).max(), (expansion.mid[0] - whole).min()
    X, Y = variable("x"), variable("y")
    field = Field([(Y * X + Y * Y) * looked_up(at_rechecks(own), X) + Y])
    (ball,) = field.hull(list(zip(lo[0], hi[0], strict=True)))
    for s in np.linspace(0, 1, 8):
        for t in np.linspace(0, 1, 8):
            p, q = (Fraction(float(lo[0, i] + r * (hi[0, i] - lo[0, i]))) for i, r in enumerate((s, t)))
            p, q = (min(max(v, Fraction(lo[0, i])), Fraction(hi[0, i])) for i, v in enumerate((p, q)))
            known = own.at(p)
            if known is not None:
                value = (q * p + q * q) * known + q
                assert low <= float(value) + 1e-9
                assert high >= float(value) - 1e-9
                assert ball.overlaps(arb(float(value), 1e-9))

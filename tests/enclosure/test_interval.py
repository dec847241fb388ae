"""Interval arithmetic against ball arithmetic at 240 bits: every operation contains what it must."""

import math
from fractions import Fraction

import balls
import numpy as np
import pytest
from balls import ball
from flint import arb
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from tubecert.enclosure import interval as iv
from tubecert.enclosure.interval import PI, Interval, fraction_bounds
from tubecert.enclosure.outward import down, up

SETTINGS = settings(max_examples=60, deadline=None)
DENORMAL = 5e-324
NASTY = [
    0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-8, DENORMAL, -DENORMAL, 1e-310, 2.0**-1022, 1e-200, 1e150, -1e150,
    1e308, -1.7976931348623157e308, 709.78, -745.2, 1e6, -1e6, 999999.9, 1e15,
    *(float(k * np.pi / 2) for k in (-7, -2, -1, 1, 2, 3, 4, 101, 636000)),
    *(float(np.nextafter(k * np.pi / 2, d)) for k in (1, 2, 3, 4) for d in (-np.inf, np.inf)),
]  # fmt: skip
finite = st.floats(allow_nan=False, allow_infinity=False)
numbers = st.sampled_from(NASTY) | finite | st.floats(-10, 10) | st.floats(-1e-3, 1e-3)


precision = balls.precision(240, quiet=True)

PARTS = [Fraction(0), Fraction(1), Fraction(1, 2), Fraction(1, 3), Fraction(997, 1000)]


def intervals(of=numbers):
    """(lo, hi), often thin, often one float wide, and an exact rational number of it.

    Strategies are made once, at the head of this file: one that is made for every example takes longer than the test.
    """

    def drawn(values):
        a, b, kind, part = values
        if kind != "wide":
            b = a if kind == "thin" else float(np.nextafter(a, 0.0))
        lo, hi = min(a, b), max(a, b)
        return (lo, hi), Fraction(lo) + part * (Fraction(hi) - Fraction(lo))

    return st.tuples(of, of, st.sampled_from(["wide", "thin", "narrow"]), st.sampled_from(PARTS)).map(drawn)


ANY = intervals()


def within(value, found):
    """Whether a ball may meet the interval; NaN bounds say nothing, hence hold."""
    lo, hi = float(found.lo), float(found.hi)
    if math.isnan(lo) or math.isnan(hi):
        return True
    below = lo == -math.inf or not value < arb(lo)
    return below and (hi == math.inf or not value > arb(hi))


def thin_or_wide(bounds):
    return Interval.exact(bounds[0]) if bounds[0] == bounds[1] else Interval(*bounds)


ARITHMETIC = {
    "+": (lambda a, b: a + b, lambda p, q: p + q),
    "-": (lambda a, b: a - b, lambda p, q: p - q),
    "*": (lambda a, b: a * b, lambda p, q: p * q),
    "/": (lambda a, b: a / b, lambda p, q: p / q),
}


def check_arithmetic(first, second, name):
    operation, exact = ARITHMETIC[name]
    (a, p), (b, q) = first, second
    assume(name != "/" or q != 0)
    assert within(ball(exact(p, q)), operation(thin_or_wide(a), thin_or_wide(b)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ARITHMETIC)
@given(first=ANY, second=ANY)
@SETTINGS
def test_arithmetic_contains_the_exact_result(name, first, second):
    check_arithmetic(first, second, name)


SMALL = [Fraction(n, 2) for n in (-7, -4, -1, 0, 2, 3, 6)]
SPANS = [(a, b) for a in SMALL for b in SMALL if a <= b]


@pytest.mark.parametrize("name", ARITHMETIC)
@pytest.mark.parametrize("a", SPANS, ids=str)
def test_every_corner_counts(name, a):
    """All pairs of spans of every sign: the extremes of the exact corners, give or take two floats, batch or not."""
    operation, exact = ARITHMETIC[name]
    spans = [b for b in SPANS if name != "/" or not b[0] <= 0 <= b[1]]
    columns = [np.array([float(end) for end in ends]) for ends in zip(*spans, strict=True)]
    batch = operation(Interval(float(a[0]), float(a[1])), Interval(*columns))
    for k, b in enumerate(spans):
        corners = [exact(p, q) for p in a for q in b]
        single = operation(thin_or_wide(tuple(map(float, a))), thin_or_wide(tuple(map(float, b))))
        for lo, hi in ((batch.lo[k], batch.hi[k]), (single.lo, single.hi)):
            least, most = Fraction(float(lo)), Fraction(float(hi))
            assert least <= min(corners)
            assert max(corners) <= most
            assert min(corners) - least <= Fraction(1, 10**14)
            assert most - max(corners) <= Fraction(1, 10**14)


@pytest.mark.slow
@given(drawn=intervals(numbers.filter(lambda x: abs(x) < 1e40)), n=st.integers(-7, 9))
@SETTINGS
def test_powers_contain_the_exact_result(drawn, n):
    a, p = drawn
    assume(n >= 0 or p != 0)
    assert within(ball(p**n), thin_or_wide(a) ** n)


@pytest.mark.parametrize("n", range(6))
def test_powers_of_every_sign(n):
    for lo, hi, low, high in [(-3, -2, 2, 3), (-3, 2, 0, 3), (-2, 3, 0, 3), (2, 3, 2, 3)]:
        found = Interval(float(lo), float(hi)) ** n
        expected = (low**n, high**n) if n % 2 == 0 and n else (lo**n, hi**n)
        assert np.allclose([found.lo, found.hi], expected, rtol=1e-14, atol=1e-320)


def test_a_power_may_reach_zero_from_above_only():
    assert (Interval(-1.0, 2.0) ** 2).lo == 0
    assert (Interval(0.0, 1e-200) ** 4).lo == 0


UNIT = st.floats(-1, 1) | st.sampled_from([1.0, -1.0]) | st.floats(0, 1e-9).map(lambda e: 1 - e)
DOMAINS = {
    "sqrt": (iv.sqrt, lambda x: x.sqrt(), numbers.map(abs)),
    "exp": (iv.exp, lambda x: x.exp(), numbers.filter(lambda x: abs(x) < 5000)),
    "expm1": (iv.expm1, lambda x: x.expm1(), numbers.filter(lambda x: abs(x) < 5000)),
    "log1p": (iv.log1p, lambda x: x.log1p(), numbers.filter(lambda x: x > -1) | st.floats(-1, 0, exclude_min=True)),
    "sin": (iv.sin, lambda x: x.sin(), numbers.filter(lambda x: abs(x) < 1e30)),
    "cos": (iv.cos, lambda x: x.cos(), numbers.filter(lambda x: abs(x) < 1e30)),
    "tan": (iv.tan, lambda x: x.tan(), numbers.filter(lambda x: abs(x) < 1e30)),
    "atan": (iv.atan, lambda x: x.atan(), numbers),
    "asin": (iv.asin, lambda x: x.asin(), UNIT),
    "acos": (iv.acos, lambda x: x.acos(), UNIT),
    "sinh": (iv.sinh, lambda x: x.sinh(), numbers.filter(lambda x: abs(x) < 5000)),
    "cosh": (iv.cosh, lambda x: x.cosh(), numbers.filter(lambda x: abs(x) < 5000)),
    "tanh": (iv.tanh, lambda x: x.tanh(), numbers.filter(lambda x: abs(x) < 5000)),
    "log": (iv.log, lambda x: x.log(), numbers.map(abs).filter(bool)),
}  # fmt: skip
LIBRARY = {"atan": "arctan", "asin": "arcsin", "acos": "arccos"}


IN_DOMAINS = {name: intervals(domain) for name, (_, _, domain) in DOMAINS.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", DOMAINS)
@given(data=st.data())
@SETTINGS
def test_functions_contain_the_exact_result(name, data):
    function, exact, _ = DOMAINS[name]
    a, p = data.draw(IN_DOMAINS[name])
    assert within(exact(ball(p)), function(thin_or_wide(a)))


@pytest.mark.parametrize("name", ["sin", "cos"])
@given(
    k=st.integers(-300_000, 300_000) | st.integers(-600_000_000_000, 600_000_000_000),
    left=st.integers(0, 3),
    right=st.integers(0, 3),
)
@SETTINGS
def test_waves_near_multiples_of_a_right_angle(name, k, left, right):
    centre = float(k * np.pi / 2)
    a = centre - left * np.spacing(abs(centre) + 1), centre + right * np.spacing(abs(centre) + 1)
    found = DOMAINS[name][0](Interval(*a))
    for p in (Fraction(a[0]), Fraction(a[1]), (Fraction(a[0]) + Fraction(a[1])) / 2):
        assert within(DOMAINS[name][1](ball(p)), found)
    assert -1 <= found.lo <= found.hi <= 1
    assert found.hi - found.lo < 1e-8 * max(1, abs(centre) / 1e5)


@pytest.mark.parametrize("name", ["sin", "cos"])
@given(k=st.integers(-300_000_000_000, 300_000_000_000), off=st.floats(-1e-3, 1e-3))
@example(k=17_042_735_086, off=1e-3)  # of sin: the float quotient falls on its other side
@SETTINGS
def test_a_peak_of_a_large_angle_is_found(name, k, off):
    """It lies a float beside where the interval begins or ends."""
    peak = arb.pi() * (arb(k) + (arb(0.5) if name == "sin" else 0))
    near = float(peak.mid())
    lo, hi = sorted((near, near + off))
    found = DOMAINS[name][0](Interval(lo, hi))
    if arb(lo) < peak < arb(hi):
        assert (found.lo if k % 2 else found.hi) == (-1 if k % 2 else 1)
    assert all(within(DOMAINS[name][1](arb(end)), found) for end in (lo, hi))


@pytest.mark.parametrize("name", ["sin", "cos"])
def test_waves_of_long_intervals_reach_both_ends(name):
    for a in [(0.0, 7.0), (2e12, 2e12), (-np.inf, np.inf), (0.0, np.inf), (np.nan, 1.0)]:
        found = DOMAINS[name][0](Interval(*a))
        assert (found.lo, found.hi) == (-1, 1)


@given(k=st.integers(-1000, 1000), side=st.sampled_from([-1, 1]), width=st.floats(0, 1))
@SETTINGS
def test_tangent_across_a_pole_is_undefined(k, side, width):
    pole = float((k + 0.5) * np.pi)
    a = (pole - 1e-7, pole + width) if side > 0 else (pole - width, pole + 1e-7)
    assert np.isnan(iv.tan(Interval(*a)).lo)


@pytest.mark.slow
@given(drawn=st.lists(intervals(numbers.filter(lambda x: abs(x) < 1e150)), min_size=1, max_size=4))
@SETTINGS
def test_norm_and_direction_contain_the_exact_result(drawn):
    exact = [q for _, q in drawn]
    boxes = [thin_or_wide(a) for a, _ in drawn]
    square = sum((q * q for q in exact), start=Fraction(0))
    length = ball(square).sqrt()
    assert within(length, iv.norm(boxes))
    for i, q in enumerate(exact):
        found = iv.direction(boxes, i)
        assert -1 <= found.lo <= found.hi <= 1
        if square > 0:
            assert within(ball(q) / length, found)


def test_the_direction_of_a_norm_that_may_vanish_is_unknown():
    found = iv.direction([Interval(-1.0, 2.0), Interval(0.0, 1.0)], 1)
    assert (found.lo, found.hi) == (-1, 1)


UNARY = {
    **{name: function for name, (function, _, _) in DOMAINS.items()},
    "square": lambda a: a**2,
    "cube": lambda a: a**3,
    "inverse": lambda a: 1 / a,
    "affine": lambda a: a * 3 - 2,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", UNARY)
@given(ends=st.lists(numbers.filter(lambda x: abs(x) < 500), min_size=4, max_size=4).map(sorted))
@SETTINGS
def test_inclusion_is_monotone(name, ends):
    if name in ("sqrt", "log1p", "log"):
        ends = sorted(map(abs, ends))
    if name in ("asin", "acos"):
        ends = sorted(np.sin(ends).tolist())
    outer, inner = UNARY[name](Interval(ends[0], ends[3])), UNARY[name](Interval(ends[1], ends[2]))
    outer = outer.sanitised()
    # at equal ends both round the same way; elsewhere library functions are only monotone up to their error
    slack = 1e-14 * max(abs(float(inner.sanitised().lo)), abs(float(inner.sanitised().hi)))
    if np.isfinite(slack):
        assert outer.lo <= inner.lo + slack
        assert inner.hi - slack <= outer.hi


@given(ends=st.tuples(*[st.lists(numbers, min_size=4, max_size=4).map(sorted)] * 2))
@SETTINGS
def test_sums_products_and_quotients_are_inclusion_monotone(ends):
    for operation, _ in ARITHMETIC.values():
        outer = operation(*(Interval(e[0], e[3]) for e in ends)).sanitised()
        inner = operation(*(Interval(e[1], e[2]) for e in ends))
        if not np.isnan(inner.lo):
            assert outer.lo <= inner.lo
            assert inner.hi <= outer.hi


INFINITE = [(-np.inf, np.inf), (-np.inf, 1.0), (2.0, np.inf), (0.0, np.inf)]


@pytest.mark.parametrize("a", INFINITE)
@pytest.mark.parametrize("b", [*INFINITE, (-1.0, 2.0), (0.0, 0.0), (3.0, 3.0)])
def test_unbounded_operands_lose_no_member(a, b):
    inner = [max(a[0], -1e200), min(a[1], 1e200)], [max(b[0], -1e100), min(b[1], 1e100)]
    for name, (operation, exact) in ARITHMETIC.items():
        found = operation(Interval(*a), Interval(*b)).sanitised()
        for p in map(Fraction, inner[0]):
            for q in map(Fraction, inner[1]):
                if name != "/" or q != 0:
                    assert within(ball(exact(p, q)), found)


BEYOND = float(np.nextafter(1.0, 2.0))


def test_bounded_functions_stay_in_their_ranges():
    """Whatever the operand: a proof may rest on |tanh| <= 1, and on pi/2 rounded outward."""
    for a in (Interval(-np.inf, np.inf), Interval(-1e300, 1e300), Interval(30.0, 40.0)):
        assert np.all(np.abs([iv.tanh(a).lo, iv.tanh(a).hi]) <= 1)
        assert iv.tanh(a).hi == 1
        assert 0 < iv.atan(a).hi - np.pi / 2 < 1e-15 or a.hi == 40
        assert iv.cosh(a).lo >= 1
    assert iv.cosh(Interval(-1.0, 2.0)).lo == 1
    edge = iv.acos(Interval(-1.0, 1.0))
    assert edge.lo == 0
    assert np.pi < edge.hi < np.pi + 1e-15


@pytest.mark.parametrize("near", [0.1, np.float64(0.1), np.array([0.1]), "0.1", None])
def test_what_says_nothing_of_its_error_is_no_enclosure(near):
    """A float that was computed or sampled cannot slip into a proof: whoever takes it as exact has to say so."""
    unit = Interval.exact(1.0)
    for use in (Interval.of, unit.__add__, unit.__mul__, unit.__sub__, unit.__truediv__, unit.__rsub__):
        with pytest.raises(TypeError):
            use(near)
    assert Interval.of(Fraction(1, 10)).lo < 0.1 <= Interval.of(Fraction(1, 10)).hi
    assert (Interval.of(3).lo, Interval.of(2**60 + 1).hi) == (3.0, np.nextafter(2.0**60, np.inf))


def test_undefined_operations_say_nothing():
    unit = Interval(-1.0, 1.0)
    undefined = [1 / unit, iv.sqrt(unit), iv.log1p(Interval(-1.0, 0.0)), unit**-2, unit / unit]
    undefined += [iv.log(unit), iv.log(Interval(0.0, 1.0))]
    for found in (*undefined, *(f(Interval(0.0, BEYOND)) for f in (iv.asin, iv.acos))):
        opened = found.sanitised()
        assert (opened.lo, opened.hi) == (-np.inf, np.inf)


@pytest.mark.slow
@given(
    q=st.fractions()
    | st.builds(lambda n, e: Fraction(n) * Fraction(10) ** e, st.integers(), st.integers(-400, 400))
)
@example(Fraction(10) ** 400)
@example(-(Fraction(10) ** 400))
@example(Fraction(1, 10**400))
@example(Fraction(2**53 + 1))
@example(Fraction(np.finfo(float).max) + 1)
@SETTINGS
def test_fraction_bounds_are_the_floats_next_to_it(q):
    lo, hi = fraction_bounds(q)
    assert lo == -math.inf or Fraction(lo) <= q
    assert hi == math.inf or Fraction(hi) >= q
    if lo == hi:
        assert Fraction(lo) == q
    else:
        assert np.nextafter(lo, np.inf) == hi
        assert not any(math.isfinite(x) and Fraction(x) == q for x in (lo, hi))


def test_pi_lies_inside():
    assert arb(float(PI.lo)) < arb.pi() < arb(float(PI.hi))
    assert np.nextafter(float(PI.lo), np.inf) == PI.hi


@given(drawn=ANY)
@SETTINGS
def test_midpoint_and_radius_cover(drawn):
    bounds, _ = drawn
    a = Interval(*bounds)
    assume(np.isfinite(a.rad))
    mid, rad = Fraction(float(a.mid)), Fraction(float(a.rad))
    assert mid - rad <= Fraction(bounds[0])
    assert Fraction(bounds[1]) <= mid + rad
    assert a.mignitude <= abs(mid) + rad
    assert a.magnitude == max(abs(bounds[0]), abs(bounds[1]))


def sample(name):
    rng = np.random.default_rng(7)
    spread = rng.choice([-1.0, 1.0], 1500) * 10.0 ** rng.uniform(-290, 0, 1500)
    if name in ("exp", "expm1"):
        return np.concatenate([rng.uniform(-700, 709, 2000), rng.uniform(-2, 2, 1000), spread])
    if name == "log1p":
        large = 10.0 ** rng.uniform(-290, 300, 1500)
        return np.concatenate([rng.uniform(-1, 5, 2000), large, spread[spread > -1]])
    if name in ("asin", "acos"):
        return np.concatenate([rng.uniform(-1, 1, 3000), 1 - 10.0 ** rng.uniform(-16, 0, 1000), spread])
    if name in ("sinh", "cosh", "tanh", "atan"):
        return np.concatenate([rng.uniform(-700, 700, 1500), rng.uniform(-3, 3, 2000), spread])
    if name == "log":
        return np.concatenate([10.0 ** rng.uniform(-290, 300, 2000), 1 + spread[np.abs(spread) < 0.5]])
    right = rng.integers(-600_000, 600_000, 2000) * (np.pi / 2)
    near = right + np.spacing(right) * rng.integers(-3, 4, 2000)
    return np.concatenate([rng.uniform(-10, 10, 2000), rng.uniform(-1e12, 1e12, 2000), near, spread])


@pytest.mark.parametrize("name", [name for name in DOMAINS if name != "sqrt"])
def test_the_library_is_four_times_better_than_assumed(name):
    x = sample(name)
    for at, value in zip(x, getattr(np, LIBRARY.get(name, name))(x), strict=True):
        exact = DOMAINS[name][1](arb(float(at)))
        assert abs(exact - arb(float(value))) <= abs(exact) * (iv._LIBRARY_ERROR / 4) + iv._TINY


def test_documented_library_error_is_covered():
    # 4 ulp of a number just above a power of two is 8 units of 2**-53; widening itself rounds
    for y in (1.0, float(np.nextafter(1.0, 2.0)), 1.5, float(np.nextafter(2.0, 0.0))):
        for error in (-4, 4):
            wide = iv._widened(np.float64(y), np.float64(y))
            exact = Fraction(y) + error * Fraction(float(np.spacing(y)))
            assert Fraction(float(wide.lo)) <= exact <= Fraction(float(wide.hi))


GREATEST = np.finfo(float).max
STRANGE = np.array(
    [0.0, 5e-324, 2e-308, 1e-300, 1 / 3, 1.0, 3.0, 1e16, 1e200, 2.0**1023, GREATEST, np.inf, np.nan]
)
BOTH_SIGNS = np.concatenate([STRANGE, -STRANGE])


def pairs_of(left, right):
    """All pairs as columns, and as intervals of one number each: without an axis, with one, the second exact."""
    first, second = (side.ravel() for side in np.meshgrid(left, right))
    yield Interval(first, second), [Interval(*ends) for ends in zip(first, second, strict=True)]
    yield Interval(first, second), [Interval([a], [b]) for a, b in zip(first, second, strict=True)]
    yield Interval.exact(first), [Interval.exact(a) for a in first]


def assert_same_bits(many, single):
    with np.errstate(all="ignore"):
        for side in ("lo", "hi"):
            found = [getattr(each, side).item() for each in single]
            assert np.array_equal(getattr(many, side), found, equal_nan=True)


@pytest.mark.slow
@pytest.mark.parametrize("name", ARITHMETIC)
def test_one_number_is_computed_to_the_bit_like_many(name):
    """Numbers take a way of their own, without arrays."""
    operation, _ = ARITHMETIC[name]
    rng = np.random.default_rng(0)
    some = np.ldexp(rng.normal(size=40), rng.integers(-900, 900, 40))
    with np.errstate(all="ignore"):
        for many, single in pairs_of(BOTH_SIGNS[::2], np.concatenate([BOTH_SIGNS[1::2], some])):
            for lo, hi in ((-2.0, 3.0), (1 / 3, 1 / 3), (0.0, np.inf), (-1e300, -5e-324), (np.nan, 1.0)):
                end = Interval(lo, hi) if lo < hi else Interval.exact(lo)
                assert_same_bits(operation(many, end), [operation(each, end) for each in single])
                assert_same_bits(operation(end, many), [operation(end, each) for each in single])


@pytest.mark.parametrize("n", [-2, 2, 3, 4, 5])
def test_a_power_of_one_number_is_computed_to_the_bit_like_many(n):
    with np.errstate(all="ignore"):
        for many, single in pairs_of(BOTH_SIGNS, BOTH_SIGNS[::3]):
            assert_same_bits(many**n, [each**n for each in single])
        for step in (iv.up, iv.down):
            assert np.array_equal(step(BOTH_SIGNS), [step(x) for x in BOTH_SIGNS], equal_nan=True)


def test_steps_outward_reach_at_least_the_next_float():
    """Over random bit patterns, powers of two and their neighbours, subnormal numbers and the greatest."""
    bits = np.random.default_rng(0).integers(0, 2**64, 200_000, dtype=np.uint64).view(np.float64)
    powers = np.ldexp(1.0, np.arange(-1074, 1024))
    near = np.concatenate(
        [powers, np.nextafter(powers, 0), np.nextafter(powers, np.inf), [0.0, np.finfo(float).max]]
    )
    x = np.concatenate([bits[np.isfinite(bits)], near, -near])
    with np.errstate(over="ignore"):
        assert (up(x) >= np.nextafter(x, np.inf)).all()
        assert (down(x) <= np.nextafter(x, -np.inf)).all()
        assert (up(x) <= np.nextafter(np.nextafter(np.nextafter(x, np.inf), np.inf), np.inf)).all()
    assert up(-np.inf) == -np.finfo(float).max
    assert down(np.inf) == np.finfo(float).max
    assert up(np.inf) == np.inf
    assert np.isnan(up(np.nan))

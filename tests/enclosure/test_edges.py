"""Bounds at the edge of what a rounding, a radius or an underflow moves: drop a term of a proof, and one fails."""

import math
from fractions import Fraction
from itertools import product as combinations

import balls
import numpy as np
import pytest

from tubecert.enclosure import interval as iv
from tubecert.enclosure.interval import Interval
from tubecert.enclosure.linalg import eigenvalues_midrad, norm_bound, quadratic_form, spectral_norm_midrad
from tubecert.expression import symbol

x = symbol("x")


precision = balls.precision(53, quiet=True)


def test_a_hull_reaches_to_either_side():
    ends = (((1.0, 2.0), (0.0, 3.0)), ((0.0, 1.0), (2.0, 3.0)))
    for a, b in (*ends, *(pair[::-1] for pair in ends)):
        found = Interval(*a).hull(Interval(*b))
        assert (found.lo, found.hi) == (min(a[0], b[0]), max(a[1], b[1]))


@pytest.mark.parametrize("ends", [(math.nan, 1.0), (1.0, math.nan), (math.nan, math.nan)])
def test_one_bound_that_is_unknown_makes_both_unknown(ends):
    for found in (Interval(*ends), Interval(*ends) ** 2, Interval(*ends) ** 3):
        opened = found.sanitised()
        assert (opened.lo, opened.hi) == (-math.inf, math.inf)


def test_an_absolute_value_reaches_zero_where_its_argument_does():
    for lo, hi, least in ((-1.0, 2.0, 0.0), (-2.0, 1.0, 0.0), (1.0, 2.0, 1.0), (-2.0, -1.0, 1.0)):
        assert iv.norm([Interval(lo, hi)]).lo == least
        assert iv.norm([Interval(lo, hi)]).hi == max(-lo, hi)
        assert iv.norm([Interval(lo, hi), Interval.exact(0.0)]).lo <= least


def test_functions_do_not_stop_at_an_underflow():
    assert iv.exp(Interval.exact(-746.0)).hi > 0  # 1e-324 is no float
    assert iv.log1p(Interval.exact(1e-310)).lo < 1e-310  # x - x**2/2
    assert iv.expm1(Interval.exact(1e-310)).hi > 1e-310
    assert iv.tan(Interval.exact(1e-310)).hi > 1e-310
    assert iv.sin(Interval.exact(1e-310)).lo < 1e-310


@pytest.mark.parametrize("large", [2e12, 1e17, 1e300])
def test_of_large_angles_nothing_is_known(large):
    opened = iv.tan(Interval.exact(large)).sanitised()
    assert (opened.lo, opened.hi) == (-math.inf, math.inf)
    for function in (iv.sin, iv.cos):
        assert (function(Interval.exact(large)).lo, function(Interval.exact(large)).hi) == (-1, 1)


def test_a_radius_below_the_last_place_is_counted():
    for mid in (1.0, -3.0, 1e-300, 1e300):
        found = eigenvalues_midrad(np.array([[[mid]]]), np.array([[[abs(mid) * 1e-20]]]))
        assert Fraction(float(found.lo[0, 0])) <= Fraction(mid) - Fraction(abs(mid) * 1e-20)
        assert Fraction(float(found.hi[0, 0])) >= Fraction(mid) + Fraction(abs(mid) * 1e-20)


SHAPES = [(1, 1), (1, 3), (3, 1), (2, 2), (3, 2)]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_norm_covers_every_corner_of_its_radius(shape):
    """With a midpoint of 0 the norm of the worst corner is attained by a bound without slack."""
    rng = np.random.default_rng(4)
    for scale in (1.0, 1e-200, 1e100):
        rad = rng.uniform(0.5, 1, shape) * scale
        for mid in (np.zeros(shape), rng.normal(size=shape) * scale):
            found = spectral_norm_midrad(mid[None], rad[None])
            for signs in combinations((-1.0, 1.0), repeat=mid.size):
                exact = np.linalg.norm((mid + rad * np.reshape(signs, shape)) / scale, 2)
                assert found.hi[0] / scale >= exact * (1 - 1e-14)
                assert found.lo[0] / scale <= exact * (1 + 1e-14)
            assert found.lo[0] >= 0
        assert norm_bound(rad) / scale >= np.linalg.norm(rad / scale, 2) * (1 - 1e-15)


def test_a_quadratic_form_covers_every_corner_of_its_radius():
    v = np.array([1.0, -2.0])
    mid, rad = np.array([[1.0, 0.5], [0.5, 3.0]]), np.array([[0.1, 0.2], [0.2, 0.3]])
    found = quadratic_form(v[None], mid[None], rad[None])
    spread = np.abs(v) @ rad @ np.abs(v)
    assert found.lo[0] <= v @ mid @ v - spread
    assert found.hi[0] >= v @ mid @ v + spread
    assert found.hi[0] - found.lo[0] <= 2 * spread * (1 + 1e-12)

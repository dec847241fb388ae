"""What is not a number stays so through every operation of the checker: flint's own asin of it is a thin ball."""

from fractions import Fraction

import pytest
from flint import arb

from tubecert.recheck.balls import between, exact, power, square
from tubecert.recheck.program import _KERNELS, _WIDE, Program
from tubecert.recheck.terms import variable

NOTHING = arb("nan")


@pytest.mark.parametrize("name", [name for name in _KERNELS if name != "direction"])
def test_what_is_not_a_number_stays_so(name):
    for args in ([NOTHING], [NOTHING, arb(1)], [arb("0 +/- inf")], [arb(-2), arb(0)]):
        if name == "div" and len(args) < 2:
            continue
        found = _KERNELS[name](args, 2)
        if args[0].is_nan():
            assert found.is_nan()
        elif name in ("asin", "acos", "sqrt", "log"):
            assert not found.is_finite()


def test_a_direction_lies_between_minus_one_and_one_whatever_is_known():
    found = _KERNELS["direction"]([NOTHING, arb(1)], 0)
    assert found.is_nan() or (found.contains(-1) and found.contains(1))


@pytest.mark.parametrize("n", [2, 3, 5, -1, -3])
def test_a_power_of_a_wide_positive_ball_is_positive_and_reaches_from_end_to_end(n):
    wide = arb(1).union(arb(50))  # a product of such balls reaches below 0
    found = power(wide, n)
    low, high = sorted((Fraction(1) ** n, Fraction(50) ** n))
    assert found > 0
    assert float(found.lower()) <= low <= low + Fraction(1, 1000) * high
    assert high <= float(found.upper()) <= high * Fraction(1001, 1000)
    for q in (Fraction(1), Fraction(3, 2), Fraction(7), Fraction(99, 2), Fraction(50)):
        assert found.contains(exact(q**n))


def test_a_square_is_positive_on_either_side_of_nought():
    for sign in (1, -1):
        wide = arb(sign).union(arb(50 * sign))
        assert 0.99 < float(square(wide).lower()) <= 1
        assert 2500 <= float(square(wide).upper()) < 2501
    assert square(arb(-1).union(arb(50))).contains(0)


ENDS = [(Fraction(-7), Fraction(-3)), (Fraction(-1), Fraction(2)), (Fraction(3), Fraction(8))]


@pytest.mark.parametrize("a", ENDS)
@pytest.mark.parametrize("b", ENDS)
def test_wide_products_and_quotients_reach_from_end_to_end(a, b):
    x, y = variable("x"), variable("y")
    own = [between(exact(low), exact(high)) for low, high in (a, b)]
    times, over, cube = Program([x * y, x / y, y.raised(3)], "xy", wide=True).run(own)
    known = [(times, [p * q for p in a for q in b])]
    if b[0] < 0 < b[1]:
        assert not over.is_finite()
    else:
        known += [(over, [p / q for p in a for q in b]), (cube, [q**3 for q in b])]
    for found, values in known:
        assert found.contains(exact(min(values)))
        assert found.contains(exact(max(values)))
        assert float(found.upper() - found.lower()) < float(max(values) - min(values)) * (1 + 1e-6)


def test_what_is_not_a_number_stays_so_in_wide_products_and_powers():
    assert not _WIDE["pow"]([NOTHING], 2).is_finite()
    for other in (arb(1), arb(1, 0.5), arb("0 +/- inf")):
        for args in ([NOTHING, other], [other, NOTHING]):
            assert not _WIDE["mul"](args, 0).is_finite()

"""Quotients are cancelled to terms of the same values, of which definiteness is told on few boxes."""

import math
from fractions import Fraction

import pytest
from flint import arb
from hypothesis import given
from hypothesis import strategies as st

from tubecert.recheck.cover import Boxed, prove
from tubecert.recheck.program import Program
from tubecert.recheck.quotients import cancelled
from tubecert.recheck.statements import PositiveDefinite
from tubecert.recheck.terms import UNIT, function, number, plus, scaled, times, turned, variable

X, Y = variable("x"), variable("y")
SINE, COSINE = function("sin", X), function("cos", X)
DET = number(Fraction(13, 6)) - COSINE * COSINE

leaves = st.sampled_from([X, Y, SINE, COSINE, number(2), number(Fraction(-1, 3))])
divisors = st.sampled_from([DET, number(3) + Y * Y, DET * number(-2), DET * (number(3) + Y * Y), number(5)])
operations = st.sampled_from(["+", "*", "/", "**", "-**"])


@st.composite
def terms(draw):
    """Sums, products and quotients, with divisors that are not zero near the origin."""
    term = draw(leaves)
    for _ in range(draw(st.integers(1, 6))):
        match draw(operations):
            case "+":
                term = term + draw(leaves) / draw(divisors)
            case "*":
                term = term * (draw(leaves) / draw(divisors))
            case "/":
                term = term / draw(divisors)
            case "**":
                term = term.raised(2)
            case _:
                term = term + draw(divisors).raised(-draw(st.integers(1, 3)))
    return term


@pytest.mark.slow
@given(st.lists(terms(), min_size=1, max_size=3), st.floats(-1, 1), st.floats(-1, 1))
def test_the_values_are_the_same(entries, x, y):
    point = [arb(x), arb(y)]
    before = Program(entries, ("x", "y")).run(point)
    for old, new in zip(before, Program(cancelled(entries), ("x", "y")).run(point), strict=True):
        assert old.overlaps(new)
        assert new.rad() <= 1e-6 * (1 + abs(old))


def test_a_quotient_of_quotients_is_one():
    inner = (SINE / DET) / (UNIT / DET)
    assert cancelled([inner]) == [SINE]
    assert cancelled([(SINE * SINE / DET + COSINE * COSINE / DET) * DET]) == [UNIT]


def test_what_has_no_divisor_or_too_many_is_left_alone():
    plain = [X * Y, SINE]
    assert cancelled(plain) == plain
    many = sum((UNIT / (number(k) + X) for k in range(2, 9)), start=UNIT)
    assert cancelled([many]) == [many]
    assert cancelled([X / (Y - Y * UNIT)]) == [X / (Y - Y)]


def arm():
    """W of an arm: T(q) W0 T(q)' with quotients in T, as `synth` writes it."""
    a = SINE * Y / DET
    T = [[UNIT, a], [number(0) - a * COSINE, UNIT + a * a]]
    W0 = [[number(2), number(Fraction(1, 2))], [number(Fraction(1, 2)), number(1)]]
    return times(times(T, W0), turned(T))


@pytest.mark.parametrize(("least", "verdict"), [("0.2", "confirmed"), ("1.3", "contradicted")])
def test_a_metric_of_quotients_is_positive_on_few_boxes(least, verdict):
    W = arm()
    one = [[UNIT, number(0)], [number(0), UNIT]]
    test = PositiveDefinite(plus(W, scaled(Fraction(least), one), -1), one)
    found = prove(test, Boxed({"x": (Fraction(-1), Fraction(1)), "y": (Fraction(-1), Fraction(1))}), 400)
    assert found.verdict == verdict


def test_the_least_eigenvalue_is_the_one_of_floats():
    """The bound of the test above lies below what sampling shows."""
    entries = [e for row in arm() for e in row]
    program, worst = Program(cancelled(entries), ("x", "y")), math.inf
    for i in range(-10, 11):
        for j in range(-10, 11):
            a, b, _, d = (float(e.mid()) for e in program.run([arb(i) / 10, arb(j) / 10]))
            worst = min(worst, (a + d) / 2 - math.hypot((a - d) / 2, b))
    assert 0.2 < worst < 1.3

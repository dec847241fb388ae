"""Numbers with pi and degrees: rounded to the side that their place asks for, never beyond it."""

import math
from fractions import Fraction

import balls
import mpmath
import pytest
from balls import ball
from flint import arb, ctx
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.expression import PI, ExpressionError, Side, number_text, parse_constant, parse_number

precision = balls.precision(800)


@pytest.mark.slow
@given(
    p=st.fractions(max_denominator=10**6).filter(bool),
    n=st.integers(-6, 6).filter(bool),
    shift=st.fractions(max_denominator=100),
)
@settings(max_examples=80, deadline=None)
def test_what_is_rounded_lies_on_its_side_and_near(p: Fraction, n: int, shift: Fraction) -> None:
    text = f"({number_text(p)})*pi**({n}) + {number_text(abs(shift))}"
    exact = ball(p) * arb.pi() ** n + ball(abs(shift))
    below, near, above = (parse_number(text, side=side) for side in ("below", "nearest", "above"))
    assert ball(below) < exact < ball(above)
    assert below <= near <= above
    assert abs(exact - ball(near)) < abs(exact) * arb("1e-25")
    assert parse_number(number_text(near)) == near


def test_the_sides_of_an_angle_are_near_each_other_whatever_balls_others_use() -> None:
    with ctx.workprec(53):
        below, above = (parse_number("15 deg", side=side) for side in ("below", "above"))
    assert below < above < below * (1 + Fraction(1, 10**28))


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("30 deg", 30),
        ("-30deg", -30),
        ("(10 + 20) deg", 30),
        ("1/2 deg", Fraction(1, 2)),
        ("k deg", 45),
        (".5e1 deg ", 5),
    ],
)
def test_degrees(text: str, degrees: Fraction) -> None:
    assert parse_constant(text, {"k": Fraction(45)}) is PI * Fraction(degrees, 180)
    assert float(parse_number(text, {"k": Fraction(45)})) == pytest.approx(math.radians(degrees), rel=1e-15)


@pytest.mark.parametrize(
    "text", ["1 + 30 deg", "10 deg + 5 deg", "deg", "2 - k deg", "30 deg deg", "(1)+(2) deg"]
)
def test_degrees_belong_to_one_number(text: str) -> None:
    with pytest.raises(ExpressionError):
        parse_number(text, {"k": Fraction(1)})


@pytest.mark.parametrize(
    "text", ["sqrt(2)", "sin(1)", "0*log(pi - 4)", "0*tan(pi/2)", "0*sqrt(3 - pi)", "tanh(1)*pi"]
)
def test_other_irrational_numbers_are_refused(text: str) -> None:
    with pytest.raises(ExpressionError, match="is not a rational number"):
        parse_number(text)


def test_an_exact_number_is_not_rounded() -> None:
    sides: tuple[Side, ...] = ("below", "nearest", "above")
    assert {parse_number("1/3", side=side) for side in sides} == {Fraction(1, 3)}
    assert {parse_number("pi/pi", side=side) for side in sides} <= {Fraction(1), *_beside(1)}
    assert {parse_number("pi - pi", side=side) for side in sides} == {Fraction(0)}


def _beside(q: int) -> set[Fraction]:
    with mpmath.workdps(40):
        return {Fraction(q) + s * Fraction(1, 10**k) for s in (-1, 1) for k in range(28, 33)}


def test_how_many_digits_a_number_with_pi_has_is_part_of_hashes():
    """Written down from version 0.2.0; the digits before the point are counted of a fraction."""
    assert parse_number("37 deg") == Fraction(
        "645771823237901943461765584341/1000000000000000000000000000000"
    )
    assert parse_number("50 deg") == Fraction("218166156499291197115461346061/250000000000000000000000000000")

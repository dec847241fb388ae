"""The zero test: proofs that hold, and no proof of anything false."""

import mpmath
import pytest
from hypothesis import given, settings
from strategies import points, read, texts
from test_graph import value

from tubecert.expression import constant, derivative, is_zero, norm, sin, sqrt


@pytest.mark.parametrize(
    "text",
    [
        "x - x",
        "(x + y)**3 - x**3 - 3*x**2*y - 3*x*y**2 - y**3",
        "(x**2 - y**2)/(x - y) - x - y",
        "1/(1 + x) + 1/(1 - x) - 2/(1 - x**2)",
        "x/y + y/x - (x**2 + y**2)/(x*y)",
        "x**-3*x**5 - x**2",
        "sin(x)**2 + cos(x)**2 - 1",
        "sin(x)**4 - cos(x)**4 + 2*cos(x)**2 - 1",
        "sin(-x) + sin(x)",
        "cos(y - x) - cos(x - y)",
        "sin(2*x) - 2*sin(x)*cos(x)",
        "cos(3*x) - 4*cos(x)**3 + 3*cos(x)",
        "sin(x + y) - sin(x)*cos(y) - cos(x)*sin(y)",
        "sin((x + y)**2) - sin(x**2 + 2*x*y + y**2)",
        "tan(x)*cos(x) - sin(x)",
        "1 + tan(x)**2 - 1/cos(x)**2",
        "sin(x/(1 + y)) + sin(-x/(y + 1))",
        "sqrt(1 + x**2)**2 - 1 - x**2",
        "sqrt(x + 1)*sqrt(1 + x) - x - 1",
        "1/sqrt(x) - sqrt(x)/x",
        "sqrt(8)**2 - 8",
        "exp(x)*exp(-x) - 1",
        "exp(x + y) - exp(x)*exp(y)",
        "exp(2*x) - exp(x)**2",
        "exp(x/(1 + y))*exp(-x/(1 + y)) - 1",
        "cosh(x)**2 - sinh(x)**2 - 1",
        "tanh(2*x)*(1 + tanh(x)**2) - 2*tanh(x)",
        "sinh(x + y) - sinh(x)*cosh(y) - cosh(x)*sinh(y)",
        "exp(x) - cosh(x) - sinh(x)",
        "atan(x/(1 + y)) - atan(x/(y + 1))",
        "log(2*x + 2*y) - log(2*(x + y))",
        "norm(x, y)**2 - x**2 - y**2",
        "abs(-x) - abs(x)",
        "norm(x, y) - norm(-y, x)",
        "sin(pi)",
        "cos(pi/2) + cos(pi) + 1",
        "sin(x + pi) + sin(x)",
        "0.1*x - x/10",
    ],
)
def test_identities_are_proven(text: str) -> None:
    assert is_zero(read(text)) is True


@pytest.mark.parametrize(
    "text", ["1", "x - y", "x*y - y*x + 1e-30", "(x + 1)**12 - x**12", "pi*x - 3*x", "1/x - 1/y"]
)
def test_polynomials_that_differ_are_proven_to_differ(text: str) -> None:
    assert is_zero(read(text)) is False


@pytest.mark.parametrize(
    "text",
    [
        "sin(x) - x",
        "sin(x) - cos(x)",
        "exp(x) - exp(y)",
        "sqrt(x**2) - x",
        "abs(x) - x",
        "sqrt(2) - sqrt(3)",
        "sin(x)**2 - cos(x)**2",
        "1/(sin(x)**2 + cos(x)**2 - 1)",
        "1/((sqrt(x**2) - x)*(sqrt(x**2) + x))",
    ],
)
def test_nothing_else_is_claimed(text: str) -> None:
    assert is_zero(read(text)) is None


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(text=texts(), point=points)
def test_a_claim_agrees_with_the_values(text: str, point: dict) -> None:  # type: ignore[type-arg]
    e = read(text)
    if is_zero(e, budget=5_000) is True:
        with mpmath.workdps(60):
            assert abs(value(e, point)) < mpmath.mpf(10) ** -40


@pytest.mark.slow
@settings(max_examples=50, deadline=None)
@given(a=texts(smooth=True, leaves=4), b=texts(smooth=True, leaves=4))
def test_the_product_rule_is_proven_for_trigonometric_polynomials(a: str, b: str) -> None:
    u, v = read(a), read(b)
    rule = derivative(u * v, "x") - derivative(u, "x") * v - u * derivative(v, "x")
    assert is_zero(rule) is not False
    shift = (u + v) ** 2 - (u**2 + 2 * u * v + v**2)
    assert is_zero(shift) in (True, None)
    assert is_zero(shift + 1) is not True


@pytest.mark.slow
@pytest.mark.timeout(30)
def test_the_budget_ends_an_expansion() -> None:
    big = read("((x + y + t + 1)**12*(x - y + 2*t + 3)**12)**2 - (x*y + t)**12")
    assert is_zero(big, budget=1_000) is None
    assert is_zero(big) in (None, False)
    deep = read("x")
    for _ in range(3_000):
        deep = sin(deep) + 1
    assert is_zero(deep) is None


def test_constants_beyond_rationals() -> None:
    assert is_zero(sqrt(constant(2)) * sqrt(constant(2)) - 2) is True
    assert is_zero(norm([constant(3), constant(4)]) ** 2 - 25) is True

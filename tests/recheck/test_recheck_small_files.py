"""Small files that would keep the checker busy for hours."""

import pytest
from rechecked import terms

from tubecert.recheck.balls import exact
from tubecert.recheck.document import CertificateError, Node
from tubecert.recheck.grammar import GrammarError, read
from tubecert.recheck.identity import vanish
from tubecert.recheck.metric import adjugate, determinant
from tubecert.recheck.monomials import expanded
from tubecert.recheck.obstacles import read_obstacle
from tubecert.recheck.program import Program
from tubecert.recheck.quotients import cancelled
from tubecert.recheck.terms import number, variable


@pytest.mark.slow
def test_determinants_are_not_made_minor_by_minor():
    n = 9
    rows = [
        [variable(f"a{i}{j}") if i == j else number(1 + (i * j) % 3) * variable("b") for j in range(n)]
        for i in range(n)
    ]
    names = (*(f"a{i}{i}" for i in range(n)), "b")
    whole, inverse = determinant(rows), adjugate(rows)
    values = [number(2 + i) for i in range(n)] + [number(1)]
    at = [
        Program([e], names).run([exact(v.value) for v in values])[0]
        for e in (whole, inverse[0][0], inverse[1][2])
    ]
    by_row = sum(
        (
            Program([rows[0][j] * inverse[j][0]], names).run([exact(v.value) for v in values])[0]
            for j in range(n)
        ),
        start=exact(0),
    )
    assert by_row.overlaps(at[0])
    assert at[0].is_finite()


@pytest.mark.slow
def test_a_determinant_that_is_too_long_is_refused():
    rows = [[variable(f"a{i}_{j}") for j in range(14)] for i in range(14)]
    with pytest.raises(ValueError, match="too long"):
        determinant(rows)


@pytest.mark.parametrize("text", ["1**" * 13_000 + "1", "1**(" * 35 + "1" + ")" * 35])
def test_a_tower_of_powers_is_nested_too_deep(text):
    with pytest.raises(GrammarError, match="deep"):
        read(text, {})


@pytest.mark.slow
def test_a_polygon_has_no_more_corners_than_a_specification_may_have():
    convex = [[str(k), str(k * k)] for k in range(201)]
    few, many = (Node({"states": ["x", "y"], "polygon": own}, "obstacle") for own in (convex[1:], convex))
    assert len(read_obstacle(few, "xy").corners) == 200
    with pytest.raises(CertificateError, match="<= 200"):
        read_obstacle(many, "xy")


_PARTS = "+".join(
    f"{function}{name}" for function in ("sin(", "exp(", "atan(", "(") for name in ("x)", "y)", "z)")
)
_RISING = "((sin(x)*sin(y)*sin(z)*sin(x*y))**12)**12*cos(x)*cos(y)*cos(z)*cos(x*y)"


@pytest.mark.parametrize(
    ("text", "long"),
    [(f"((1 + {_PARTS})**12)**12", True), (_RISING, True), ("(x**12)**12*sqrt(1 + x + y + z + x*y)", False)],
)
def test_powers_that_are_too_long_are_not_multiplied_out(text, long):
    one = terms([text], "xyz")
    assert not vanish(one)
    assert (expanded(one) is None) is long


def test_what_does_not_divide_a_power_is_not_divided_to_the_end():
    (one,) = terms(["1/(1 + x + y + z + x*y + x*z)*(((x*y*z)**12)**12)"], "xyz")
    found, own = Program([*cancelled([one]), one], "xyz").run([exact(3), exact(1), exact(2)])
    assert found.overlaps(own)
    assert found.is_finite()


def test_a_root_of_a_quotient_is_known_by_its_square():
    ratio = "(x + y + sin(z))/(1 + x**2 + y)"
    other = "1/(1 + x*x + y)*(y + x + sin(z))"
    assert vanish(terms([f"sqrt({ratio})**2 - {ratio}", f"sqrt({ratio}) - sqrt({other})"], "xyz"))
    assert not vanish(terms([f"sqrt({ratio}) - sqrt((x + y)/(1 + x**2 + y))"], "xyz"))

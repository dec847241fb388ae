"""What cancels in a quotient of expressions, and that nothing else is changed."""

from fractions import Fraction
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import fractions

from tubecert.expression import constant, cos, sin, symbol, topological
from tubecert.expression.matrix import adjugate, determinant
from tubecert.model import build, divide
from tubecert.spec import load
from tubecert.synthesis.frame import pivot_frame
from tubecert.synthesis.lifting import at_point, reduced

ROBOTS = Path(__file__).parents[2] / "benchmarks" / "robots"
X, Y = symbol("x"), symbol("y")
LEAVES = st.sampled_from([X, Y, X + 2, constant(Fraction(-3, 4)), 2 * X + Y**2 + 1])
SUMS = st.recursive(
    LEAVES,
    lambda inner: st.builds(
        lambda a, b, how: {"+": a + b, "*": a * b, "/": a / (b**2 + 1), "^": a**2}[how],
        inner,
        inner,
        st.sampled_from("+*/^"),
    ),
    max_leaves=8,
)


@settings(max_examples=40, deadline=None)
@given(SUMS, fractions(-3, 3, 7), fractions(-3, 3, 7))
def test_the_value_stays(e, x, y):
    ((short,),) = reduced([[e]])
    at = {"x": x, "y": y}
    assert at_point([short], at) == at_point([e], at)


def test_what_stands_above_and_below_is_cancelled():
    D = 2 + sin(X) ** 2
    cases = [
        (1 / (1 / D), D),
        (Y * (1 / D) / (1 / D), Y),
        (1 / D / D + X / D**2, (1 + X) / D**2),
        (X * Y - Y * X, constant(0)),
        ((X * Y + X) / X, Y + 1),
        (sin(X * D / D), sin(X)),
        ((6 * X + 4 * Y) / (3 * X + 2 * Y), constant(2)),
        ((Y - X) / (X - Y), constant(-1)),
        ((X + 2 * (Y - 1) + 2) / (X + 2 * Y), constant(1)),
    ]
    assert reduced([[a for a, _ in cases]]) == (tuple(b for _, b in cases),)


def test_the_inverse_of_an_inverse_mass_matrix_is_the_mass_matrix():
    M = [[3 + cos(X), 1 + cos(X)], [1 + cos(X), constant(2)]]
    for unit in (1, Fraction(71, 4068)):
        inverse = divide(adjugate(M), determinant(M))
        B = reduced([[unit * e for e in row] for row in inverse])
        ((size,),) = reduced([[determinant(B)]])
        found = reduced(divide(adjugate(B), size))
        assert found == reduced([[e / unit for e in row] for row in M])


def test_metrics_of_a_crane_and_of_an_arm_are_short():
    """Their frames were quotients of quotients, those of the arm too long for a file."""
    for name, most in (("crane", 30), ("arm", 40)):
        spec = load(str(ROBOTS / f"{name}.yaml"))
        frame = pivot_frame(build(spec), spec.safe_set)
        assert len(topological([e for row in frame for e in row])) < most

"""Text that keeps what folding dropped."""

from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import SYMBOLS, texts

from tubecert.expression import Parsed, free_symbols, full_text, parse, symbol


def read(text: str) -> Parsed:
    return parse(text, symbols=SYMBOLS, kinks=True)


def shown(text: str) -> str:
    parsed = read(text)
    return full_text(parsed.expression, parsed.obligations)


@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("x + 0*sqrt(y - 5)", "x + 0*sqrt(y - 5)"),
        ("0/x", "0 + 0/x"),
        ("y + 0*abs(x)/x", "y + 0/x"),
        ("y*y**-1", "1 + 0/y"),
        ("(1/x)**0", "1 + 0/x"),
        ("0*tan(x)", "0 + 0/cos(x)"),
        ("sin(0/(x + y))", "0 + 0/(x + y)"),
        ("0/(2*x) + 0/x**3", "0 + 0/x"),
        ("0/(x*y)", "0 + 0/x + 0/y"),
        ("0/(x/y)", "0 + 0/x + 0/y"),
        ("0/(1/x) + 0/exp(x) + 0/pi", "0 + 0/x"),
        ("0*sqrt(2*x**3) + 0*sqrt(3*x)", "0 + 0*sqrt(x)"),
        ("0*sqrt(-2*x)", "0 + 0*sqrt(-x)"),
        ("0*sqrt(x**2)", "0 + 0*sqrt(x**2)"),
        ("1/sqrt(x) + 0/x", "1/sqrt(x) + 0/x"),
        ("0*log(2*x) + 0*sqrt(x)", "0 + 0*sqrt(x)"),
        ("y + 0*asin(x)*acos(x)", "y + 0*sqrt(1 - x**2)"),
        ("0/cosh(x) + 0/atan(y)", "0 + 0/(atan(y))"),
        ("0/norm(x, y)", "0 + 0/norm(x, y)"),
        ("0*sqrt(1/x + y)", "0 + 0*sqrt(1/x + y) + 0/x"),
    ],
)
def test_what_folding_drops_stays_in_the_text(text: str, kept: str) -> None:
    assert shown(text) == kept
    assert shown(kept) == kept
    assert read(kept).expression is read(text).expression


@pytest.mark.parametrize("text", [
    "x/(2*y)", "x**-3", "tan(2*x)", "1/(x*y)", "sqrt(4*x)", "sqrt(x**3)", "1/(x/y)", "x**-2*x**-1",
    "log(3*x)", "asin(2*x)", "acos(y)",
])  # fmt: skip
def test_nothing_is_added_to_what_the_text_owes_anyway(text: str) -> None:
    parsed = read(text)
    assert full_text(parsed.expression, parsed.obligations) == full_text(parsed.expression, ())


def test_other_obligations_other_texts() -> None:
    parts = ["0/x", "0/y", "0*sqrt(x)", "0*sqrt(-x)", "0*tan(x)", "0/(x + 1)", "0*sqrt(x - 1)"]
    chosen = [combination for size in range(4) for combination in combinations(parts, size)]
    assert len({shown(" + ".join(["t", *combination])) for combination in chosen}) == len(chosen)


SHAPES = ["0/({})", "0*sqrt({})", "({})**-1*({})", "0*tan({})", "1/({})", "sqrt(2*({}))", "1/(3*({}))**2"]


def partial(drawn: tuple[str, list[str]]) -> str:
    """An expression with partial operations, most of which fold away."""
    inner, shapes = drawn
    if not free_symbols([read(inner).expression]):
        inner = f"x + ({inner})"
    if not free_symbols([read(inner).expression]):
        inner = "x"
    return " + ".join(shape.format(inner, inner) for shape in shapes or ["x"])


@pytest.mark.slow
@settings(max_examples=80, deadline=None)
@given(text=st.tuples(texts(leaves=3), st.lists(st.sampled_from(SHAPES))).map(partial))
def test_the_text_owes_what_was_owed(text: str) -> None:
    """Reading it gives the same expression, and the same text again: nothing was lost or made up on the way."""
    kept = shown(text)
    assert read(kept).expression is read(text).expression
    assert shown(kept) == kept


def test_names_are_those_of_the_expression() -> None:
    speed = {"speed": symbol("speed")}
    parsed = parse("0/speed", symbols=speed)
    assert full_text(parsed.expression, parsed.obligations) == "0 + 0/speed"

"""Equations as MathML, read back by hand: what one sees is what the text says."""

import math
import xml.etree.ElementTree as ET

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tubecert.report import mathml

VALUES = {"x1": 0.7, "x2": -1.3, "omega": 2.5, "mass_cart": 0.4, "q": 1.9}
NAMED = {"x_1": "x1", "x_2": "x2", "ω": "omega", "mass_cart": "mass_cart", "q": "q", "π": "pi"}


def read(element):
    """A tree of MathML as a Python expression, by what a reader sees: every group is one operand."""
    parts = list(element)
    match element.tag:
        case "mn":
            return element.text.replace("\u2212", "-")
        case "mi":
            return NAMED.get(element.text, element.text)
        case "msub":
            return NAMED["_".join(part.text for part in parts)]
        case "msup":
            return f"({read(parts[0])})**({read(parts[1])})"
        case "mfrac":
            return f"(({read(parts[0])})/({read(parts[1])}))"
        case "msqrt":
            return f"sqrt({read(parts[0])})"
        case "mrow" | "math":
            return row(parts)
    raise AssertionError(element.tag)


def row(parts):
    signs = {"\u2212": "-", "+": "+", "\u2062": "*", "·": "*", "\u2061": "", "(": "(", ")": ")", ",": ","}
    if parts and parts[0].text in ("|", "‖") and parts[-1].text == parts[0].text:
        inside = [part for part in parts[1:-1] if part.text != ","]
        return f"hypot({', '.join(map(read, inside))})"
    return "".join(signs[part.text] if part.tag == "mo" else read(part) for part in parts)


def value(text):
    names = {
        name: getattr(math, name) for name in ("sin", "cos", "tan", "exp", "sqrt", "hypot", "pi", "tanh")
    }
    return eval(text, {"__builtins__": {}}, names | VALUES | {"abs": abs, "norm": math.hypot})


LEAF = st.sampled_from(["x1", "x2", "omega", "mass_cart", "q", "2", "0.25", "3e-2", "1", "pi"])


PAIRS = ("({} + {})", "({} - {})", "({})*({})", "{}*{}", "({})/(3 + abs({}))", "norm({}, {})")
ALONE = ("-({})", "-{}", "({})**2", "sin({})", "sqrt(1 + abs({}))")


def grown(inner):
    of_two = st.tuples(st.sampled_from(PAIRS), inner, inner)
    return (of_two | st.tuples(st.sampled_from(ALONE), inner)).map(lambda own: own[0].format(*own[1:]))


@pytest.mark.slow
@example("x1*(x2 + q)")
@example("(x2 + q)*x1")
@example("x1 - (x2 - q)")
@example("x1*(x2/q)")
@example("x1/(x2/q)")
@example("(x1*x2)**2")
@example("(-x1)**2")
@example("2*-x1")
@given(st.recursive(LEAF, grown, max_leaves=8))
def test_what_is_shown_has_the_value_of_the_text(text):
    shown = mathml.expression(text)
    assert "mtext" not in {each.tag for each in shown.iter()}
    assert value(read(shown)) == pytest.approx(value(text), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    "text", ["<b>", "", "lambda", "x +", "1 = 2", "__import__('os')", "*".join(["x"] * 1900)]
)
def test_what_is_no_equation_stays_its_text(text):
    (only,) = mathml.expression(text)
    assert (only.tag, only.text) == ("mtext", text)


def test_numbers_keep_the_digits_they_are_written_with():
    numbers = [each.text for each in mathml.expression("0.10*x1 + 1e-9").iter("mn")]
    assert numbers[0] == "0.10"
    assert numbers[-3:] == ["1", "10", "\u22129"]


def test_long_sums_go_on_below_and_nothing_of_them_is_lost():
    terms = [f"{k}*sin(x1)*cos(x2)" for k in range(1, 30)]
    found = ET.fromstring(mathml.aligned([mathml.Equation(left="x1", right=(" - ".join(terms),), rate=True)]))
    rows = list(found.iter("mtr"))
    assert len(rows) > 5
    assert [each.text for each in found.iter("mn") if each.text != "1"] == [str(k) for k in range(2, 30)]
    assert [len(line[0]) for line in rows] == [2] + [0] * (len(rows) - 1), "the left side stands once"
    assert all(line[1][0][0].text == "\u2212" for line in rows[1:]), "what goes on begins with its sign"

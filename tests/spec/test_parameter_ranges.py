"""Parameters of which a range is known: read, in the middle for the controller, canonical, in f and B alone."""

import json
from fractions import Fraction

import pytest
from systems import SMALL
from texts import replaced

from tubecert.errors import SpecError
from tubecert.expression import to_text
from tubecert.model import build
from tubecert.spec import canonical, load_text


def with_mass(f="m*sin(x)", ranges="m: [0.2, 0.4]", definitions="", **changes):
    """The small system, its second equation with a parameter."""
    text = SMALL.replace("0.3*sin(x)", f).replace(
        "  inputs: [u]", f"  inputs: [u]\n  parameters: {{{ranges}}}{definitions}"
    )
    return replaced(text, *changes.values())


def test_the_controller_knows_the_middle():
    spec = load_text(with_mass(), "s.yaml")
    assert spec.ranges == (("m", (Fraction(1, 5), Fraction(2, 5))),)
    assert [to_text(term.expression) for term in spec.f] == ["y - x", "0.3*sin(x) - y"]
    assert [to_text(term.expression) for term in spec.drift] == ["y - x", "m*sin(x) - y"]
    model = build(spec)
    assert model.parameters == spec.ranges
    assert to_text(model.drift[1]) == "m*sin(x) - y"


def test_without_ranges_there_is_one_f():
    spec = load_text(SMALL, "s.yaml")
    assert spec.ranges == spec.drift == ()
    assert canonical(spec)["system"]["parameters"] == {}


def test_the_canonical_data_is_a_specification_of_the_same():
    spec = load_text(with_mass(ranges="k: 2, m: [k/10, 0.4]"), "s.yaml")
    data = canonical(spec)
    assert data["system"]["parameters"] == {"k": "2", "m": ["0.2", "0.4"]}
    again = load_text(json.dumps(data), "s.json")
    assert canonical(again) == data
    assert again.ranges == spec.ranges


def test_another_range_is_another_system():
    one, other = (
        canonical(load_text(with_mass(ranges=f"m: [0.2, {end}]"), "s.yaml")) for end in ("0.4", "0.5")
    )
    assert one != other


def test_definitions_may_use_it_where_f_uses_them():
    text = with_mass(f="q", definitions='\n  definitions: {q: "m*sin(x)"}')
    assert to_text(load_text(text, "s.yaml").drift[1].expression) == "m*sin(x) - y"
    with pytest.raises(SpecError, match="q depends on m: m is known by a range only"):
        load_text(text.replace("0.05*x", "q"), "s.yaml")


def test_ends_that_are_no_decimals_are_rounded_outward():
    low, high = dict(load_text(with_mass(ranges="m: [pi/20, pi/10]"), "s.yaml").ranges)["m"]
    assert 0 <= Fraction("0.157079632679489661923132169163976") - low < Fraction(1, 10**12)
    assert 0 <= high - Fraction("0.314159265358979323846264338327950") < Fraction(1, 10**12)


@pytest.mark.parametrize(
    ("old", "new"), [("0.05*x", "m*x"), ("input: [0]", "input: [m]"), ("at: [0.05", "at: [m")]
)
def test_anywhere_else_it_is_refused(old, new):
    with pytest.raises(SpecError, match=r"known by a range only|unknown symbol m"):
        load_text(with_mass(only=(old, new)), "s.yaml")


def with_gain(**changes):
    """The same with the parameter in B, too."""
    return with_mass(gain=("B: [[0], [1]]", "B: [[0], [0.3/m]]"), **changes)


def test_a_gain_is_known_at_the_middle():
    spec = load_text(with_gain(), "s.yaml")
    assert [[to_text(term.expression) for term in row] for row in spec.B] == [["0"], ["1"]]
    assert [[to_text(term.expression) for term in row] for row in spec.gained] == [["0"], ["0.3/m"]]
    model = build(spec)
    assert model.constant_input
    assert to_text(model.gained[1][0]) == "0.3/m"
    data = canonical(spec)
    assert data["system"]["B"] == [["0"], ["0.3/m"]]
    again = load_text(json.dumps(data), "s.json")
    assert canonical(again) == data
    assert [to_text(term.expression) for row in again.gained for term in row] == ["0", "0.3/m"]


def test_a_range_that_is_in_f_alone_leaves_B():
    assert load_text(with_mass(), "s.yaml").gained == ()

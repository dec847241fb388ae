"""The language of specifications, read and evaluated by recheck on its own."""

import copy

import pytest
from flint import arb
from rechecked import certified, doubted, examine, failing, respecified, sealed, terms
from systems import SMALL

from tubecert.enclosure.tape import Tape
from tubecert.errors import TubecertError
from tubecert.expression import parse, symbol
from tubecert.recheck.grammar import read
from tubecert.recheck.program import Program
from tubecert.recheck.terms import variable

FRICTION = """
tubecert: 1
name: friction
system:
  states: [p, v]
  inputs: [u]
  f: ["v", "-sin(p) - 0.2*tanh(v/0.2) - 0.1*v + 0.1*atan(p) + 0.01*asin(p/2)*sinh(v)"]
  B: [[0], [1]]
safe_set: {p: [-1, 1], v: [-1.5, 1.5]}
uncertainty: {h: ["0.05*sin(t) + 0.05*tanh(3*v) + 0.02*log(2 + p)"]}
trajectory: {kind: equilibrium, at: [0, 0]}
initial_state: {at: [0.02, 0]}
metric: {rate: 0.5, dual_metric: [[1, "-0.6"], ["-0.6", "1.2"]]}
tube: {epsilon: 0.2, rho_a: 0.1}
adaptation: {A_m: -10}
"""


@pytest.mark.slow
def test_smooth_friction_is_certified_and_confirmed():
    document = certified(FRICTION, conditions="distance")
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new"), [("tanh(", "sinh("), ("atan(p)", "sinh(5*p)"), ("log(", "cosh(")])
def test_another_function_is_not_confirmed(old, new):
    """Every claim of the certificate as it was, the function in its place another one."""
    document = copy.deepcopy(certified(FRICTION, conditions="distance"))

    def changed(effective):
        f, h = effective["system"]["f"], effective["uncertainty"]["h"]
        f[1], h[0] = f[1].replace(old, new), h[0].replace(old, new)

    assert doubted(respecified(document, changed))


BOX = SMALL.replace("{at: [0.05, 0]}", "{box: {x: [-0.03, 0.05], y: [-1 deg, 1 deg]}}")
BENT = BOX.replace('[[1, "-0.3"], ["-0.3", 2]]', '[["1 + 0.01*cos(x)", "-0.3"], ["-0.3", 2]]')


@pytest.mark.slow
@pytest.mark.parametrize("text", [BOX, BENT], ids=["flat", "bent"])
def test_a_box_of_starts_is_confirmed_and_a_smaller_d0_is_not(text):
    document = certified(text, conditions="distance")
    assert document["result"]["verdict"] == "certified"
    assert failing(examine(document)) == []
    for name in ("initial_distance", "h_initial"):
        lying = copy.deepcopy(document)
        constant = lying["result"]["constants"][name]
        constant["above"] *= 0.98
        constant["below"] = min(constant["below"], constant["above"])
        assert any(name in claim for claim, _ in failing(examine(sealed(lying))))


@pytest.mark.slow
def test_a_wider_box_is_another_claim():
    """The same constants for starts that are further away: every claim about the start fails, none is believed."""
    document = certified(BOX, conditions="distance")

    def wider(effective):
        effective["initial_state"]["box"]["x"][1] = "0.06"

    names = [name for name, _ in failing(examine(respecified(document, wider)))]
    assert any("initial_distance" in name for name in names)


@pytest.mark.slow
@pytest.mark.parametrize(
    "box",
    [
        {"x": ["0", "0.1"]},
        {"x": ["0", "0"], "y": ["0", "0"]},
        {"x": ["0.1", "0"], "y": ["0", "1"]},
        {"x": ["0", "0.1"], "y": ["0"]},
        {"x": ["0", "0.1"], "y": ["0", "0"], "z": ["0", "0"]},
        [["0", "1"], ["0", "1"]],
    ],
)
def test_a_box_of_another_form_is_refused(box):
    document = copy.deepcopy(certified(BOX, conditions="distance"))

    def other(effective):
        effective["initial_state"]["box"] = box

    with pytest.raises(TubecertError) as raised:
        examine(respecified(document, other))
    assert raised.value.findings[0].code == "TC603"


OWED = {
    "log(x)": 1, "asin(x) + acos(y)": 2, "0*asin(x)": 1, "tanh(x) + atan(y) + sinh(x)*cosh(y)": 0,
    "log(x)/y": 2, "sqrt(acos(x))": 2,
}  # fmt: skip


@pytest.mark.parametrize("text", OWED)
def test_both_readers_owe_the_same(text):
    """Each by its own rules: kind by kind, and at points where the arguments are the same numbers."""
    names = {name: symbol(name) for name in "xy"}
    theirs = parse(text, symbols=names).obligations
    ours = read(text, {name: variable(name) for name in "xy"})[1]
    assert len(ours) == len(theirs) == OWED[text]
    found = [(item.kind, Tape([item.argument], "xy").run_floats([0.3, 0.7], ())[0]) for item in theirs]
    own = [
        (item.kind, float(Program([item.argument], "xy").run([arb(0.3), arb(0.7)])[0].mid())) for item in ours
    ]
    for (kind, value), (other, number) in zip(sorted(own), sorted(found), strict=True):
        assert kind == other
        assert value == pytest.approx(number)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("asin(2 + x)", None),
        ("log(x - 1)", None),
        ("acos(x - 2)", None),
        ("tanh(100*x)", 1.0),
        ("atan(x)", 1.0),
    ],
)
def test_what_is_not_defined_on_a_ball_bounds_nothing(text, value):
    """x in [-1, 1]: outside of its domain a function has no enclosure; where it has one it is as tight as its ends."""
    (term,) = terms([text], "x")
    found = Program([term], "x").run([arb(0, 1)])[0]
    if value is None:
        assert not found.is_finite()
    else:
        assert float(found.abs_upper()) <= value * (1 + 1e-8)  # a radius has 30 bits

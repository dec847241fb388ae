"""Norms of columns about a plan that stays: a multiplier decides them in few boxes, and confirms nothing false."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import proven
import pytest
import rechecked
from flint import ctx

from tubecert.recheck import norms as by_norms
from tubecert.recheck.balls import exact
from tubecert.recheck.cover import BOXES, Outcome
from tubecert.recheck.curve import expressed
from tubecert.recheck.norms import QuadraticNotNegative, column_below, norms
from tubecert.recheck.place import Place
from tubecert.recheck.statements import NormsBelow
from tubecert.recheck.terms import number

NAMES = ("x", "y", "t", "m")
SLENDER = """
tubecert: 1
name: slender
system:
  states: [x, y, vx, vy]
  inputs: [ux, uy]
  f: [vx, vy, -0.3*vx - 0.2*sin(y), -0.3*vy + 0.1*x*y]
  B: [[0, 0], [0, 0], [1, 0.2], [0, 1]]
safe_set: {x: [-1, 1], y: [-1, 1], vx: [-2, 2], vy: [-2, 2]}
uncertainty: {h: ["0.1*sin(t)", "0.05*x"]}
trajectory: {kind: equilibrium, at: [0, 0, 0, 0]}
tube: {half_widths: {x: 0.1, y: 0.1}}
metric:
  rate: 1.3
  dual_metric:
    - [0.05658, -0.062018, -0.17159, 0.1886]
    - [-0.062018, 0.068984, 0.1886, -0.20931]
    - [-0.17159, 0.1886, 3.9279, 0.082]
    - [0.1886, -0.20931, 0.082, 3.9115]
conditions: {decides: B}
"""
"""Of condition number 8800 in x: boxes alone do not find where the tube ends."""
RHO, UNTIL = Fraction(1, 2), Fraction(3)
FUNCTIONS = {"sin": np.sin, "cos": np.cos, "exp": np.exp}


def place(budget: int = 4_000) -> Place:
    curve = expressed([number(Fraction(1, 5)), number(0)], [number(0)], "t", None)
    system = SimpleNamespace(
        states=("x", "y"),
        inputs=("u",),
        ranges={"m": (Fraction(4, 5), Fraction(6, 5))},
        times=(Fraction(0), UNTIL),
        varies=True,
    )
    return Place(system, curve, RHO, budget, None, None)


def column(*texts: str):
    return rechecked.terms(list(texts), list(NAMES))


def largest(*texts: str) -> float:
    """Of many points of the tube."""
    generator = np.random.default_rng(3)
    v = generator.normal(size=(2, 40_000))
    x, y = float(RHO) * v / np.linalg.norm(v, axis=0) * generator.choice([1, 1, 0.5], size=v.shape[1])
    values = {
        "x": x + 0.2,
        "y": y,
        "t": generator.uniform(0, 3, x.size),
        "m": generator.uniform(0.8, 1.2, x.size),
    }
    rows = [eval(text, FUNCTIONS, values) + 0 * x for text in texts]
    return float(np.linalg.norm(rows, axis=0).max())


COLUMNS = [
    ("-x + y", "-y + 0.3*sin(x)"),
    ("0.1*sin(t) + 0.05*y",),
    ("-x + y + 0.1*sin(2*t)*x", "-0.5*y + 0.3*cos(t)*sin(x) + 0.2*t*x"),
    ("m*sin(x) - y*y", "x*y + 0.2*m"),
    ("0.3*m*cos(3*t)*x", "exp(y)*m"),
]


@pytest.mark.parametrize("texts", COLUMNS, ids=", ".join)
def test_nothing_below_what_is_reached_is_confirmed(texts):
    limit = Fraction(largest(*texts) * 0.9999)
    found = column_below(place(), column(*texts), limit, 400)
    assert found is None or not found.holds
    assert not norms(place(400), [[[e] for e in column(*texts)]], limit).holds


def test_nothing_is_below_a_negative_limit():
    """Its square is not."""
    found = column_below(place(), column(*COLUMNS[0]), Fraction(-100), 400)
    assert found is None or not found.holds


@pytest.mark.parametrize("texts", COLUMNS, ids=", ".join)
@pytest.mark.parametrize("share", [0.0, 0.3, 2.0])
def test_no_multiplier_confirms_what_is_false(texts, share, monkeypatch):
    """It is a proposal: any other one may prove less, and never more."""
    monkeypatch.setattr(by_norms, "_multiplier", lambda *_: Fraction(share))
    found = column_below(place(), column(*texts), Fraction(largest(*texts) * 0.9999), 400)
    assert not found.holds


@pytest.mark.parametrize("texts", COLUMNS[:4], ids=", ".join)
def test_a_little_more_is_confirmed_in_few_boxes(texts):
    found = norms(place(), [[[e] for e in column(*texts)]], Fraction(largest(*texts) * 1.01))
    assert found.holds
    assert found.boxes < 200


def test_what_is_known_of_a_limit_is_not_believed_of_a_smaller_one(monkeypatch):
    own, matrix = place(600), [[[e] for e in column(*COLUMNS[0])]]
    most = Fraction(largest(*COLUMNS[0]))
    assert not norms(own, matrix, most * Fraction(99, 100)).holds
    assert norms(own, matrix, most * Fraction(102, 100)).holds
    assert not norms(own, matrix, most * Fraction(99, 100)).holds
    monkeypatch.setattr(by_norms, "_examined", lambda *_: Outcome(verdict="undecided"))
    assert norms(own, matrix, most * Fraction(102, 100)).holds
    assert not norms(own, matrix, most * Fraction(101, 100)).holds
    assert not norms(place(), matrix, most * Fraction(102, 100)).holds  # of another tube
    assert not norms(own, [[[e] for e in column(*COLUMNS[3])]], most * 2).holds


def test_a_bound_is_above_every_corner_that_floats_do_not_tell_apart():
    """A bound of 1 + (x + y)/2^59 is not that of another corner, which is the same float."""
    with ctx.workprec(BOXES):
        bound = NormsBelow([[column("1 + (x + y)/576460752303423488")]], Fraction(0)).bound([(-1.0, 1.0)] * 2)
        assert bound >= exact(1 + Fraction(1, 2**58))


@pytest.mark.parametrize(("least", "proven"), [(0.01, True), (-0.001, False)])
def test_variables_that_go_together_are_examined_together(least, proven):
    """(100 x - 99 y)^2 + x y/100 is at least 0 to within 0.01, though its corners say nothing."""
    (e,) = column(f"(100*x - 99*y)**2 + 0.002*x*sin(y) + {least}")
    assert QuadraticNotNegative(e).over([(-1.0, 1.0)] * 2).proven is proven


@pytest.mark.slow
def test_the_drift_over_a_long_thin_tube_is_confirmed_as_it_is_enclosed():
    document = proven.proven(SLENDER, bare=True)
    constant = document["result"]["constants"]["drift_on_plan"]
    assert constant["above"] < 1.0001 * constant["below"]
    assert rechecked.failing(rechecked.examine(document, 2_000)) == []
    place = rechecked.case_of(document).place
    short = Fraction(constant["below"]) * Fraction(99_999, 100_000)
    assert not column_below(place, [row[0] for row in place.fields.f], short, 400).holds
    constant |= {end: 0.99 * constant[end] for end in constant}
    found = rechecked.examine(rechecked.sealed(document), 2_000)
    assert ["drift_on_plan" in name for name, _ in rechecked.failing(found)] == [True]

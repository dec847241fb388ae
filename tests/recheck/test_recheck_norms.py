"""Norms of columns about a plan that stays: a multiplier decides them in few boxes, and confirms nothing false."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import rechecked
from flint import ctx

from tubecert.recheck import norms as by_norms
from tubecert.recheck.balls import exact
from tubecert.recheck.cover import BOXES, Outcome
from tubecert.recheck.curve import expressed
from tubecert.recheck.norms import column_below, norms
from tubecert.recheck.place import Place
from tubecert.recheck.statements import NormsBelow
from tubecert.recheck.terms import number

NAMES = ("x", "y", "t", "m")
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

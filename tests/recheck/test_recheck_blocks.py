"""Matrices in parts that no entry joins: a claim for each, in its own variables, is the claim for all of them."""

from fractions import Fraction
from types import SimpleNamespace

import pytest
import rechecked

from tubecert.recheck import constants
from tubecert.recheck.curve import expressed
from tubecert.recheck.norms import norms
from tubecert.recheck.place import Place
from tubecert.recheck.terms import NOUGHT, blocks, number

NAMES = ("x", "y", "z")
RHO = Fraction(1, 2)


def place(budget: int = 2000) -> Place:
    curve = expressed([number(0)] * 3, [number(0)], "t", None)
    system = SimpleNamespace(states=NAMES, inputs=("u",), ranges={}, times=None, varies=False)
    return Place(system, curve, RHO, budget, None, (Fraction(9),) * 3)


def terms(*texts: str):
    return rechecked.terms(list(texts), list(NAMES))


def test_parts_are_found_whatever_their_order():
    a, b, c = terms("x", "1 + y", "z")
    matrix = [[a, NOUGHT, b], [NOUGHT, c, NOUGHT], [NOUGHT] * 3, [NOUGHT, NOUGHT, c], [b, NOUGHT, NOUGHT]]
    assert blocks(matrix) == [[[c]], [[a, b], [NOUGHT, c], [b, NOUGHT]]]
    assert blocks([[NOUGHT] * 2]) == []
    joined = [[a, NOUGHT], [NOUGHT, b], [c, c]]
    assert blocks(joined) == [joined]


@pytest.mark.parametrize("above", ["1e-11", "-1e-3"])
def test_a_slope_that_is_largest_on_a_plane(above):
    """|dh/dx| is .2 wherever one of the states is 0: where another one is as well, boxes in all of them end nowhere."""
    limit = Fraction(1, 5) * (1 + Fraction(above))
    found = constants._lipschitz(place(), terms("sin(2*x)/10", "sin(2*y)/10", "sin(2*z)/10"), limit)
    assert found.verdict == ("confirmed" if limit > Fraction(1, 5) else "contradicted")
    if found.holds:
        assert found.boxes < 500


def test_the_largest_part_decides():
    matrix = [[*terms("cos(x)/2"), NOUGHT, NOUGHT], [NOUGHT, *terms("2*cos(y)", "sin(y)")]]
    assert norms(place(), [matrix], Fraction(201, 100)).verdict == "confirmed"
    assert norms(place(), [matrix], Fraction(199, 100)).verdict == "contradicted"

"""Functions of tables in certificates: they hold the points, recheck reads and evaluates them on its own."""

import copy
from dataclasses import replace
from fractions import Fraction

import pytest
from flint import arb
from rechecked import certified, doubted, examine, failing, respecified, written

from tubecert import pipeline
from tubecert.enclosure import lookup
from tubecert.enclosure.interval import Interval
from tubecert.errors import TubecertError
from tubecert.recheck import lookup as balls
from tubecert.spec import load_text

SPEC = """
tubecert: 1
name: drag
system:
  states: [v]
  inputs: [u]
  tables:
    drag: {points: [[-2, -2.1], [-1, -0.6], [0.3, 0.1], [1, 0.6], [2, 2.1]]}
    gust: {interpolation: cubic, points: [[-2, 0], [0, 0.3], [2, 1]]}
  f: [-drag(v)]
  B: [[1]]
safe_set: {v: [-2, 2]}
uncertainty: {h: ["0.1*sin(t) + 0.05*gust(v)"]}
trajectory: {kind: expressions, x: [0.5*sin(t)], u: [0.5*cos(t) + drag(0.5*sin(t))], horizon: 3}
metric: {rate: 0.5, dual_metric: [["1"]]}
tube: {epsilon: 0.2, rho_a: 0.1}
"""


def made() -> dict[str, object]:
    return certified(SPEC, conditions="distance")


def points(effective, name="drag"):
    return effective["system"]["tables"][name]["points"]


@pytest.mark.slow
def test_a_table_is_certified_and_confirmed():
    document = made()
    assert document["result"]["verdict"] == "certified"
    effective = document["result"]["spec"]["effective"]
    assert [row[:2] for row in points(effective)][1:3] == [["-1", "-0.6"], ["0.3", "0.1"]]
    assert failing(examine(document)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("row", "column"), [(1, 1), (2, 0), (3, 2)])
def test_another_table_is_not_confirmed(row, column):
    """Every claim as it was, one number of the table another one, and all hashes right."""

    def changed(effective):
        own = points(effective)[row]
        own[column] = {"-0.6": "-1.5", "0.3": "-0.9"}.get(own[column], "4")

    assert doubted(respecified(copy.deepcopy(made()), changed))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda own: own["drag"]["points"].reverse(), "does not lie above the point before"),
        (lambda own: own["drag"]["points"].__delitem__(slice(1, None)), "must have 2 to 500 points"),
        (lambda own: own["drag"]["points"][0].pop(), "has 2 entries, not 3"),
        (lambda own: own["drag"].update(interpolation="linear"), "interpolation"),
        (lambda own: own["drag"].update(order="1"), "is not known"),
        (lambda own: own.update(sin=own["gust"]), "may not be used"),
        (lambda own: own.update(v=own["gust"]), "uses a name twice"),
        (lambda own: own.pop("drag"), "'drag' is not known"),
    ],
)
def test_what_is_no_table_is_refused(change, why):
    document = respecified(copy.deepcopy(made()), lambda effective: change(effective["system"]["tables"]))
    with pytest.raises(TubecertError, match=why):
        examine(document)


@pytest.mark.slow
def test_a_table_that_the_safe_set_leaves_is_not_confirmed():
    def shortened(effective):
        own = points(effective)
        own[-1][0] = "1.9"

    assert "may be undefined" in str(failing(examine(respecified(copy.deepcopy(made()), shortened))))


@pytest.mark.slow
def test_a_producer_whose_enclosures_are_too_narrow_is_caught(monkeypatch):
    """Slopes of tables a tenth too small: the producer certifies what recheck does not confirm."""
    right = lookup.enclosure

    def narrow(table, x):
        found = right(table, x)
        share = 0.9 if table.order else 1.0
        return Interval(found.lo * share, found.hi * share)

    monkeypatch.setattr(lookup, "enclosure", narrow)
    result = pipeline.certify(load_text(SPEC, "spec.yaml"), pipeline.Options(conditions="distance"))
    document = written(result.to_json())
    assert document["result"]["verdict"] == "certified"
    assert doubted(document)


def test_one_side_of_a_knot_is_the_piece_on_that_side():
    points = (
        (Fraction(-1), Fraction(0), Fraction(1)),
        (Fraction(3, 10), Fraction(2), Fraction(0)),
        (Fraction(2), Fraction(1), Fraction(3)),
    )
    table = balls.Table("curve", points, order=2)
    around = arb(0.3, 1e-9)
    whole, left, right = (balls.over(replace(table, side=side), around) for side in (0, -1, 1))
    before, after = (
        sum(c * (Fraction(3, 10) - points[i][0]) ** k for k, c in enumerate(table.polynomial(i)))
        for i in (0, 1)
    )
    for ball, value, other in ((left, before, after), (right, after, before)):
        assert ball.contains(arb(value.numerator) / value.denominator)
        assert not ball.contains(arb(other.numerator) / other.denominator)
        assert whole.contains(ball)

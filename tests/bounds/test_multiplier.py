"""Norms of vectors by a multiplier for the constraint of the tube (theory 1a.8), compared with points of the tube."""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from systems import at_rest, matrix_of, model_of

from tubecert.bounds import multiplier
from tubecert.bounds.suprema import Suprema
from tubecert.coordinates import Coordinates
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.expression import parse, symbol
from tubecert.trajectory import Plan

NAMES = ("x", "y", "z")
RHO = Fraction(1, 2)
ROWS = (("2", "0", "0"), ("1/2", "1", "0"), ("0", "0", "3/2"))
S = tuple(tuple(map(Fraction, row)) for row in ROWS)
RIDGE = ["sin(2*x)/10", "sin(2*y)/10", "sin(2*z)/10"]
VECTORS = {"ridge": RIDGE, "bent": ["sin(2*x) + y", "y*z - x"], "one state": ["sin(x) + 0.1"]}


def suprema(coordinates=True, plan=None, **fields):
    model = model_of(NAMES, ["0"] * 3, [["0"], ["0"], ["1"]])
    plan = plan or at_rest("1/10", "0", "-1/5")
    own = Coordinates(S) if coordinates else None
    return Suprema(model, plan, 0.0, None, Effort(), coordinates=own, **fields).with_radius(
        RHO, (Fraction(9),) * 3
    )


def column_of(entries):
    return matrix_of([[e] for e in entries], NAMES)


def largest(entries, S, centres=((0.1, 0.0, -0.2),)):
    """|v| at points of the rim, and where it is largest."""
    d = np.random.default_rng(0).normal(size=(40_000, 3))
    d *= float(RHO) / np.linalg.norm(d, axis=1, keepdims=True)
    points = np.vstack([np.array(centre) + d @ np.linalg.inv(S).T for centre in centres])
    space = dict(zip(NAMES, points.T, strict=True)) | {"sin": np.sin}
    sizes = np.linalg.norm([eval(e, space) for e in entries], axis=0)
    return float(sizes.max()), dict(zip(NAMES, map(float, points[np.argmax(sizes)]), strict=True))


@pytest.mark.slow
@pytest.mark.parametrize("name", VECTORS)
@pytest.mark.parametrize("own", [True, False])
def test_the_bound_is_above_every_point_and_close(name, own):
    most, at = largest(VECTORS[name], np.array(S, dtype=float) if own else np.eye(3))
    effort = Effort(gap=1e-9, absolute=1e-3 * most**2, budget=20_000)
    found = multiplier.eased_bound(suprema(own), "v", column_of(VECTORS[name]), at, effort)
    assert most <= found <= 1.005 * most


@pytest.mark.slow
@pytest.mark.parametrize("wrong", [Fraction(1, 10**6), Fraction(1, 20), Fraction(3)])
def test_what_is_proposed_is_not_believed(monkeypatch, wrong):
    most, at = largest(RIDGE, np.array(S, dtype=float))
    monkeypatch.setattr(multiplier, "_proposed", lambda *_: wrong)
    effort = Effort(gap=1e-9, absolute=1e-3 * most**2, budget=2_000)
    assert multiplier.eased_bound(suprema(), "v", column_of(RIDGE), at, effort) >= most


@pytest.mark.slow
def test_along_a_plan_that_moves():
    t = symbol("t")
    x = tuple(parse(e, symbols={"t": t}).expression for e in ("sin(t)/5", "t/10", "0"))
    moving = suprema(plan=Plan(x, (t * 0,), Fraction(2)))
    centres = [(np.sin(time) / 5, time / 10, 0.0) for time in np.linspace(0, 2, 5)]
    most, at = largest(VECTORS["bent"], np.array(S, dtype=float), centres)
    effort = Effort(gap=1e-9, absolute=2e-2 * most**2, budget=20_000)
    found = multiplier.eased_bound(moving, "v", column_of(VECTORS["bent"]), at | {"t": 2.0}, effort)
    assert most <= found


def test_where_the_multiplier_leaves_a_gap_boxes_go_on():
    """x + 0.3 x^2 bends upward: what is searched is larger inside than at the rim, whatever the multiplier."""
    v, asked = column_of(["x + 0.3*x**2"]), suprema(False, gaps={"f": 1e-4})
    found = asked.norms("f", [v])
    assert found.below == pytest.approx(0.6 + 0.3 * 0.36)
    assert found.above <= found.below * (1 + 1.001e-4)
    eased = multiplier.eased_bound(asked, "f", v, {"x": 0.6}, Effort(gap=1e-9, absolute=1e-6))
    assert eased > found.below * 1.005


@pytest.mark.slow
def test_with_gaps_by_effect_a_ridge_takes_few_boxes():
    """Boxes alone need some ten thousand for it: what they overestimate at the rim falls with their width only."""
    boxes = []
    asked = suprema(gaps={"h": 1e-3}, spent=lambda _, count: boxes.append(count))
    found = asked.norms("h", [column_of(RIDGE)])
    most, _ = largest(RIDGE, np.array(S, dtype=float))
    assert most <= found.above <= found.below * (1 + 1.001e-3)
    assert sum(boxes) < 100_000
    plain = replace(asked, gaps={}, effort=Effort(gap=1e-3, budget=4000)).norms("h", [column_of(RIDGE)])
    assert plain.above > plain.below * 1.005

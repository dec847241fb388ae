"""Clearance against dense sampling, closed forms, and obstacles that are met."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tubecert.bounds.clearance import Section, Shape, clearance, directions
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Interval
from tubecert.expression import constant, parse, symbol
from tubecert.spec import Disc, Obstacle
from tubecert.trajectory.plan import Plan, constant_plan

EFFORT = Effort(gap=1e-2, absolute=0.0, budget=100_000)
W = np.array([[1.0, 0.5], [0.5, 4.0]])
SHAPE = Shape(diagonal=(1.0, 4.0), beside=(0.5, 0.5))


def section(reach=0.1, shape=SHAPE):
    return Section(columns=(0, 1), reach=Interval(reach, reach), shape=shape, upper=2.0)


def plan(*texts, horizon=7):
    t = symbol("t")
    x = tuple(parse(text, symbols={"t": t}).expression for text in texts)
    return Plan(x, (constant(Fraction(0)),), Fraction(horizon))


CIRCLE = plan("sin(t)", "cos(t)")


def disc(x, y, r):
    return Obstacle(states=("a", "b"), disc=Disc(center=(Fraction(x), Fraction(y)), radius=Fraction(r)))


def polygon(*corners):
    return Obstacle(states=("a", "b"), polygon=tuple((Fraction(x), Fraction(y)) for x, y in corners))


def sampled(obstacle, curve, reach=0.1):
    """The same minimum of maxima on a fine grid of times and directions."""
    turns = np.linspace(0, 2 * np.pi, 1441)
    c = np.stack([np.cos(turns), np.sin(turns)])
    extent = reach * np.sqrt(np.einsum("ik,ij,jk->k", c, W, c))
    if obstacle.radius is not None:
        tops = [np.array([float(v) for v in obstacle.center]) @ c + float(obstacle.radius)]
    else:
        corners = np.array([[float(v) for v in corner] for corner in obstacle.polygon]) @ c
        tops = list(np.maximum(corners, np.roll(corners, -1, axis=0)))
    return min(
        max_gap for p in curve for max_gap in [min(float(np.max(p @ c - top - extent)) for top in tops)]
    )


POINTS = np.stack([np.sin(np.linspace(0, 7, 701)), np.cos(np.linspace(0, 7, 701))], axis=1)


@pytest.mark.parametrize(
    "obstacle",
    [
        disc(2, 0, "0.5"),
        disc(0, 0, "0.3"),
        polygon((2, -1), (3, -1), (3, 1)),
        polygon(("1.5", "-0.2"), (3, -1), ("2.5", 0), (3, 1)),  # not convex
        polygon(("-0.2", "-0.2"), ("0.2", "-0.2"), ("0.2", "0.2"), ("-0.2", "0.2")),  # the plan runs round it
    ],
)
def test_it_is_just_below_what_is_sampled(obstacle):
    found, near = clearance(CIRCLE, obstacle, section(), EFFORT), sampled(obstacle, POINTS)
    assert 0 < found.below <= near + 1e-9
    assert found.below >= near - 3e-3
    assert found.inside is None


def test_the_directions_have_length_one_and_lie_all_around():
    assert all(c**2 + s**2 == 1 for c, s in directions())
    angles = np.sort([np.arctan2(float(s), float(c)) for c, s in directions()])
    assert np.diff([*angles, angles[0] + 2 * np.pi]).max() < 0.13


def test_a_plan_inside_of_a_polygon_is_not_clear_of_its_edges():
    around = polygon((-20, -20), (20, -20), (20, 20), (-20, 20))
    found = clearance(CIRCLE, around, section(), EFFORT)
    assert found.below <= 0
    assert found.inside is not None


@pytest.mark.parametrize("obstacle", [disc(1, 0, "0.1"), polygon(("0.85", -1), (3, -1), (3, 1), ("0.85", 1))])
def test_what_is_met_is_refuted_by_a_point_of_the_obstacle_in_the_tube(obstacle):
    found = clearance(CIRCLE, obstacle, section(), EFFORT)
    assert found.below <= 0
    y = np.array(found.inside)
    away = y - [np.sin(found.t), np.cos(found.t)]
    assert np.sqrt(2.0) * np.hypot(*away) < 0.1
    if obstacle.radius is not None:
        assert np.hypot(y[0] - 1, y[1]) <= 0.1
    else:
        assert y[0] >= 0.85


def test_what_only_the_ellipse_may_meet_is_undecided():
    # W says that the tube reaches sup sqrt(W22) = 2 times the distance; M <= 2 I shows 0.07 of it only
    still = constant_plan((Fraction(0), Fraction(0)), (Fraction(0),), None)
    found = clearance(still, disc(0, "0.25", "0.1"), section(), EFFORT)
    assert found.below <= 0
    assert found.inside is None


@pytest.mark.slow
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.05, 1), st.floats(0.01, 0.5), st.integers(0, 2**31))
def test_no_state_of_the_tube_is_nearer(x, y, r, reach, seed):
    found = clearance(CIRCLE, disc(repr(x), repr(y), repr(r)), section(reach), EFFORT)
    rng = np.random.default_rng(seed)
    turns, t = rng.uniform(0, 2 * np.pi, 200), rng.uniform(0, 7, 200)
    rim = reach * np.linalg.cholesky(W) @ np.stack([np.cos(turns), np.sin(turns)])
    states = np.stack([np.sin(t), np.cos(t)]) + rim
    nearest = np.min(np.hypot(states[0] - x, states[1] - y) - r)
    assert found.below <= nearest + 1e-9 or found.below <= 0 < nearest


def test_a_piece_of_w_beside_the_diagonal_counts_on_its_worse_side():
    wide = Shape(diagonal=(1.0, 4.0), beside=(-0.5, 0.5))
    for c in ((Fraction(3, 5), Fraction(4, 5)), (Fraction(3, 5), Fraction(-4, 5))):
        assert float(wide.square(c).hi) == pytest.approx(0.36 + 4 * 0.64 + 2 * 0.48 * 0.5, rel=1e-12)


class Unbounded:
    """A plan that is not bounded for a while."""

    is_constant, time = False, {"t": (Fraction(0), Fraction(1))}

    def enclose(self, lo, hi, span=None):
        bad = (lo <= 0.5) & (hi >= 0.4)
        x = np.where(bad[:, None], np.nan, np.zeros((len(lo), 2)))
        return Interval(x, x), Interval(x[:, :1], x[:, :1])


@pytest.mark.slow
def test_where_the_plan_is_not_bounded_nothing_is_proven():
    assert clearance(Unbounded(), disc(5, 0, 1), section(), EFFORT).below <= 0

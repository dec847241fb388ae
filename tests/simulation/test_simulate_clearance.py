"""Distances from obstacles against dense sampling; of runs between their output times."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import simulated
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.simulation.adaptive.judge import of_plan, of_run, of_tube
from tubecert.simulation.obstacles import signed_distance
from tubecert.spec import Disc, Obstacle, load_text

SPEC = """
tubecert: 1
name: scene
system: {{states: [a, b, c], inputs: [u], f: ["-a", "-b", "-c"], B: [[0], [1], [0]]}}
safe_set: {{a: [-9, 9], b: [-9, 9], c: [-9, 9]}}
uncertainty: {{h: ["0"]}}
trajectory: {{kind: equilibrium, at: [0, 0, 0]}}
obstacles: [{obstacle}]
"""


def polygon(*corners):
    exact = tuple(tuple(Fraction(value) for value in corner) for corner in corners)
    return Obstacle(states=("a", "c"), polygon=exact)


STAR = polygon((0, 0), (4, 1), (1, 2), (2, 5), (-1, 3), (-3, 3), (-1, 1))  # not convex
coordinates = st.floats(-6, 6)


def filled(obstacle, step=0.02):
    """A fine grid of points, and which of them are inside by the winding number."""
    corners = np.array(obstacle.polygon, dtype=float)
    g = np.stack(np.meshgrid(np.arange(-4, 6, step), np.arange(-1, 6, step)), axis=-1).reshape(-1, 2)
    rays = corners[None] - g[:, None]
    angles = np.angle(rays[..., 0] + 1j * rays[..., 1])
    turns = np.diff(np.concatenate([angles, angles[:, :1]], axis=1), axis=1)
    return g[np.abs(((turns + np.pi) % (2 * np.pi) - np.pi).sum(axis=1)) > np.pi]


INSIDE = filled(STAR)


@settings(max_examples=40, deadline=None)
@given(st.tuples(coordinates, coordinates))
def test_distance_to_a_polygon(point):
    value = float(signed_distance(STAR, np.array([point]))[0])
    sampled = np.linalg.norm(INSIDE - np.array(point), axis=1).min()
    if value > 0:
        assert value - 1e-9 <= sampled <= value + 0.03
    else:
        assert sampled <= 0.03


def test_distance_inside_is_negative_and_to_the_boundary():
    square = polygon((0, 0), (2, 0), (2, 2), (0, 2))
    found = signed_distance(square, np.array([[1.0, 1.0], [0.5, 1.0], [3.0, 1.0], [3.0, 3.0]]))
    np.testing.assert_allclose(found, [-1, -0.5, 1, np.sqrt(2)])


def test_distance_to_a_disc():
    disc = Obstacle(states=("a", "c"), disc=Disc(center=(Fraction(1), Fraction(0)), radius=Fraction(1, 2)))
    np.testing.assert_allclose(signed_distance(disc, np.array([[1.0, 0.0], [3.0, 0.0]])), [-0.5, 1.5])


STEP = np.pi / 4


def circling(angle):
    """The distance of a run around a circle, in few steps, from a disc that reaches .01 into it at an angle."""
    at = [float(value) for value in (1.1 * np.cos(angle), 1.1 * np.sin(angle))]
    spec = load_text(SPEC.format(obstacle=f"{{states: [a, c], disc: {{center: {at}, radius: 0.11}}}}"))
    t = STEP * np.arange(6)
    x = np.stack([np.cos(t), 0 * t, np.sin(t)], axis=1)
    slope = np.stack([-np.sin(t), 0 * t, np.cos(t)], axis=1)
    x[5] = slope[5] = np.nan  # the run was stopped
    runs = simulated.runs(t, x[None], np.zeros((1, 6)))
    runs.slope[:] = slope
    (found,) = of_run(SimpleNamespace(spec=spec), runs)
    return found


@pytest.mark.parametrize("steps", [1.5, 2.3, 4.0])
def test_a_run_meets_an_obstacle_between_output_times_and_where_it_ends(steps):
    """Chords pass the disc at a distance, the cubics between them meet it."""
    found = circling(steps * STEP)
    assert found.collides
    assert (found.clearance, found.t) == (
        pytest.approx(-0.01, abs=2e-3),
        pytest.approx(steps * STEP, abs=0.05),
    )


def test_a_run_that_is_over_is_not_near():
    assert circling(5.0 * STEP).clearance > 0.5


@pytest.mark.slow
def test_the_plan_and_the_tube_of_a_shipped_system():
    """That of the tube is proven: it is at most that of the plan, and what a ball and a box of half-widths leave."""
    own = simulated.setting("two_state", "0.4")
    (plan,), (tube,) = of_plan(own), of_tube(own)
    assert not plan.collides
    assert not tube.collides
    assert plan.clearance - own.rho <= tube.clearance < plan.clearance
    assert plan.t == pytest.approx(tube.t, abs=0.2)

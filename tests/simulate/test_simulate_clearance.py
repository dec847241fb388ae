"""Clearances against dense sampling of the obstacles."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tubecert.campaigns.obstacles import signed_distance
from tubecert.simulate.clearance import of_curve, of_tube
from tubecert.spec import Obstacle, load_text

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
    disc = Obstacle(states=("a", "c"), center=(Fraction(1), Fraction(0)), radius=Fraction(1, 2))
    np.testing.assert_allclose(signed_distance(disc, np.array([[1.0, 0.0], [3.0, 0.0]])), [-0.5, 1.5])


def test_a_curve_meets_an_obstacle_in_the_plane_of_its_states():
    spec = load_text(SPEC.format(obstacle="{states: [c, a], disc: {center: [2, 0], radius: 1}}"))
    t = np.linspace(0, 1, 101)
    x = np.stack([np.zeros(101), 5 * np.ones(101), 4 * t], axis=1)
    (found,) = of_curve(spec, t, x)
    assert found.collides
    assert (found.value, found.time) == (pytest.approx(-1.0), pytest.approx(0.5))
    x[60:] = np.nan  # a run that was stopped
    assert of_curve(spec, t, x)[0].value == pytest.approx(-1.0)
    x[30:] = np.nan
    assert of_curve(spec, t, x)[0].value == pytest.approx(1 - 4 * 0.29)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(coordinates, coordinates, st.floats(0.2, 2), st.floats(0.1, 1), st.floats(0.1, 1))
def test_the_clearance_of_a_tube_is_never_too_large(a, c, rho, wide, high):
    corners = ", ".join(f"[{x}, {y}]" for x, y in STAR.polygon)
    spec = load_text(SPEC.format(obstacle=f"{{states: [a, c], polygon: [{corners}]}}"))
    widths = np.array([wide * rho, rho, high * rho])
    (found,) = of_tube(spec, np.zeros(1), np.array([[a, 0.0, c]]), rho, widths)
    offset = INSIDE - np.array([a, c])
    in_box = (np.abs(offset) <= widths[[0, 2]]).all(axis=1)
    in_disc = np.linalg.norm(offset, axis=1) <= rho
    if (in_box & in_disc).any():
        assert found.value <= 0.03
    beyond = np.maximum(np.abs(offset) - widths[[0, 2]], 0)
    box = np.linalg.norm(beyond, axis=1).min()
    disc = np.linalg.norm(offset, axis=1).min() - rho
    assert found.value <= max(box, disc) + 0.03
    assert found.collides == (found.value <= 0)
    if box > 0.05 or disc > 0.05:
        assert found.value > 0

"""Distances of points from obstacles, in the plane of two states. Trusted: no."""

from __future__ import annotations

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.spec import Obstacle, Spec


def in_plane(spec: Spec, obstacle: Obstacle, x: Array) -> Array:
    """The two coordinates (..., 2) of an obstacle's plane."""
    return np.asarray(x[..., [spec.states.index(name) for name in obstacle.states]])


def signed_distance(obstacle: Obstacle, points: Array) -> Array:
    """Distance of points (K, 2) to an obstacle, negative inside."""
    if obstacle.radius is not None:
        centre = np.array([float(value) for value in obstacle.center])
        return np.asarray(np.linalg.norm(points - centre, axis=-1) - float(obstacle.radius))
    corners = corners_of(obstacle)
    nearest = np.min(np.stack([_to_segment(points, *edge) for edge in edges(corners)]), axis=0)
    return np.asarray(np.where(_inside(corners, points), -nearest, nearest))


def corners_of(obstacle: Obstacle) -> Array:
    """The corners of a polygon, (K, 2)."""
    return np.array([[float(value) for value in corner] for corner in obstacle.polygon])


def edges(corners: Array) -> list[tuple[Array, Array]]:
    """The edges of a polygon, from corner to corner."""
    return list(zip(corners, np.roll(corners, -1, axis=0), strict=True))


def _to_segment(points: Array, a: Array, b: Array) -> Array:
    """Distance of points (K, 2) to the segment from a to b."""
    along = b - a
    share = np.clip((points - a) @ along / (along @ along), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - share[..., None] * along, axis=-1))


def _inside(corners: Array, points: Array) -> Array:
    """Whether points (K, 2) are in a polygon: a ray to the right crosses an odd number of edges."""
    crossings = np.zeros(points.shape[:-1], dtype=int)
    with np.errstate(invalid="ignore", divide="ignore"):
        for a, b in edges(corners):
            spans = (a[1] > points[..., 1]) != (b[1] > points[..., 1])
            at = a[0] + (points[..., 1] - a[1]) * (b[0] - a[0]) / (b[1] - a[1])
            crossings += spans & (points[..., 0] < at)
    return np.asarray(crossings % 2 == 1)

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
    begin, p = corners_of(obstacle), points[..., None, :]  # edge by edge
    end = np.roll(begin, -1, axis=0)
    along, off = end - begin, p - begin
    share = np.clip((off * along).sum(axis=-1) / (along**2).sum(axis=-1), 0.0, 1.0)
    nearest = np.linalg.norm(off - share[..., None] * along, axis=-1).min(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        at = begin[:, 0] + off[..., 1] * along[:, 0] / along[:, 1]
        crosses = ((begin[:, 1] > p[..., 1]) != (end[:, 1] > p[..., 1])) & (p[..., 0] < at)
    inside = crosses.sum(axis=-1) % 2 == 1  # a ray to the right
    return np.asarray(np.where(inside, -nearest, nearest))


def corners_of(obstacle: Obstacle) -> Array:
    """The corners of a polygon, (K, 2)."""
    return np.array(obstacle.polygon, dtype=float)

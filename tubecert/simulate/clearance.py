"""Distances between curves, tubes and obstacles in the plane of two states. Sampled in time, hence no proof.

The tube at a time is inside the disc of radius rho around x*(t) and inside the box of its half-widths: its clearance is
at least the larger of the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tubecert.campaigns.obstacles import corners_of, edges, in_plane, signed_distance
from tubecert.enclosure.interval import Array
from tubecert.spec import Obstacle, Spec


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """The least distance to an obstacle (negative: by how much it is entered), and when, in s."""

    obstacle: int
    value: float
    time: float

    @property
    def collides(self) -> bool:
        """Whether the obstacle is met."""
        return self.value <= 0


def of_curve(spec: Spec, t: Array, x: Array) -> tuple[Clearance, ...]:
    """The clearance of a curve (K, n) at times (K,) from every obstacle; nan where the curve has ended."""
    found = []
    for number, obstacle in enumerate(spec.obstacles):
        gaps = signed_distance(obstacle, in_plane(spec, obstacle, x))
        found.append(_least(number, t, gaps))
    return tuple(found)


def of_tube(spec: Spec, t: Array, x: Array, rho: float, half_widths: Array) -> tuple[Clearance, ...]:
    """The clearance of the tube around a curve (K, n), with half-widths (n,), from every obstacle."""
    found = []
    for number, obstacle in enumerate(spec.obstacles):
        centres = in_plane(spec, obstacle, x)
        disc = signed_distance(obstacle, centres) - rho
        box = _box_distance(obstacle, centres, in_plane(spec, obstacle, half_widths))
        found.append(_least(number, t, np.where(box > 0, np.maximum(disc, box), disc)))
    return tuple(found)


def _least(number: int, t: Array, gaps: Array) -> Clearance:
    if np.isnan(gaps).all():
        return Clearance(obstacle=number, value=float("nan"), time=float(t[0]))
    step = int(np.nanargmin(gaps))
    return Clearance(obstacle=number, value=float(gaps[step]), time=float(t[step]))


def _box_distance(obstacle: Obstacle, centres: Array, widths: Array) -> Array:
    """Distance (K,) between boxes around centres (K, 2) and an obstacle; 0 where they meet."""
    if obstacle.radius is not None:
        middle = np.array([float(value) for value in obstacle.center])
        outside = np.maximum(np.abs(centres - middle) - widths, 0.0)
        return np.asarray(np.maximum(np.linalg.norm(outside, axis=-1) - float(obstacle.radius), 0.0))
    corners = corners_of(obstacle)
    signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    boxes = centres[:, None, :] + signs * widths  # (K, 4, 2)
    to_polygon = np.min(signed_distance(obstacle, boxes), axis=1)
    outside = np.maximum(np.abs(corners[None] - centres[:, None]) - widths, 0.0)
    to_box = np.min(np.linalg.norm(outside, axis=-1), axis=1)
    apart = np.minimum(np.maximum(to_polygon, 0.0), to_box)
    return np.where(_edges_cross(boxes, corners), 0.0, apart)


def _edges_cross(boxes: Array, corners: Array) -> Array:
    """Whether an edge of a polygon crosses a side of boxes (K, 4, 2), (K,)."""
    found = np.zeros(len(boxes), dtype=bool)
    for a, b in edges(corners):
        for i in range(4):
            c, d = boxes[:, i], boxes[:, (i + 1) % 4]
            first = _turn(a, b, c) * _turn(a, b, d) <= 0
            found |= first & (_turn(c, d, a) * _turn(c, d, b) <= 0)
    return found


def _turn(a: Array, b: Array, c: Array) -> Array:
    """Twice the signed area of triangles, broadcast over the leading axes."""
    return np.asarray(
        (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    )

"""What all figures have in common: bands over time, the plane of two states with tube and obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.certificate.effective import Effective, ObstacleView
from tubecert.enclosure.interval import Array
from tubecert.report.claimed import labelled
from tubecert.report.figures_axes import (
    BOTTOM,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    Axis,
    Chart,
    Point,
    ellipse,
    swept,
)

_ZOOM = 4.0  # a safe set larger than this many tubes is shown in part
_HEIGHT = 190
_FINE = 0.1  # units of the viewport
TUBE = {True: "tube", False: "unproven"}  # the style, by whether it is proven


def over_time(
    key: str,
    name: str,
    label: str,
    curve: tuple[Array, Array],
    *,
    band: tuple[Array, Array] | None,
    limits: Point | None,
    words: tuple[str, str],
    proven: bool,
) -> Chart:
    """A curve of the plan (t in s, values), the band around it (below, above), and the limits, as far as known.

    `words` say what the limits and the band are.
    """
    t, x = curve
    shown = np.concatenate([x, *(band or ())])
    safe = limits or (x[0], x[0])
    y = view(shown, safe, label, near=is_near(shown, safe))
    time = Axis(label="t (s)", low=float(t[0]), high=float(t[-1]))
    chart = Chart(key=key, title=f"{name} over time", x=time, y=y, height=_HEIGHT)
    if limits is not None:
        chart.box((time.low, y.low), (time.high, y.high), "outside")
        chart.box((time.low, limits[0]), (time.high, limits[1]), "safe", words[0])
    if band is not None:
        around = [np.stack([t, side], axis=1) for side in band]
        chart.area([np.concatenate([around[1], around[0][::-1]])], TUBE[proven], words[1])
    chart.line(np.stack(curve, axis=1), "plan", "plan")
    return chart


def is_near(shown: Array, safe: Point) -> bool:
    """Whether values can be told apart beside the whole safe range."""
    return not len(shown) or safe[1] - safe[0] <= _ZOOM * (shown.max() - shown.min())


def view(shown: Array, safe: Point, label: str, *, near: bool) -> Axis:
    """An axis that shows some values, with or without the safe range."""
    return Axis.around([*shown, *safe] if near else shown, label, pad=0.06 if near else 0.25)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """The plane of two states, by their places: the plan (K, 2), the outline (N, 2) of the tube, the safe set."""

    effective: Effective
    pair: tuple[int, int]
    plan: Array
    tube: Array | None
    safe: tuple[Point, Point]
    proven: bool

    def chart(self, key: str, marks: Sequence[Point] = ()) -> Chart:
        """The safe set, the tube, the plan, and the obstacles in the plane; there is room for `marks`."""
        system = self.effective.system
        names = system.states[self.pair[0]], system.states[self.pair[1]]
        x, y = self._axes([labelled(name, system) for name in names], marks)
        across, height = WIDTH - LEFT - RIGHT, HEIGHT
        if system.units.get(names[0]) == system.units.get(names[1]):  # a circle is round, if there is room
            height = round(across * (y.high - y.low) / (x.high - x.low)) + TOP + BOTTOM
            height = min(max(height, 200), 420)
        title = f"Tube in the plane of {names[0]} and {names[1]}"
        chart = Chart(key=key, title=title, x=x, y=y, height=height)
        chart.box((x.low, y.low), (x.high, y.high), "outside")
        (left, right), (bottom, top) = self.safe
        chart.box((left, bottom), (right, top), "safe", "safe set")
        if len(self.plan) and self.tube is not None and np.isfinite(self.tube).all():
            up = height - TOP - BOTTOM
            fine = _FINE * np.array([(x.high - x.low) / across, (y.high - y.low) / up])
            words = "tube" if self.proven else "tube, not proven to stay in the safe set"
            chart.area(swept(self.plan, self.tube, fine), TUBE[self.proven], words)
        if len(self.plan) > 1:
            chart.line(self.plan, "plan", "plan")
        for obstacle in self.effective.obstacles:
            if set(obstacle.states) == set(names):
                chart.area([_shape(obstacle, names)], "obstacle", "obstacle")
        return chart

    def _axes(self, labels: Sequence[str], marks: Sequence[Point]) -> list[Axis]:
        """Axes that show the tube, the marks, and of the safe set as much as leaves the tube visible."""
        reach = np.zeros(2) if self.tube is None else np.abs(self.tube).max(axis=0)
        shown = np.concatenate([self.plan - reach, self.plan + reach, np.reshape(marks, (-1, 2))])
        near = all(is_near(shown[:, i], self.safe[i]) for i in (0, 1))
        return [view(shown[:, i], self.safe[i], labels[i], near=near) for i in (0, 1)]


def _shape(obstacle: ObstacleView, names: tuple[str, str]) -> Array:
    """The corners of an obstacle, or points around it, (K, 2) in the order of the states of the plane."""
    own = np.array(obstacle.polygon, dtype=float).reshape(-1, 2)
    if obstacle.disc is not None:
        center, radius = np.array(obstacle.disc.center, dtype=float), float(obstacle.disc.radius)
        own = center + ellipse(radius**2 * np.eye(2))
    return own if obstacle.states == names else own[:, ::-1]

"""What all figures have in common: bands over time, the plane of two states with tube and obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.certificate.effective import ObstacleView, SystemView
from tubecert.enclosure.interval import Array
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


def labelled(name: str, system: SystemView) -> str:
    """A state or an input with its unit, if it has one."""
    unit = system.units.get(name, "")
    return f"{name} ({unit})" if unit else name


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """What is known in the plane of two states: the plan (K, 2), the outline (N, 2) of the tube, the safe set."""

    names: tuple[str, str]
    units: tuple[str, str]
    labels: tuple[str, str]
    plan: Array
    tube: Array | None
    safe: tuple[Point, Point]

    @classmethod
    def of(
        cls, system: SystemView, pair: tuple[int, int], x: Array, tube: Array | None, safe: Sequence[Point]
    ) -> Plane:
        """The plane of two states by their places; `x` (K, n) is the plan, `safe` the range of each of the two."""
        names = system.states[pair[0]], system.states[pair[1]]
        return cls(
            names=names,
            units=(system.units.get(names[0], ""), system.units.get(names[1], "")),
            labels=(labelled(names[0], system), labelled(names[1], system)),
            plan=x[:, pair],
            tube=tube,
            safe=((safe[0][0], safe[1][0]), (safe[0][1], safe[1][1])),
        )

    def axes(self, marks: Sequence[Point] = ()) -> tuple[Axis, Axis]:
        """Axes that show the tube, the marks, and of the safe set as much as leaves the tube visible."""
        reach = np.zeros(2) if self.tube is None else np.abs(self.tube).max(axis=0)
        shown = np.concatenate([self.plan - reach, self.plan + reach, np.reshape(marks, (-1, 2))])
        safe = [(self.safe[0][i], self.safe[1][i]) for i in (0, 1)]
        near = all(is_near(shown[:, i], safe[i]) for i in (0, 1))
        first, second = (view(shown[:, i], safe[i], self.labels[i], near=near) for i in (0, 1))
        return first, second


def scene(
    key: str, plane: Plane, obstacles: Sequence[ObstacleView], marks: Sequence[Point] = (), *, proven: bool
) -> Chart:
    """A chart with the safe set, the tube, the plan, and the obstacles in the plane."""
    x, y = plane.axes(marks)
    title, height = f"Tube in the plane of {plane.names[0]} and {plane.names[1]}", _height_of(plane, x, y)
    chart = Chart(key=key, title=title, x=x, y=y, height=height)
    chart.box((x.low, y.low), (x.high, y.high), "outside")
    chart.box(*plane.safe, "safe", "safe set")
    if len(plane.plan) and plane.tube is not None and np.isfinite(plane.tube).all():
        across, up = WIDTH - LEFT - RIGHT, height - TOP - BOTTOM
        fine = _FINE * np.array([(x.high - x.low) / across, (y.high - y.low) / up])
        words = "tube" if proven else "tube, not proven to stay in the safe set"
        chart.area(swept(plane.plan, plane.tube, fine), TUBE[proven], words)
    if len(plane.plan) > 1:
        chart.line(plane.plan, "plan", "plan")
    shapes = [_shape(each, plane.names) for each in obstacles if set(each.states) == set(plane.names)]
    for shape in shapes:
        chart.area([shape], "obstacle", "obstacle")
    return chart


def _height_of(plane: Plane, x: Axis, y: Axis) -> int:
    """The height at which a circle is round, if both states have one unit and neither side gets too short."""
    if plane.units[0] != plane.units[1]:
        return HEIGHT
    height = round((WIDTH - LEFT - RIGHT) * (y.high - y.low) / (x.high - x.low)) + TOP + BOTTOM
    return min(max(height, 200), 420)


def _shape(obstacle: ObstacleView, names: tuple[str, str]) -> Array:
    """The corners of an obstacle, or points around it, (K, 2) in the order of the states of the plane."""
    own = np.array(obstacle.polygon, dtype=float).reshape(-1, 2)
    if obstacle.disc is not None:
        center, radius = np.array(obstacle.disc.center, dtype=float), float(obstacle.disc.radius)
        own = center + ellipse(radius**2 * np.eye(2))
    return own if obstacle.states == names else own[:, ::-1]

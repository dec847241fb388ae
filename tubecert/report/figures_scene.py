"""What all figures have in common: bands over time, the plane of two states with tube and obstacles."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tubecert.certificate.effective import ObstacleView
from tubecert.enclosure.interval import Array
from tubecert.report.figures_axes import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, Axis, Chart, Point
from tubecert.report.page import Figure

Pair = tuple[float, float]
Matrix = tuple[Pair, Pair]
_ZOOM = 4.0  # a safe set larger than this many tubes is shown in part
_HEIGHT = 190


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawing:
    """A curve of the plan, the band around it that is proven (below, above), and the limits of the quantity."""

    key: str
    name: str
    unit: str
    curve: Sequence[Point]
    band: tuple[list[Point], list[Point]] | None
    limits: Point | None
    words: tuple[str, str, str]  # of the limits, the band, the curve

    def figure(self, style: str) -> Figure:
        """The figure; `style` is that of the band."""
        label = f"{self.name} ({self.unit})" if self.unit else self.name
        below, above = self.band or ([], [])
        shown = [value for _, value in [*self.curve, *below, *above]]
        safe = self.limits or (shown[0], shown[0])
        y = view(shown, safe, label, near=is_near(shown, safe))
        time = Axis(label="t (s)", low=self.curve[0][0], high=self.curve[-1][0])
        chart = Chart(self.key, f"{self.name} over time", time, y, height=_HEIGHT)
        if self.limits is not None:
            chart.box((time.low, y.low), (time.high, y.high), "outside")
            chart.box((time.low, self.limits[0]), (time.high, self.limits[1]), "safe")
        if self.band is not None:
            chart.area([*above, *reversed(below)], style)
        chart.line(self.curve, "plan")
        return Figure(
            key=self.key, title=f"{self.name} over time", svg=chart.text(), legend=self._legend(style)
        )

    def _legend(self, style: str) -> tuple[tuple[str, str], ...]:
        drawn = (("safe", self.limits), (style, self.band), ("plan", self.curve))
        return tuple(
            (key, words) for (key, part), words in zip(drawn, self.words, strict=True) if part is not None
        )


def is_near(shown: Sequence[float], safe: Point) -> bool:
    """Whether values can be told apart beside the whole safe range."""
    return not shown or safe[1] - safe[0] <= _ZOOM * (max(shown) - min(shown))


def view(shown: Sequence[float], safe: Point, label: str, *, near: bool) -> Axis:
    """An axis that shows some values, with or without the safe range."""
    return Axis.around([*shown, *safe] if near else shown, label, pad=0.06 if near else 0.25)


@dataclass(frozen=True, slots=True, kw_only=True)
class Outline:
    """The image of the unit disc under `turn`, cut to `sides` on both sides of each coordinate, if any."""

    turn: Matrix
    sides: Pair | None = None

    @property
    def reach(self) -> Pair:
        """How far it goes in each coordinate."""
        first, second = (math.hypot(*row) for row in self.turn)
        return (
            (first, second) if self.sides is None else (min(first, self.sides[0]), min(second, self.sides[1]))
        )

    def points(self, number: int = 72) -> Array:
        """Points (number, 2) around it."""
        angle = np.linspace(0.0, 2 * np.pi, number + 1)[:-1]
        around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ np.array(self.turn).T
        sides = np.array((np.inf, np.inf) if self.sides is None else self.sides)
        return np.asarray(np.clip(around, -sides, sides))


@dataclass(frozen=True, slots=True, kw_only=True)
class Plane:
    """What is known in the plane of two states: the plan, the tube and its domain at one time, the safe set."""

    names: tuple[str, str]
    units: tuple[str, str]
    index: tuple[int, int]
    plan: tuple[Point, ...]
    tube: Outline | None
    safe: tuple[Point, Point]

    def of(self, x: Sequence[float]) -> Point:
        """The two coordinates of a state."""
        return float(x[self.index[0]]), float(x[self.index[1]])

    def axes(self, marks: Sequence[Point]) -> tuple[Axis, Axis]:
        """Axes that show the tube, the marks, and of the safe set as much as leaves the tube visible."""
        shown = [self._shown(i, [mark[i] for mark in marks]) for i in (0, 1)]
        safe = [(self.safe[0][i], self.safe[1][i]) for i in (0, 1)]
        near = all(map(is_near, shown, safe))
        first, second = (view(shown[i], safe[i], self._label(i), near=near) for i in (0, 1))
        return first, second

    def _shown(self, i: int, marks: list[float]) -> list[float]:
        reach = 0.0 if self.tube is None else self.tube.reach[i]
        return [p[i] + side for p in self.plan for side in (-reach, reach)] + marks

    def _label(self, i: int) -> str:
        return f"{self.names[i]} ({self.units[i]})" if self.units[i] else self.names[i]


def scene(
    key: str, plane: Plane, marks: list[Point], proven: bool = True
) -> tuple[Chart, list[tuple[str, str]]]:
    """A chart with the safe set, the tube and the plan; and their legend."""
    x, y = plane.axes(marks)
    title = f"Plan and tube in the plane of {plane.names[0]} and {plane.names[1]}"
    chart = Chart(key, title, x, y, height=_height_of(plane, x, y))
    chart.box((x.low, y.low), (x.high, y.high), "outside")
    chart.box(*plane.safe, "safe")
    legend = [("safe", "safe set")]
    if plane.plan and plane.tube is not None:
        inner = chart if plane.tube.sides is None else chart.clipped(plane.plan, plane.tube.sides)
        inner.sweep(plane.plan, plane.tube.turn, "tube" if proven else "unproven")
        legend.append(
            ("tube", "tube") if proven else ("unproven", "tube, not proven to stay in the safe set")
        )
    if len(plane.plan) > 1:
        chart.line(plane.plan, "plan")
        legend.append(("plan", "plan"))
    return chart, legend


def _height_of(plane: Plane, x: Axis, y: Axis) -> int:
    """The height at which a circle is round, if both states have one unit and neither side gets too short."""
    if plane.units[0] != plane.units[1]:
        return HEIGHT
    height = round((WIDTH - LEFT - RIGHT) * (y.high - y.low) / (x.high - x.low)) + TOP + BOTTOM
    return min(max(height, 200), 420)


def draw_obstacles(
    chart: Chart, obstacles: Sequence[ObstacleView], names: tuple[str, str]
) -> list[tuple[str, str]]:
    """Those in the plane of two states; what their colour means, if there are any."""
    found = [obstacle for obstacle in obstacles if set(obstacle.states) == set(names)]
    for obstacle in found:
        a, b = (0, 1) if obstacle.states == names else (1, 0)
        if obstacle.disc is not None:
            center, radius = obstacle.disc.center, float(obstacle.disc.radius)
            chart.ellipse((float(center[a]), float(center[b])), (radius, radius), "obstacle")
        else:
            chart.area([(float(corner[a]), float(corner[b])) for corner in obstacle.polygon], "obstacle")
    return [("obstacle", "obstacle")] if found else []

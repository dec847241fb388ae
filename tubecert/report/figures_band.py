"""What figures of every certificate have in common: a band around a curve over time, ranges to be shown, obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tubecert.certificate.effective import ObstacleView
from tubecert.report.figures_axes import Axis, Chart, Point
from tubecert.report.page import Figure

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


def draw_obstacle(chart: Chart, obstacle: ObstacleView, names: tuple[str, str]) -> None:
    """An obstacle in the plane of two states."""
    a, b = (0, 1) if obstacle.states == names else (1, 0)
    if obstacle.disc is not None:
        center, radius = obstacle.disc.center, float(obstacle.disc.radius)
        chart.ellipse((float(center[a]), float(center[b])), (radius, radius), "obstacle")
    else:
        corners = [(float(corner[a]), float(corner[b])) for corner in obstacle.polygon]
        chart.area(corners, "obstacle")

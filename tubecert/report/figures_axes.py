"""Axes and marks as SVG: a chart in viewport units that a style sheet colours, for light, dark and print.

Own SVG and no plotting library: the marks take their colours from the page, texts stay texts, and the same data gives
the same bytes everywhere. `xml.etree` writes it, so it is well-formed and escaped whatever the texts hold.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field
from itertools import pairwise

from tubecert.digits import short

Point = tuple[float, float]
WIDTH, HEIGHT = 400, 270
LEFT, RIGHT, TOP, BOTTOM = 60, 14, 12, 42


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A range of values, linear or logarithmic, with round ticks."""

    label: str
    low: float
    high: float
    log: bool = False

    @classmethod
    def around(cls, values: Iterable[float], label: str, *, log: bool = False, pad: float = 0.05) -> Axis:
        """The axis that holds all values, with some room on both sides."""
        known = [math.log10(v) if log else v for v in values]
        low, high = min(known), max(known)
        room = pad * (high - low) if high > low else 0.3 if log else 0.1 * abs(high) or 1.0
        low, high = low - room, high + room
        return (
            cls(label=label, low=10.0**low, high=10.0**high, log=True)
            if log
            else cls(label=label, low=low, high=high)
        )

    def share(self, value: float) -> float:
        """Where a value lies: 0 at the low end, 1 at the high end."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """About five round values."""
        return self._decades() if self.log else _steps(self.low, self.high)

    def _decades(self) -> list[float]:
        first, last = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        span = math.log10(self.high / self.low)
        factors = (1, 2, 5) if span < 2 else (1, 3) if span < 3 else (1,)
        every = max(1, round(span / 5))
        values = [f * 10.0**k for k in range(first, last + 1) if k % every == 0 for f in factors]
        inside = [v for v in values if self.low <= v <= self.high]
        return inside if len(inside) >= 2 else _steps(self.low, self.high)


def _steps(low: float, high: float) -> list[float]:
    raw = (high - low) / 8
    unit = 10.0 ** math.floor(math.log10(raw))
    step = next(f * unit for f in (1, 2, 5, 10) if f * unit >= raw * 0.999)
    return [k * step for k in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


@dataclass(slots=True)
class Chart:
    """A chart under construction; marks are clipped to the plot area, places are in the values of the axes."""

    key: str
    title: str
    x: Axis
    y: Axis
    height: int = HEIGHT
    svg: ET.Element = field(init=False)
    plot: ET.Element = field(init=False)

    def __post_init__(self) -> None:
        self.svg = blank(self.title, self.height)
        clip = ET.SubElement(ET.SubElement(self.svg, "defs"), "clipPath", {"id": f"clip-{self.key}"})
        ET.SubElement(clip, "rect", self._area())
        ET.SubElement(self.svg, "rect", {"class": "ground", **self._area()})
        self.plot = ET.SubElement(self.svg, "g", {"clip-path": f"url(#clip-{self.key})"})
        self._axes()

    def at(self, point: Point) -> Point:
        """Viewport units of a point."""
        across = WIDTH - LEFT - RIGHT
        up = self.height - TOP - BOTTOM
        return LEFT + across * self.x.share(point[0]), self.height - BOTTOM - up * self.y.share(point[1])

    def line(self, points: Sequence[Point], style: str) -> None:
        """A curve through points."""
        ET.SubElement(self.plot, "path", {"class": f"curve {style}", "d": path(map(self.at, points))})

    def area(self, points: Sequence[Point], style: str) -> None:
        """A filled polygon."""
        ET.SubElement(self.plot, "path", {"class": style, "d": path(map(self.at, points)) + "Z"})

    def box(self, low: Point, high: Point, style: str) -> ET.Element:
        """A rectangle with sides along the axes."""
        (left, bottom), (right, top) = self.at(low), self.at(high)
        size = {"x": left, "y": top, "width": right - left, "height": bottom - top}
        look = {"class": style} if style else {}
        return ET.SubElement(self.plot, "rect", {**look, **{k: number(v) for k, v in size.items()}})

    def ellipse(self, center: Point, radii: Point, style: str) -> None:
        """An ellipse with half axes along the axes of the chart."""
        (cx, cy), (right, top) = self.at(center), self.at((center[0] + radii[0], center[1] + radii[1]))
        size = {"cx": cx, "cy": cy, "rx": right - cx, "ry": cy - top}
        ET.SubElement(self.plot, "ellipse", {"class": style, **{k: number(v) for k, v in size.items()}})

    def clipped(self, points: Sequence[Point], sides: Point) -> Chart:
        """The same chart, whose marks are cut to the rectangles with these half sides around the points of a curve."""
        name = f"sides-{self.key}"
        clip = ET.SubElement(self.svg, "clipPath", {"id": name})
        pairs = pairwise(points) if len(points) > 1 else [(points[0], points[0])]
        parts = [path(map(self.at, _hexagon(one, other, sides))) + "Z" for one, other in pairs]
        ET.SubElement(clip, "path", {"d": "".join(parts)})
        inner = copy(self)
        inner.plot = ET.SubElement(self.plot, "g", {"clip-path": f"url(#{name})"})
        return inner

    def sweep(self, points: Sequence[Point], turn: tuple[Point, Point], style: str) -> None:
        """The union of ellipses, images of the unit disc under `turn`, around the points of a curve.

        A stroke with round ends is the union of discs; the group turns these into the ellipses.
        """
        (x0, y0), (x1, y1) = self.at((0.0, 0.0)), self.at((1.0, 1.0))
        (a, b), (c, d) = [(value * (x1 - x0)) for value in turn[0]], [value * (y1 - y0) for value in turn[1]]
        size = math.sqrt(abs(a * d - b * c))
        if not 0 < size < math.inf:  # too flat or too large for any drawing
            return
        a, b, c, d = (value / size for value in (a, b, c, d))  # of determinant 1 or -1
        det = a * d - b * c
        flat = [((d * px - b * py) / det, (a * py - c * px) / det) for px, py in map(self.at, points)]
        matrix = " ".join(f"{value:.6g}" for value in (a, c, b, d, 0, 0))
        group = ET.SubElement(self.plot, "g", {"transform": f"matrix({matrix})"})
        if len(flat) == 1:
            circle = {"cx": number(flat[0][0]), "cy": number(flat[0][1]), "r": f"{size:.6g}"}
            ET.SubElement(group, "circle", {"class": style, **circle})
            return
        width = {"stroke-width": f"{2 * size:.6g}"}
        ET.SubElement(group, "path", {"class": f"sweep {style}", "d": path(flat), **width})

    def dot(self, point: Point, style: str, radius: float = 4.5, words: str = "") -> None:
        """A round mark; `words` are shown by a pointer that rests on it."""
        cx, cy = self.at(point)
        place = {"cx": number(cx), "cy": number(cy), "r": number(radius)}
        mark = ET.SubElement(self.svg, "circle", {"class": f"dot {style}", **place})
        if words:
            ET.SubElement(mark, "title").text = words

    def text(self) -> str:
        """The SVG element."""
        return ET.tostring(self.svg, encoding="unicode")

    def _area(self) -> dict[str, str]:
        width, height = WIDTH - LEFT - RIGHT, self.height - TOP - BOTTOM
        return {"x": str(LEFT), "y": str(TOP), "width": str(width), "height": str(height)}

    def _axes(self) -> None:
        bottom = self.height - BOTTOM
        grid = ET.SubElement(self.plot, "g", {"class": "grid"})
        for value in self.x.ticks():
            x = self.at((value, self.y.low))[0]
            ET.SubElement(grid, "path", {"d": path([(x, TOP), (x, bottom)])})
            text(self.svg, (x, bottom + 15), short(value), "tick middle")
        for value in self.y.ticks():
            y = self.at((self.x.low, value))[1]
            ET.SubElement(grid, "path", {"d": path([(LEFT, y), (WIDTH - RIGHT, y)])})
            text(self.svg, (LEFT - 6, y + 4), short(value), "tick end")
        middle = (TOP + bottom) / 2
        text(self.svg, ((LEFT + WIDTH - RIGHT) / 2, self.height - 7), self.x.label, "axis middle")
        place = {"transform": f"translate(12 {number(middle)}) rotate(-90)"}
        text(ET.SubElement(self.svg, "g", place), (0, 0), self.y.label, "axis middle")


def blank(title: str, height: int = HEIGHT) -> ET.Element:
    """An empty drawing with a title for readers that do not see it."""
    attributes = {"viewBox": f"0 0 {WIDTH} {height}", "role": "img", "aria-label": title}
    return ET.Element("svg", attributes)


def text(parent: ET.Element, place: Point, words: str, style: str) -> None:
    """A text whose anchor is at `place`."""
    attributes = {"x": number(place[0]), "y": number(place[1]), "class": style}
    ET.SubElement(parent, "text", attributes).text = words


def path(points: Iterable[Point]) -> str:
    """The data of a path through points."""
    parts = (f"{number(x)} {number(y)}" for x, y in points)
    return "M" + "L".join(parts)


def number(value: float) -> str:
    """A number with two decimals, none that are not needed."""
    text = f"{value:.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _hexagon(one: Point, other: Point, sides: Point) -> list[Point]:
    """The hull of two equal rectangles, always in the same sense of rotation."""
    (x0, y0), (x1, y1), (a, b) = one, other, sides
    if x1 < x0:
        x0, y0, x1, y1 = x1, y1, x0, y0
    first, last = (x0 - a, y0 - b), (x1 + a, y1 + b)
    if y1 >= y0:
        return [first, (x0 + a, y0 - b), (x1 + a, y1 - b), last, (x1 - a, y1 + b), (x0 - a, y0 + b)]
    return [first, (x1 - a, y1 - b), (x1 + a, y1 - b), last, (x0 + a, y0 + b), (x0 - a, y0 + b)]

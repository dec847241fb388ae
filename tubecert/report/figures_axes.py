"""A chart as data: two axes, and marks in the values of these axes; and as SVG that a style sheet colours.

Own SVG and no plotting library: the marks take their colours from the page, for light, dark and print, texts stay
texts, and the same data gives the same bytes everywhere. `xml.etree` writes it, so it is well-formed and escaped
whatever the texts hold. `figures_file` paints the same marks for papers.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal, TypeAlias

import numpy as np

from tubecert.digits import short
from tubecert.enclosure.interval import Array

Point: TypeAlias = tuple[float, float]
Points: TypeAlias = Sequence[Point] | Array
WIDTH, HEIGHT = 400, 270
LEFT, RIGHT, TOP, BOTTOM = 68, 14, 12, 42
_AROUND = 72  # points of an ellipse


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """A range of values, linear or logarithmic, with round ticks; or rows with `names`, from 0 on."""

    label: str
    low: float
    high: float
    log: bool = False
    names: tuple[str, ...] = ()

    @classmethod
    def around(cls, values: Iterable[float], label: str, *, log: bool = False, pad: float = 0.05) -> Axis:
        """The axis that holds all values, with some room on both sides."""
        known = [math.log10(v) if log else v for v in values]
        low, high = min(known), max(known)
        room = pad * (high - low) if high > low else 0.3 if log else 0.1 * abs(high) or 1.0
        low, high = low - room, high + room
        if log:
            low, high = 10.0**low, 10.0**high
        return cls(label=label, low=low, high=high, log=log)

    def share(self, value: float) -> float:
        """Where a value lies: 0 at the low end, 1 at the high end."""
        if self.log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self) -> list[float]:
        """About five round values, or every row."""
        if self.names:
            return [*map(float, range(len(self.names)))]
        return self._decades() if self.log else _steps(self.low, self.high)

    def texts(self) -> list[str]:
        """What stands beside the ticks."""
        return list(self.names) or list(map(short, self.ticks()))

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A curve, a filled shape of several outlines, or dots; `style` is its class in the style sheet.

    `words` say in the legend what it is, `tip` is shown by a pointer that rests on it, `size` is the radius of a dot.
    """

    kind: Literal["line", "area", "dot"]
    parts: list[list[Point]]
    style: str
    words: str = ""
    tip: str = ""
    size: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A figure: marks in their order, places in the values of the axes, and a caption."""

    key: str
    title: str
    x: Axis
    y: Axis
    height: int = HEIGHT
    caption: str = ""
    marks: list[Mark] = field(default_factory=list)

    def line(self, points: Points, style: str, words: str = "") -> None:
        """A curve through points."""
        self.marks.append(Mark(kind="line", parts=_plain([points]), style=style, words=words))

    def area(self, outlines: Sequence[Points], style: str, words: str, tip: str = "") -> None:
        """The union of polygons, all in the same sense of rotation."""
        self.marks.append(Mark(kind="area", parts=_plain(outlines), style=style, words=words, tip=tip))

    def box(self, low: Point, high: Point, style: str, words: str = "", tip: str = "") -> None:
        """A rectangle with sides along the axes."""
        self.area([[low, (high[0], low[1]), high, (low[0], high[1])]], style, words, tip)

    def dot(self, at: Point, style: str, words: str = "", *, tip: str = "", size: float = 4.5) -> None:
        """A round mark, which the ends of the axes do not cut."""
        mark = Mark(kind="dot", parts=_plain([[at]]), style=style, words=words, tip=tip, size=size)
        self.marks.append(mark)

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """What the marks are, each once, with their styles."""
        return tuple(dict.fromkeys((mark.style, mark.words) for mark in self.marks if mark.words))

    @property
    def told(self) -> str:
        """A caption that stands without the page: what is drawn, and what each mark is."""
        shown = ", ".join(words for _, words in self.legend)
        return f"{self.title}{': ' if shown else ''}{shown}. {self.caption}".rstrip()

    @property
    def svg(self) -> str:
        """The drawing, without its title and its legend."""
        return ET.tostring(drawing(self), encoding="unicode")


def _plain(parts: Sequence[Points]) -> list[list[Point]]:
    return [[(float(x), float(y)) for x, y in part] for part in parts]


def drawing(chart: Chart) -> ET.Element:
    """The marks cut to the ground between the axes, dots above all."""
    bottom, right = chart.height - BOTTOM, WIDTH - RIGHT
    view = {"viewBox": f"0 0 {WIDTH} {chart.height}", "role": "img", "aria-label": chart.title}
    svg, clip = ET.Element("svg", view), f"clip-{chart.key}"
    ground = {"x": str(LEFT), "y": str(TOP), "width": str(right - LEFT), "height": str(bottom - TOP)}
    ET.SubElement(ET.SubElement(ET.SubElement(svg, "defs"), "clipPath", {"id": clip}), "rect", ground)
    ET.SubElement(svg, "rect", {"class": "ground", **ground})
    plot = ET.SubElement(svg, "g", {"clip-path": f"url(#{clip})"})

    def at(point: Point) -> Point:
        x, y = (axis.share(value) for axis, value in zip((chart.x, chart.y), point, strict=True))
        return LEFT + (right - LEFT) * x, bottom - (bottom - TOP) * y

    grid = ET.SubElement(plot, "g", {"class": "grid"})
    for value, words in zip(chart.x.ticks(), chart.x.texts(), strict=True):
        x, _ = at((value, chart.y.low))
        ET.SubElement(grid, "path", {"d": path([(x, TOP), (x, bottom)])})
        text(svg, (x, bottom + 15), words, "tick middle")
    for value, words in zip(chart.y.ticks(), chart.y.texts(), strict=True):
        _, y = at((chart.x.low, value))
        ET.SubElement(grid, "path", {"d": path([(LEFT, y), (right, y)])})
        text(svg, (LEFT - 6, y + 4), words, "tick end")
    text(svg, ((LEFT + right) / 2, chart.height - 7), chart.x.label, "axis middle")
    turned = {"transform": f"translate(12 {number((TOP + bottom) / 2)}) rotate(-90)"}
    text(ET.SubElement(svg, "g", turned), (0, 0), chart.y.label, "axis middle")
    for mark in chart.marks:
        parts = [list(map(at, part)) for part in mark.parts]
        if mark.kind == "dot":
            places = {name: number(value) for name, value in zip(("cx", "cy"), parts[0][0], strict=True)}
            look = {"class": f"dot {mark.style}", **places, "r": number(mark.size)}
            shown = ET.SubElement(svg, "circle", look)
        else:
            style, end = (f"curve {mark.style}", "") if mark.kind == "line" else (mark.style, "Z")
            look = {"class": style, "d": "".join(path(part) + end for part in parts)}
            shown = ET.SubElement(plot, "path", look)
        if mark.tip:
            ET.SubElement(shown, "title").text = mark.tip
    return svg


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


# -- shapes, and what one covers that is carried along a curve


def ellipse(shape: Array) -> Array:
    """Points (N, 2) of {y: y' shape^-1 y = 1} for a shape (2, 2); never quite flat, to be seen."""
    values, vectors = np.linalg.eigh(shape)
    axes = vectors * np.sqrt(np.maximum(values, max(1e-12 * float(values[-1]), 1e-300)))
    angle = 2 * np.pi * np.arange(_AROUND) / _AROUND
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes.T
    return np.asarray(around if np.linalg.det(axes) > 0 else around[::-1])


def swept(curve: Array, shape: Array, fine: Array) -> list[Array]:
    """The union of a convex `shape` (N, 2), counterclockwise about the origin, around all points of `curve` (K, 2).

    Out: for every piece of the curve the hull of the shape at both ends; points that are off the line between others by
    less than `fine` (2,) are left out.
    """
    corners = pairwise(_corners(curve / fine))
    return [_hull(shape, curve[one], curve[other]) for one, other in corners]


def _corners(curve: Array) -> list[int]:
    """The points that a curve (K, 2) cannot do without, if one may be off by 1; its ends are among them."""
    kept, end = [0], 1
    while end < len(curve) - 1:
        inner, along = curve[kept[-1] + 1 : end + 1] - curve[kept[-1]], curve[end + 1] - curve[kept[-1]]
        share = np.clip(inner @ along / max(float(along @ along), 1e-300), 0, 1)
        if np.abs(inner - share[:, None] * along).max() > 1:
            kept.append(end)
        end += 1
    return [*kept, len(curve) - 1]


def _hull(shape: Array, one: Array, other: Array) -> Array:
    """The hull of a convex shape at two places: edges that look along the way are at its end, others at its start."""
    edge, way = np.roll(shape, -1, axis=0) - shape, other - one
    ahead = edge[:, 1] * way[0] - edge[:, 0] * way[1] > 0
    ends = np.stack([np.roll(ahead, 1), ahead], axis=1)  # of the edges before and after each corner
    ring = (shape[:, None, :] + one + ends[..., None] * way).reshape(-1, 2)
    return np.asarray(ring[np.any(ring != np.roll(ring, 1, axis=0), axis=1)])

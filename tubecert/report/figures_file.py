"""A figure as files of its own: SVG whose texts are texts, and PDF and PNG for papers, with the looks of the page.

PDF and PNG are painted by matplotlib, which is loaded for them alone: `page.css` says what each class of a mark looks
like, in light colours.
"""

from __future__ import annotations

import io
import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

from tubecert.report.figures_axes import LEFT, WIDTH, Point, number, path, text
from tubecert.report.page import Figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.transforms import Transform

_LINE, _HEAD = 18, 26
_COLUMN: Final = 3.5  # inches: as wide as a column of a paper
_POINTS: Final = 72 * _COLUMN / WIDTH  # of a unit of the viewport
_SIZES: Final = {"tick": 11.0, "small": 9.5}  # of texts, else 12
_ROUND: Final = 48  # corners of a disc that is swept
Look = Mapping[str, str]


def svg_file(*figures: Figure) -> str:
    """The text of the file, with figures below each other; the same figures give the same bytes."""
    return ET.tostring(_whole(figures), encoding="unicode") + "\n"


def painted(ending: str, *figures: Figure) -> bytes:
    """The same as `pdf` or `png`; needs matplotlib."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure as Canvas

    svg = _whole(figures)
    height = _height(svg)
    with rc_context({"pdf.fonttype": 42, "font.family": "DejaVu Sans"}):
        canvas = Canvas(figsize=(_COLUMN, _COLUMN * height / WIDTH))
        FigureCanvasAgg(canvas)
        axes = canvas.add_axes((0, 0, 1, 1), xlim=(0, WIDTH), ylim=(height, 0))
        axes.set_axis_off()
        _paint(axes, list(svg), axes.transData, None)
        data = io.BytesIO()
        dated = {"CreationDate": None} if ending == "pdf" else {"Software": None}
        canvas.savefig(data, format=ending, dpi=300, metadata=dated)
    return data.getvalue()


def _whole(figures: Sequence[Figure]) -> ET.Element:
    """Each drawing below its title and above what its colours mean."""
    svg = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg"})
    ET.SubElement(svg, "style").text = _style()
    ET.SubElement(svg, "desc").text = " ".join(figure.told for figure in figures)
    ET.SubElement(svg, "rect", {"width": "100%", "height": "100%", "style": "fill: var(--page)"})
    top = 0.0
    for figure in figures:
        top = _add(svg, figure, top)
    size = {"viewBox": f"0 0 {WIDTH} {number(top)}", "width": str(2 * WIDTH), "height": number(2 * top)}
    svg.attrib.update(size)
    return svg


def _add(svg: ET.Element, figure: Figure, top: float) -> float:
    """A figure from `top` on; where it ends."""
    inner = ET.fromstring(figure.svg)  # noqa: S314 - our own, made by `figures_axes`
    height = _height(inner)
    text(svg, (WIDTH / 2, top + 17), figure.title, "middle")
    inner.attrib.update({"y": number(top + _HEAD), "width": str(WIDTH), "height": number(height)})
    svg.append(inner)
    below = top + _HEAD + height
    for index, (style, words) in enumerate(figure.legend):
        y = below + _LINE * index + 8
        ET.SubElement(svg, "path", {"class": f"key {style}", "d": path([(LEFT, y), (LEFT + 20, y)])})
        text(svg, (LEFT + 28, y + 4), words, "tick")
    return below + _LINE * len(figure.legend) + 10


@cache
def _style() -> str:
    return (files("tubecert.report") / "templates" / "page.css").read_text(encoding="utf-8")


def _height(svg: ET.Element) -> float:
    return float(svg.attrib["viewBox"].split()[3])


# -- what a mark looks like


@cache
def _rules() -> tuple[tuple[frozenset[str], Look], ...]:
    """The rules of the style sheet that are about classes of marks, with the light colours, in their order."""
    css = re.sub(r"/\*.*?\*/|@media[^{]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}", "", _style(), flags=re.DOTALL)
    colors = dict(re.findall(r"--([\w-]+): (#\w+)", css))
    found = []
    for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", css):
        filled = re.sub(r"var\(--([\w-]+)\)", lambda match: colors[match[1]], body)
        look = {key.strip(): value.strip() for key, value in re.findall(r"([\w-]+):([^;]+)", filled)}
        names = (
            re.fullmatch(r"\s*(?:svg )?((?:\.[\w-]+)+)(?: path)?\s*", one) for one in selectors.split(",")
        )
        found += [(frozenset(name[1][1:].split(".")), look) for name in names if name]
    return tuple(found)


def _look(item: ET.Element, inherited: str) -> Look:
    classes = {*item.get("class", inherited).split()}
    look = {key: value for names, rule in _rules() if names <= classes for key, value in rule.items()}
    return look | {key: item.attrib[key] for key in ("fill", "stroke-width") if key in item.attrib}


# -- painting


def _paint(axes: Axes, items: Sequence[ET.Element], at: Transform, clip: Any, style: str = "") -> None:
    """Marks in their order; `at` places them, `clip` cuts them, `style` is the class of the group around them."""
    from matplotlib.transforms import Affine2D

    clips = {found.get("id", ""): found for item in items for found in item.iter("clipPath")}
    for item in items:
        match item.tag:
            case "svg":
                _paint(axes, list(item), Affine2D().translate(0, *_numbers(item, "y")) + at, clip)
            case "g":
                known = re.search(r"#([^)]+)", item.get("clip-path", ""))
                shape = clips.get(known[1]) if known else None
                cut = clip if shape is None else (_outline(shape[0]), at)
                inner = [*clips.values(), *item]
                _paint(axes, inner, Affine2D(_matrix(item)) + at, cut, item.get("class", ""))
            case "text":
                _write(axes, item, at)
            case "rect" | "path" | "circle" | "ellipse" if item.get("width") != "100%":
                _draw(axes, item, at, clip, _look(item, style))


def _matrix(item: ET.Element) -> list[list[float]]:
    told = item.get("transform", "")
    numbers = [float(value) for value in re.findall(r"-?[\d.]+(?:e[-+]?\d+)?", told)]
    if told.startswith("matrix"):
        a, b, c, d, e, f = numbers
    elif told.startswith("translate"):  # and turned by a right angle
        a, b, c, d, (e, f) = 0.0, -1.0, 1.0, 0.0, numbers[:2]
    else:
        a, b, c, d, e, f = 1.0, 0.0, 0.0, 1.0, 0.0, 0.0
    return [[a, c, e], [b, d, f], [0.0, 0.0, 1.0]]


def _numbers(item: ET.Element, *names: str) -> list[float]:
    """Attributes that are numbers; one that is not there is 0."""
    return [float(item.get(name, 0)) for name in names]


def _outline(item: ET.Element) -> Any:
    """The path of a shape."""
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    if item.tag == "rect":
        scaled = Affine2D().scale(*_numbers(item, "width", "height"))
        return Path.unit_rectangle().transformed(scaled.translate(*_numbers(item, "x", "y")))
    if item.tag in ("circle", "ellipse"):
        scaled = Affine2D().scale(*_numbers(item, *(("r", "r") if item.tag == "circle" else ("rx", "ry"))))
        return Path.unit_circle().transformed(scaled.translate(*_numbers(item, "cx", "cy")))
    parts = [Path(points, closed=closed) for points, closed in _parts(item.get("d", ""))]
    return Path.make_compound_path(*parts)


def _parts(d: str) -> Iterator[tuple[list[Point], bool]]:
    for part in d.split("M")[1:]:
        points = [(float(x), float(y)) for x, y in (pair.split() for pair in part.rstrip("Z").split("L"))]
        closed = part.endswith("Z")
        yield ([*points, points[0]] if closed else points), closed


def _swept(item: ET.Element, radius: float) -> Any:
    """The discs of a radius around the points of a curve, which a thick stroke with round ends is."""
    from matplotlib.path import Path

    ((points, _),) = _parts(item.get("d", ""))
    turns = [2 * math.pi * k / _ROUND for k in range(_ROUND + 1)]
    disc = [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
    shapes = [[(x + a, y + b) for a, b in disc] for x, y in points]
    for (x0, y0), (x1, y1) in pairwise(points):
        long = math.hypot(x1 - x0, y1 - y0) or 1.0
        a, b = radius * (y1 - y0) / long, -radius * (x1 - x0) / long
        shapes.append(
            [(x0 + a, y0 + b), (x1 + a, y1 + b), (x1 - a, y1 - b), (x0 - a, y0 - b), (x0 + a, y0 + b)]
        )
    return Path.make_compound_path(*(Path(shape, closed=True) for shape in shapes))


def _draw(axes: Axes, item: ET.Element, at: Transform, clip: Any, look: Look) -> None:
    from matplotlib.patches import PathPatch

    width = float(look.get("stroke-width", 1))
    swept = "sweep" in item.get("class", "") and item.tag == "path"
    fill, stroke = (look.get(name, "none") for name in ("fill", "stroke"))
    fill, stroke = (stroke, "none") if swept else (fill, stroke)
    dashes = [float(part) for part in re.findall(r"[\d.]+", look.get("stroke-dasharray", ""))]
    patch = PathPatch(
        _swept(item, width / 2) if swept else _outline(item),
        facecolor=fill,
        edgecolor=stroke,
        linewidth=width * _POINTS if stroke != "none" else 0,
        linestyle=(0, [part * _POINTS / (width * _POINTS) for part in dashes]) if dashes else "-",
        capstyle="round" if look.get("stroke-linecap") == "round" else "butt",
        alpha=float(look.get("opacity", 1)),
        transform=at,
    )
    axes.add_patch(patch)
    if clip is not None:
        patch.set_clip_path(*clip)


def _write(axes: Axes, item: ET.Element, at: Transform) -> None:
    classes, (x, y) = item.get("class", "").split(), _numbers(item, "x", "y")
    size = next((size for name, size in _SIZES.items() if name in classes), 12.0)
    turned = at.transform([(0, 0), (1, 0)])
    angle = math.degrees(math.atan2(*(turned[1] - turned[0])[::-1]))
    axes.text(
        x,
        y,
        (item.text or "").replace("$", r"\$"),
        fontsize=size * _POINTS,
        ha="center" if "middle" in classes else "right" if "end" in classes else "left",
        va="baseline",
        rotation=angle,
        rotation_mode="anchor",
        color=_look(item, "").get("fill", "#1b1f24"),
        transform=at,
    )

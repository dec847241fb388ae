"""A figure as files of its own: SVG whose texts are texts, and PDF and PNG for papers, with the looks of the page.

PDF and PNG are painted by matplotlib, which is loaded for them alone: `page.css` says what each class of a mark looks
like, in light colours.
"""

from __future__ import annotations

import io
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from tubecert.report.figures_axes import LEFT, WIDTH, Chart, Mark, drawing, number, path, text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LINE, _HEAD = 18, 26
_COLUMN: Final = 3.5  # inches: as wide as a column of a paper
_POINTS: Final = 72 * _COLUMN / WIDTH  # of a unit of the viewport
_LOOKS: Final[Any] = {
    "pdf.fonttype": 42,
    "font.family": "DejaVu Sans",
    "font.size": 11 * _POINTS,
    "axes.titlesize": 12 * _POINTS,
    "axes.edgecolor": "#d5dae0",
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e4e8ec",
    "grid.linewidth": _POINTS,
    **{f"{axis}tick.{key}.size": 0 for axis in "xy" for key in ("major", "minor")},
    **{f"{axis}tick.labelcolor": "#57606a" for axis in "xy"},
    "legend.frameon": False,
}
Look = Mapping[str, str]


def svg_file(*charts: Chart) -> str:
    """The text of the file, with figures below each other; the same figures give the same bytes."""
    svg = ET.Element("svg", {"xmlns": "http://www.w3.org/2000/svg"})
    ET.SubElement(svg, "style").text = _style()
    ET.SubElement(svg, "desc").text = " ".join(chart.told for chart in charts)
    ET.SubElement(svg, "rect", {"width": "100%", "height": "100%", "style": "fill: var(--page)"})
    top = 0.0
    for chart in charts:
        top = _add(svg, chart, top)
    size = {"viewBox": f"0 0 {WIDTH} {number(top)}", "width": str(2 * WIDTH), "height": number(2 * top)}
    svg.attrib.update(size)
    return ET.tostring(svg, encoding="unicode") + "\n"


def _add(svg: ET.Element, chart: Chart, top: float) -> float:
    """A figure from `top` on, below its title and above what its marks are; where it ends."""
    text(svg, (WIDTH / 2, top + 17), chart.title, "middle")
    inner, below = drawing(chart), top + _HEAD + chart.height
    inner.attrib.update({"y": number(top + _HEAD), "width": str(WIDTH), "height": str(chart.height)})
    svg.append(inner)
    for index, (style, words) in enumerate(chart.legend):
        y = below + _LINE * index + 8
        ET.SubElement(svg, "path", {"class": f"key {style}", "d": path([(LEFT, y), (LEFT + 20, y)])})
        text(svg, (LEFT + 28, y + 4), words, "tick")
    return below + _LINE * len(chart.legend) + 10


@cache
def _style() -> str:
    return (files("tubecert.report") / "templates" / "page.css").read_text(encoding="utf-8")


# -- with matplotlib


def painted(ending: str, chart: Chart) -> bytes:
    """The figure as `pdf` or `png`; needs matplotlib."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with rc_context(_LOOKS):
        units = _HEAD + chart.height + _LINE * len(chart.legend)
        figure = Figure(figsize=(_COLUMN, units * _POINTS / 72), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        paint(axes, chart)
        axes.set_title(_plain(chart.title))
        figure.legend(loc="outside lower left")
        data = io.BytesIO()
        dated = {"CreationDate": None} if ending == "pdf" else {"Software": None}
        figure.savefig(data, format=ending, dpi=300, metadata=dated)
    return data.getvalue()


def paint(axes: Axes, chart: Chart) -> None:
    """Axes and marks of a chart, into axes of matplotlib; what a legend may say are their labels."""
    for name, own in (("x", chart.x), ("y", chart.y)):
        scale, label = "log" if own.log else "linear", _plain(own.label)
        axes.set(**{f"{name}scale": scale, f"{name}lim": (own.low, own.high), f"{name}label": label})
        if own.log or own.names:
            getattr(axes, f"set_{name}ticks")(own.ticks(), labels=list(map(_plain, own.texts())))
            getattr(axes, f"set_{name}ticks")([], minor=True)
    known = set[str]()
    for mark in chart.marks:
        _paint(axes, mark, _plain(mark.words) if mark.words and mark.words not in known else "_")
        known.add(mark.words)


def _paint(axes: Axes, mark: Mark, label: str) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    look = _look(mark)
    fill, stroke = look.get("fill", "none"), look.get("stroke", "none")
    width = float(look.get("stroke-width", 1)) * _POINTS
    dashes = [
        float(part) * _POINTS / width for part in re.findall(r"[\d.]+", look.get("stroke-dasharray", ""))
    ]
    if mark.kind == "area":
        shape = Path.make_compound_path(*(Path([*part, part[0]], closed=True) for part in mark.parts))
        lines, alpha = width if stroke != "none" else 0, float(look.get("opacity", 1))
        axes.add_patch(PathPatch(shape, fc=fill, ec=stroke, lw=lines, alpha=alpha, label=label))
        return
    x, y = zip(*mark.parts[0], strict=True)
    if mark.kind == "line":
        axes.plot(x, y, color=stroke, lw=width, ls=(0, dashes) if dashes else "-", label=label, zorder=1)
        return
    size = 2 * mark.size * _POINTS
    axes.plot(x, y, "o", c=fill, mec=stroke, mew=width, ms=size, label=label, clip_on=False, zorder=4)


def _plain(words: str) -> str:
    """A text in which matplotlib finds no formula."""
    return words.replace("$", r"\$")


@cache
def _rules() -> tuple[tuple[frozenset[str], Look], ...]:
    """The rules of the style sheet that are about classes of marks, with the light colours, in their order."""
    css = re.sub(r"/\*.*?\*/|@media[^{]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}", "", _style(), flags=re.DOTALL)
    colors = dict(re.findall(r"--([\w-]+): (#\w+)", css))
    found = []
    for selectors, body in re.findall(r"([^{}]+)\{([^{}]*)\}", css):
        filled = re.sub(r"var\(--([\w-]+)\)", lambda match: colors[match[1]], body)
        look = {key.strip(): value.strip() for key, value in re.findall(r"([\w-]+):([^;]+)", filled)}
        names = (re.fullmatch(r"\s*((?:\.[\w-]+)+)\s*", one) for one in selectors.split(","))
        found += [(frozenset(name[1][1:].split(".")), look) for name in names if name]
    return tuple(found)


def _look(mark: Mark) -> Look:
    classes = {*mark.style.split(), {"line": "curve", "dot": "dot", "area": ""}[mark.kind]}
    return {key: value for names, rule in _rules() if names <= classes for key, value in rule.items()}

"""A figure as a file of its own: SVG with its style sheet, its title and what its colours mean."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import cache
from importlib.resources import files

from tubecert.report.figures_axes import LEFT, WIDTH, number, path, text
from tubecert.report.page import Figure

_LINE = 18
_HEAD = 26
_VIEW = "viewBox"


def svg_file(figure: Figure) -> str:
    """The text of the file; the same figure gives the same bytes."""
    inner = ET.fromstring(figure.svg)  # noqa: S314 - our own, made by `figures_axes`
    height = float(inner.attrib[_VIEW].split()[3])
    whole = _HEAD + height + _LINE * len(figure.legend) + 10
    svg = ET.Element(
        "svg",
        {
            "xmlns": "http://www.w3.org/2000/svg",
            "viewBox": f"0 0 {WIDTH} {number(whole)}",
            "width": str(2 * WIDTH),
            "height": number(2 * whole),
        },
    )
    ET.SubElement(svg, "style").text = _style()
    ET.SubElement(svg, "rect", {"width": "100%", "height": "100%", "style": "fill: var(--page)"})
    text(svg, (WIDTH / 2, 17), figure.title, "middle")
    inner.attrib.update({"y": str(_HEAD), "width": str(WIDTH), "height": number(height)})
    svg.append(inner)
    for index, (style, words) in enumerate(figure.legend):
        y = _HEAD + height + _LINE * index + 8
        ET.SubElement(svg, "path", {"class": f"key {style}", "d": path([(LEFT, y), (LEFT + 20, y)])})
        text(svg, (LEFT + 28, y + 4), words, "tick")
    return ET.tostring(svg, encoding="unicode") + "\n"


@cache
def _style() -> str:
    return (files("tubecert.report") / "templates" / "page.css").read_text(encoding="utf-8")

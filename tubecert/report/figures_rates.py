"""The metrics that a synthesis compared, drawn over the rate (SVG)."""

from __future__ import annotations

from collections.abc import Sequence
from io import StringIO

from tubecert.certificate.result import MetricRow

_PANELS = (
    ("condition_number", "condition number"),
    ("input_gain", "beta / sqrt(a)"),
    ("adaptation_rate", "least Gamma (B)"),
)
_FLOORS = {
    "identity": ("least condition number", "#0072b2", "o"),
    "input": ("least input gain", "#d55e00", "s"),
}


def draw(rows: Sequence[MetricRow]) -> str:
    """An SVG with one panel a quantity that any of the rows has; the same rows give the same bytes."""
    import matplotlib as mpl
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    panels = [(key, label) for key, label in _PANELS if any(getattr(row, key) is not None for row in rows)]
    with mpl.rc_context({"svg.hashsalt": "tubecert", "svg.fonttype": "none", "font.size": 9}):
        figure = Figure(figsize=(5.5, 0.6 + 2.0 * len(panels)), layout="constrained")
        FigureCanvasSVG(figure)
        for index, (key, label) in enumerate(panels, start=1):
            axes = figure.add_subplot(len(panels), 1, index)
            for floor, (words, color, marker) in _FLOORS.items():
                points = sorted(
                    (float(row.rate), getattr(row, key))
                    for row in rows
                    if row.floor == floor and getattr(row, key) is not None
                )
                if points:
                    axes.plot(
                        *zip(*points, strict=True), color=color, marker=marker, ms=4, lw=1.2, label=words
                    )
            axes.set_yscale("log")
            axes.set_ylabel(label)
            axes.grid(visible=True, which="both", lw=0.3, color="#bbbbbb")
            if index == 1:
                axes.legend(frameon=False)
            if index == len(panels):
                axes.set_xlabel("rate lambda in 1/s")
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()

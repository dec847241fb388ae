"""What the figures of a campaign have in common: colours, names, labels, legends.

Colours are those of Okabe and Ito, told apart by everybody; what is certified is orange, the plan is dashed black.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, TypedDict

from tubecert.digits import near

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tubecert.simulate.campaign import Campaign, Drawn
    from tubecert.spec import Spec

COLORS: Final = {
    "l1": "#0072B2",
    "ccm": "#D55E00",
    "reference": "#CC79A7",
    "nominal": "#7F7F7F",
}
TUBE: Final = "#E69F00"
NAMES: Final = {
    "l1": "L1 adaptive",
    "ccm": "CCM alone",
    "reference": "reference system",
    "nominal": "CCM, no uncertainty",
}
STYLE: Final[Any] = {
    "svg.hashsalt": "tubecert",
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.grid": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "savefig.dpi": 150,
}


def blank(width: float, height: float) -> Figure:
    """An empty figure, in inches."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


class LineStyle(TypedDict):
    """What matplotlib is told of a curve."""

    color: str
    ls: str | tuple[int, tuple[float, float]]
    label: str


def line(item: Drawn) -> LineStyle:
    """How the curves of a loop are drawn: dashed for one whose promise is not tested."""
    controller = item.loop.controller
    style = "-" if item.loop.tested or controller in ("nominal", "reference") else (0, (6, 1.5))
    return {"color": COLORS[controller], "ls": style, "label": NAMES[controller]}


def labelled(spec: Spec, name: str, words: str = "") -> str:
    """A state or input, or `words` about it, with its unit, as far as the specification tells."""
    unit = dict(spec.units).get(name)
    return f"{words or name} [{unit}]" if unit else words or name


def title(campaign: Campaign) -> str:
    """What a figure is about."""
    setting = campaign.setting
    return f"{setting.spec.name}: rho = {near(setting.rho, 4)}, uncertainty {campaign.uncertainty}"


def finish(figure: Figure, bottom: Axes, legend: Axes, campaign: Campaign) -> None:
    """Time on the axes at the bottom, the title over those whose labels become the legend."""
    bottom.set_xlabel("t [s]")
    bottom.set_xlim(0, campaign.setting.horizon)
    titled(figure, legend, title(campaign), 3)


def titled(figure: Figure, axis: Axes, words: str, columns: int) -> None:
    """A title, and the labels of an axis as the legend."""
    axis.set_title(words, fontsize=9, loc="left")
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)

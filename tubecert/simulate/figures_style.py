"""What the figures of a campaign have in common: names, lines, the title."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, TypedDict

from tubecert.campaigns.figures import COLORS, titled
from tubecert.digits import near
from tubecert.simulate.campaign import Campaign, Drawn

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES: Final = {
    "l1": "L1 adaptive",
    "ccm": "CCM alone",
    "reference": "reference system",
    "nominal": "CCM, no uncertainty",
}


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


def title(campaign: Campaign) -> str:
    """What a figure is about."""
    setting = campaign.setting
    return f"{setting.spec.name}: rho = {near(setting.rho, 4)}, uncertainty {campaign.uncertainty}"


def finish(figure: Figure, bottom: Axes, legend: Axes, campaign: Campaign) -> None:
    """Time on the axes at the bottom, the title over those whose labels become the legend."""
    bottom.set_xlabel("t [s]")
    bottom.set_xlim(0, campaign.setting.horizon)
    titled(figure, legend, title(campaign), 3)

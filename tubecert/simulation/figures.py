"""What the figures of all campaigns have in common: colours, labels, legends, obstacles; a figure as files.

Colours are those of Okabe and Ito, told apart by everybody; what is certified is orange, the plan is dashed black.
Trusted: no.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeVar

from tubecert.enclosure.interval import Array
from tubecert.simulation.obstacles import corners_of
from tubecert.spec import Spec

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

C = TypeVar("C")
COLORS: Final = {
    "l1": "#0072B2",
    "ccm": "#D55E00",
    "reference": "#CC79A7",
    "nominal": "#7F7F7F",
}
TUBE: Final = "#E69F00"
LIGHT: Final = "#FBE3B5"  # of a tube, opaque: overlapping shapes must not darken each other
STYLE: Final[Any] = {
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


def labelled(spec: Spec, name: str, words: str = "") -> str:
    """A state or input, or `words` about it, with its unit, as far as the specification tells."""
    unit = dict(spec.units).get(name)
    return f"{words or name} [{unit}]" if unit else words or name


def names_of(spec: Spec) -> tuple[str, str] | None:
    """The states of the plane that is drawn: those asked for, else those of an obstacle, else the first two."""
    if spec.simulation and spec.simulation.plane:
        return spec.simulation.plane
    if spec.obstacles:
        return spec.obstacles[0].states
    return (spec.states[0], spec.states[1]) if len(spec.states) > 1 else None


def plane(
    spec: Spec, names: tuple[str, str], shapes: Sequence[Array], plan: Array | None
) -> tuple[Figure, Axes]:
    """A plane of two states with cross-sections (K, 2) of the tube, the plan (K, 2), if there is one, and obstacles."""
    from matplotlib.collections import PolyCollection

    figure = blank(6.4, 5.6)
    axis = figure.subplots()
    if plan is not None:
        tube = PolyCollection(shapes, facecolors=LIGHT, edgecolors="none", zorder=1, label="tube")
        axis.add_collection(tube)
        axis.plot(*plan.T, color="black", lw=1.0, ls="--", zorder=5, label="plan")
    _obstacles(axis, spec, names)
    axis.set_xlabel(labelled(spec, names[0]))
    axis.set_ylabel(labelled(spec, names[1]))
    return figure, axis


def _obstacles(axis: Axes, spec: Spec, names: tuple[str, str]) -> None:
    """The obstacles in a plane."""
    from matplotlib.patches import Circle, Patch, Polygon

    label: str | None = "obstacle"
    for obstacle in (each for each in spec.obstacles if set(each.states) == set(names)):
        order = [obstacle.states.index(name) for name in names]
        patch: Patch
        if obstacle.radius is None:
            patch = Polygon(corners_of(obstacle)[:, order], closed=True)
        else:
            x, y = (float(obstacle.center[i]) for i in order)
            patch = Circle((x, y), float(obstacle.radius))
        patch.set(facecolor="#BDBDBD", edgecolor="#6E6E6E", zorder=2, label=label)
        axis.add_patch(patch)
        label = None


def titled(figure: Figure, axis: Axes, words: str, columns: int) -> None:
    """A title, and the labels of an axis as the legend."""
    axis.set_title(words, fontsize=9, loc="left")
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns)


def drawn(drawers: Mapping[str, Callable[[C], Figure | None]], name: str, campaign: C) -> Figure | None:
    """A figure by its name; None if there is nothing to draw. Raises `KeyError` for a name that is none."""
    import matplotlib as mpl

    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    with mpl.rc_context(STYLE):
        return drawers[name](campaign)


def images(drawers: Mapping[str, Callable[[C], Figure | None]], campaign: C) -> Iterator[tuple[str, bytes]]:
    """File names and contents, one figure after the other; the same bytes for the same data."""
    import matplotlib as mpl

    for name in drawers:
        if (figure := drawn(drawers, name, campaign)) is not None:
            buffer = io.BytesIO()
            with mpl.rc_context(STYLE):
                figure.savefig(buffer, format="png", metadata={"Software": None})
            yield f"{name}.png", buffer.getvalue()

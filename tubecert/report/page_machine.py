"""The machine of certificate H on the page: what it is, and what is proven for it."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.certificate.result import Result
from tubecert.digits import percent, up
from tubecert.kinds.hardware import HardwareData
from tubecert.report.figures_axes import Axis, Chart
from tubecert.report.machine import (
    along,
    bandwidth,
    between,
    clip,
    described,
    half_widths,
    inputs,
    section_of,
    start_share,
)
from tubecert.report.page import Block, Cell, Facts, Figure, Figures, Table
from tubecert.verdict import Verdict

STYLE = "h"  # as in the figures of the gains


def _radius(result: Result, own: HardwareData) -> str:
    """The radius in x; in coordinates of the tube it is a length there, which is no bound of |x - x*|."""
    measured = result.tube is not None and result.tube.coordinates is not None
    return "" if measured else f"; radius {up(own.radius)}"


def _windows(result: Result, own: HardwareData) -> Iterator[Block]:
    """The tube along the plan, drawn and by window; nothing for one width."""
    known = [(w, w.radius) for w in own.windows if w.radius is not None]
    if not known:
        return
    path = [(float(t), radius) for w, radius in known for t in (w.begin, w.end)]
    x = Axis.around([t for t, _ in path], "time (s)", pad=0.0)
    chart = Chart("along", "The tube along the plan", x, Axis.around([0.0, *(r for _, r in path)], "radius"))
    chart.line(path, STYLE)
    yield Figures(
        figures=(
            Figure(
                key="along",
                title="The tube along the plan",
                svg=chart.text(),
                legend=((STYLE, "|x - x*| is proven to stay below"),),
                caption="Each window has constants and a level of its own.",
            ),
        )
    )
    yield Table(
        columns=("time", "radius", "half-widths", "inputs"),
        rows=tuple(
            (
                Cell(text=between(w)),
                Cell(text=up(radius), kind="number"),
                Cell(text=half_widths(result, w)),
                Cell(text=inputs(result, w)),
            )
            for w, radius in known
        ),
        note="What is proven in each window; the facts above are the widest of them.",
    )


def machine_blocks(result: Result) -> Iterator[Block]:
    """Facts about the machine; empty without certificate H."""
    own = section_of(result)
    if own is None or own.sample_time is None:
        return
    facts = [("the machine", Cell(text=described(result, own)))]
    if own.verdict is Verdict.CERTIFIED:
        facts += [
            ("proven tube", Cell(text=half_widths(result, own) + _radius(result, own))),
            *([("along the plan", Cell(text=told))] if (told := along(own)) is not None else []),
            ("inputs", Cell(text=inputs(result, own))),
            ("filter", Cell(text=bandwidth(own))),
            ("the estimate is clipped to", Cell(text=clip(result, own))),
        ]
        if (start := start_share(result, own)) is not None:
            facts.append(("the start", Cell(text=f"{percent(start)} of the proven tube")))
    yield Facts(facts=tuple(facts))
    yield from _windows(result, own)

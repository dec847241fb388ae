"""The machine of certificate H on the page: what it is, and what is proven for it."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.certificate.result import Result
from tubecert.digits import percent, up
from tubecert.kinds.hardware import HardwareData
from tubecert.report import windows
from tubecert.report.machine import (
    bandwidth,
    clip,
    described,
    half_widths,
    inputs,
    section_of,
    start_share,
)
from tubecert.report.page import Block, Cell, Facts
from tubecert.verdict import Verdict


def _radius(result: Result, own: HardwareData) -> str:
    """The radius in x; in coordinates of the tube it is a length there, which is no bound of |x - x*|."""
    measured = result.tube is not None and result.tube.coordinates is not None
    return "" if measured else f"; radius {up(own.radius)}"


def machine_blocks(result: Result) -> Iterator[Block]:
    """Facts about the machine; empty without certificate H."""
    own = section_of(result)
    if own is None or own.sample_time is None:
        return
    facts = [("the machine", Cell(text=described(result, own)))]
    if own.verdict is Verdict.CERTIFIED:
        facts += [
            ("proven tube", Cell(text=half_widths(result, own) + _radius(result, own))),
            *(
                [("along the plan", Cell(text=told))]
                if (told := windows.along(own.windows)) is not None
                else []
            ),
            ("inputs", Cell(text=inputs(result, own))),
            ("filter", Cell(text=bandwidth(own))),
            ("the estimate is clipped to", Cell(text=clip(result, own))),
        ]
        if (start := start_share(result, own)) is not None:
            facts.append(("the start", Cell(text=f"{percent(start)} of the proven tube")))
    yield Facts(facts=tuple(facts))
    yield from windows.blocks(result, windows.windows_of(own), "along")

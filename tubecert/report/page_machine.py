"""The machine of certificate H on the page: what it is, what is proven for it, and what fills its tube."""

from __future__ import annotations

from collections.abc import Iterator

from tubecert.certificate.result import Result
from tubecert.kinds.hardware import HardwareData
from tubecert.report.machine import (
    bandwidth,
    clip,
    described,
    half_widths,
    inputs,
    section_of,
    shares,
    start_share,
)
from tubecert.report.numbers import percent, up
from tubecert.report.page import Block, Cell, Facts, Table
from tubecert.verdict import Verdict


def _radius(result: Result, own: HardwareData) -> str:
    """The radius in x; in coordinates of the tube it is a length there, which is no bound of |x - x*|."""
    measured = result.tube is not None and result.tube.coordinates is not None
    return "" if measured else f"; radius {up(own.radius)}"


def machine_blocks(result: Result) -> Iterator[Block]:
    """Facts about the machine, and the shares of its tube by cause; empty without certificate H."""
    own = section_of(result)
    if own is None or own.sample_time is None:
        return
    facts = [("the machine", Cell(text=described(result, own)))]
    if own.verdict is Verdict.CERTIFIED:
        facts += [
            ("proven tube", Cell(text=half_widths(result, own) + _radius(result, own))),
            ("inputs", Cell(text=inputs(result, own))),
            ("filter", Cell(text=bandwidth(own))),
            ("the estimate is clipped to", Cell(text=clip(result, own))),
        ]
        if (start := start_share(result, own)) is not None:
            facts.append(("the start", Cell(text=f"{percent(start)} of the proven tube")))
    yield Facts(facts=tuple(facts))
    if own.budget is None:
        return
    yield Table(
        columns=("what fills the tube", "share"),
        rows=tuple(
            (Cell(text=each.cause), Cell(text=percent(each.share), kind="number", share=min(1.0, each.share)))
            for each in shares(own.budget)
        ),
        note="Shares of what the contraction can make good at the edge of the proven tube. Better hardware helps where "
        "the share is large.",
    )

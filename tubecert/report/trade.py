"""What a tube asks of a machine, in words, as a table and as a figure, and as data for programs."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from fractions import Fraction
from io import StringIO
from typing import TYPE_CHECKING, Final

from rich.text import Text

from tubecert.claims.advice import HardwarePart
from tubecert.digits import down, exact, up
from tubecert.records import Json
from tubecert.report import reach, sections
from tubecert.report.console import verdict_line
from tubecert.report.cut import cut_short
from tubecert.report.figures_axes import Axis, Chart
from tubecert.report.figures_file import svg_file
from tubecert.report.gains import NAMES, rows
from tubecert.report.layout import plain_table, titled
from tubecert.report.page import Figure
from tubecert.words.advice import advice
from tubecert.words.claims import sentence

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.certificate.result import Result
    from tubecert.pipeline.trade import Cheapest, Front, Offer
    from tubecert.spec import Spec

_LABELS: Final[Mapping[HardwarePart, str]] = {
    "sample_time": "lowest rate",
    "delay": "largest delay",
    "noise": "largest noise",
    "wind": "largest wind",
}
_AXES: Final[Mapping[HardwarePart, str]] = {
    "sample_time": "rate in Hz",
    "delay": "delay in s",
    "noise": "noise",
    "wind": "wind",
}


def _value(part: HardwarePart, value: Fraction | None) -> str:
    """A value as the specification says it: the rate in Hz, rounded up."""
    if value is None:
        return "none"
    if part == "sample_time":
        return f"{up(1 / value, 5)} Hz ({exact(1000 * value)} ms)"
    return f"{exact(1000 * value)} ms" if part == "delay" else exact(value)


# -- one tube


def offers_summary(spec: Spec, found: Sequence[Offer]) -> Text:
    """What the cheapest machine is."""
    values = ", ".join(f"{_LABELS[each.part]} {_value(each.part, each.value)}" for each in found)
    return Text(f"{spec.name}: {values}, each alone", style="bold")


def offers(spec: Spec, cheapest: Cheapest, files: Mapping[HardwarePart, str]) -> list[RenderableType]:
    """What each part of the machine may be at most, and the gains of every certificate in this tube."""
    found = cheapest.offers
    parts: list[RenderableType] = [offers_summary(spec, found)]
    table = plain_table("what", ">alone", "certificate", "what stops it", wrapped=3)
    for each in found:
        stops = "" if each.value is not None else _stops(each.result)
        table.add_row(_LABELS[each.part], _value(each.part, each.value), files.get(each.part, ""), stops)
    others = "each with all other numbers of the machine as the specification has them"
    parts += titled("Cheapest machine", [table, Text(f"{others}.", style="dim")])
    first = found[0].result
    if first.tube is not None:
        parts += titled("Tube", [Text(reach.extent(first))])
    parts += titled("Certificates in this tube", [_kinds(first)])
    return parts + ([] if cheapest.cut is None else cut_short(cheapest.cut))


def _stops(result: Result) -> str:
    """What is against it, with what would help."""
    reason = result.reason
    if reason is None:
        return ""
    helps = advice(reason.relax, result.spec.effective.uncertainty.h)
    return sentence(reason) + (f"; {helps}" if helps else "")


def _kinds(result: Result) -> RenderableType:
    """Every kind's gains; H is at the lowest rate."""
    table = plain_table("certificate", "gains", "verdict", ">omega", ">Gamma", ">Ts")
    for row in rows(result):
        numbers = (exact(x) if x is not None else "" for x in sections.gain_columns(row))
        verdict = Text(row.verdict, style=sections.VERDICTS[row.verdict])
        table.add_row(NAMES[row.section], row.which, verdict, *numbers)
    return table


def offers_data(found: Sequence[Offer], files: Mapping[HardwarePart, str]) -> Json:
    """Every part, for programs."""
    return [
        {
            "part": each.part,
            "largest": None if each.value is None else str(each.value),
            "verdict": str(each.result.verdict),
            "certificate": files.get(each.part),
            "reason": None if each.result.reason is None else each.result.reason.claim.tag,
        }
        for each in found
    ]


# -- tubes of many sizes


def front_summary(spec: Spec, found: Front, part: HardwarePart) -> Text:
    """How many tubes are on the front."""
    if not found.best:
        return verdict_line(found.points[0].offer.result)
    count, tried = len(found.best), len(found.points)
    return Text(
        f"{spec.name}: {_AXES[part]} against the tube: {count} of {tried} sizes that were tried", style="bold"
    )


def front(
    spec: Spec, found: Front, part: HardwarePart, files: Mapping[Fraction, str], stem: str
) -> list[RenderableType]:
    """The front, narrow tubes first."""
    parts: list[RenderableType] = [front_summary(spec, found, part)]
    table = plain_table(">scale", ">proven size", f">{_LABELS[part]}", "certificate")
    for each in found.best:
        table.add_row(
            exact(each.scale), up(each.size), _value(part, each.offer.value), files.get(each.scale, "")
        )
    covered = (
        "sizes by fourth roots of two, until two in a row gained nothing; between them nothing was tried"
    )
    parts += titled("Front", [table, Text(covered, style="dim")])
    lost = [each for each in found.points if each not in found.best]
    beaten = [each for each in lost if each.size is None]
    if beaten:
        narrow = beaten[-1] if beaten[-1].scale < 1 else beaten[0]
        parts += titled(
            "Beside it", [Text(f"{exact(narrow.scale)} times as wide: {_stops(narrow.offer.result)}")]
        )
    if found.cut is not None:
        parts += cut_short(found.cut)
    return parts + ([Text(), Text(f"table {stem}.csv, figure {stem}.svg")] if files else [])


def table(found: Front, files: Mapping[Fraction, str]) -> str:
    """The front as CSV; exact values as texts that a specification takes."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scale", "size", "part", "largest", "certificate"])
    for each in found.best:
        writer.writerow(
            [each.scale, repr(each.size), each.offer.part, each.offer.value, files.get(each.scale, "")]
        )
    return text.getvalue()


def drawn(found: Front, part: HardwarePart, name: str) -> str:
    """The front as SVG: each dot a certificate."""
    points = [(_place(each.offer.value, part), each.size or 0.0) for each in found.best]
    title = f"{name}: the tube against the machine"
    chart = Chart(
        "front",
        title,
        Axis.around([x for x, _ in points], _AXES[part], log=min(x for x, _ in points) > 0),
        Axis.around([y for _, y in points], "proven size of the tube", log=True),
    )
    chart.line(points, "m1")
    for x, y in points:
        chart.dot((x, y), "m1", 3.0, f"{down(x)}, {up(y)}")
    legend = (("m1", "each dot is a certificate"),)
    return svg_file(Figure(key="front", title=title, svg=chart.text(), legend=legend, caption=""))


def _place(value: Fraction | None, part: HardwarePart) -> float:
    """Where a value is drawn: sample times as rates."""
    if not value:
        return 0.0
    return float(1 / value) if part == "sample_time" else float(value)


def front_data(found: Front, files: Mapping[Fraction, str]) -> Json:
    """Every size that was tried, for programs."""
    return [
        {
            "scale": str(each.scale),
            "size": each.size,
            "largest": None if each.offer.value is None else str(each.offer.value),
            "verdict": str(each.offer.result.verdict),
            "on_front": each in found.best,
            "certificate": files.get(each.scale),
        }
        for each in found.points
    ]

"""The report of a simulation of a sampled loop: what broke first, then what was attained. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.digits import down, short, up
from tubecert.report.layout import indented, plain_table
from tubecert.report.simulation import CAVEAT, STYLES
from tubecert.simulation.record import Attained, Summary, Violation

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

_CODES = {"c": "the controller is the exported C code", "floats": "the controller's tables in floats"}


def verdict_line(data: Summary) -> Text:
    """The outcome on one line."""
    line = Text(no_wrap=True, overflow="ignore")
    line.append(data.outcome, style=STYLES[data.outcome])
    line.append(f" {data.name}: ", style="bold")
    return line.append(_because(data))


def report(data: Summary, *, folder: str, files: Sequence[str], verbose: bool) -> list[RenderableType]:
    """The whole report as renderables; `folder` holds the `files`."""
    about = f"{data.adversaries} adversaries and {data.runs - data.adversaries} random runs"
    parts: list[RenderableType] = [
        Text(CAVEAT),
        Text(f"{about} over {short(data.duration)} s, seed {data.seed}; {_CODES[data.controller]}"),
        *(Text(_violation(own), "red") for own in data.violations[: None if verbose else 3]),
        _shares(data),
        *map(Text, _ranges(data)),
    ]
    images = " and figures" if any(name.endswith(".png") for name in files) else ""
    where = Text(f"{len(files)} files in {folder}: summary.json, runs.npz{images}")
    return [verdict_line(data), *map(indented, parts), where]


def _because(data: Summary) -> str:
    runs, attained = f"{data.runs} runs", short(data.attained)
    match data.outcome:
        case "falsified" if data.violations:
            return f"the tube is left in {data.outside} of {runs}, first {_violation(data.violations[0])}"
        case "falsified":
            return f"an input or an obstacle is not as certified ({runs})"
        case "no result":
            error = short(data.error)
            return f"an integration is wrong by {error} of a half-width: too much to judge ({runs})"
        case "interrupted":
            return f"{data.runs} of {data.asked} runs finished, which attained {attained} of the tube"
    return f"0 of {runs} left the tube, of which {attained} was attained"


def _violation(own: Violation) -> str:
    who = f"adversary of {own.aimed}" if own.aimed else "random"
    return f"by {own.of} at t = {short(own.t)} s in run {own.run} ({who}): {short(own.value)}, proven {up(own.bound)}"


def _shares(data: Summary) -> Table:
    late = [">in the long run"] if len(data.stages) > 1 else []
    table = plain_table("largest share of what is proven", ">adversaries", ">random runs", *late, "at", "by")
    for name, own in (*data.states.items(), *data.inputs.items()):
        table.add_row(name, *_row(own, late=bool(late)))
    return table


def _row(own: Attained, *, late: bool) -> Iterator[str]:
    for peak in (own.adversary, own.random):
        yield "" if peak is None else short(peak.share, 3)
    if late:
        yield short(max(own.adversary_by_stage[-1], own.random_by_stage[-1]), 3)
    most = max(filter(None, (own.adversary, own.random)), key=lambda peak: peak.share)
    yield from (f"t = {short(most.t)} s", f"run {most.run}")


def _ranges(data: Summary) -> Iterator[str]:
    for name, went in data.went.items():
        proven = went.proven and f", proven to stay in [{down(went.proven[0])}, {up(went.proven[1])}]"
        yield f"{name} went from {short(went.least)} to {short(went.greatest)}{proven or ''}"
    for passed in data.obstacles:
        yield f"obstacle {passed.index + 1}: {short(passed.distance)} away at least"

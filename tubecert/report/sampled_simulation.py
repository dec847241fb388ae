"""The report of a simulation of a sampled loop: what broke first, then what was attained. It claims nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.digits import down, short, up
from tubecert.report.layout import indented, plain_table
from tubecert.report.simulation import CAVEAT, STYLES
from tubecert.simulation.record import Attained, Summary, Violation

if TYPE_CHECKING:
    from rich.console import RenderableType


def verdict_line(data: Summary) -> Text:
    """The outcome on one line."""
    line = Text(no_wrap=True, overflow="ignore")
    line.append(data.outcome, style=STYLES[data.outcome])
    line.append(f" {data.name}: ", style="bold")
    return line.append(_because(data))


def report(data: Summary, *, folder: str, files: list[str], verbose: bool) -> list[RenderableType]:
    """The whole report as renderables; `folder` holds the `files`."""
    randoms = data.runs - data.adversaries
    code = (
        "the controller is the exported C code"
        if data.controller == "c"
        else "the controller's tables in floats"
    )
    about = f"{data.adversaries} adversaries and {randoms} random runs over {short(data.duration)} s, seed {data.seed}"
    parts: list[RenderableType] = [
        verdict_line(data),
        indented(Text(CAVEAT)),
        indented(Text(f"{about}; {code}")),
    ]
    shown = data.violations if verbose else data.violations[:3]
    parts += [indented(Text(_violation(own), "red")) for own in shown]
    late = [">in the long run"] if len(data.stages) > 1 else []
    table = plain_table("largest share of what is proven", ">adversaries", ">random runs", *late, "at", "by")
    for name, own in (*data.states.items(), *data.inputs.items()):
        long_run = [short(max(own.adversary_by_stage[-1], own.random_by_stage[-1]), 3)] if late else []
        table.add_row(name, *_shares(own)[:2], *long_run, *_shares(own)[2:])
    parts.append(indented(table))
    for name, went in data.went.items():
        stays = (
            ""
            if went.proven is None
            else f", proven to stay in [{down(went.proven[0])}, {up(went.proven[1])}]"
        )
        parts.append(indented(Text(f"{name} went from {short(went.least)} to {short(went.greatest)}{stays}")))
    for passed in data.obstacles:
        parts.append(indented(Text(f"obstacle {passed.index + 1}: {short(passed.distance)} away at least")))
    images = " and figures" if any(name.endswith(".png") for name in files) else ""
    return [*parts, Text(f"{len(files)} files in {folder}: summary.json, runs.npz{images}")]


def _because(data: Summary) -> str:
    runs = f"{data.runs} runs"
    match data.outcome:
        case "falsified":
            if data.violations:
                return f"the tube is left in {data.outside} of {runs}, first {_violation(data.violations[0])}"
            return f"an input or an obstacle is not as certified ({runs})"
        case "no result":
            return (
                f"an integration is wrong by {short(data.error)} of a half-width: too much to judge ({runs})"
            )
        case "interrupted":
            return f"{data.runs} of {data.asked} runs finished, which attained {short(data.attained)} of the tube"
    return f"0 of {runs} left the tube, of which {short(data.attained)} was attained"


def _violation(own: Violation) -> str:
    who = f"adversary of {own.aimed}" if own.aimed else "random"
    return f"by {own.of} at t = {short(own.t)} s in run {own.run} ({who}): {short(own.value)}, proven {up(own.bound)}"


def _shares(own: Attained) -> list[str]:
    peaks = [peak for peak in (own.adversary, own.random) if peak is not None]
    most = max(peaks, key=lambda peak: peak.share)
    shares = [short(peak.share, 3) if peak is not None else "" for peak in (own.adversary, own.random)]
    return [*shares, f"t = {short(most.t)} s", f"run {most.run}"]

"""The report of a simulation of a sampled loop: what broke first, then what was attained. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.digits import short, up
from tubecert.report.claimed import ends
from tubecert.report.layout import indented, kept_in, plain_table
from tubecert.report.simulation import CAVEAT, STYLES

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.table import Table

    from tubecert.simulation.sampled.campaign import Campaign, Violation

_CODES = {"c": "the controller is the exported C code", "floats": "the controller's tables in floats"}


def verdict_line(own: Campaign) -> Text:
    """The outcome on one line."""
    line = Text(no_wrap=True, overflow="ignore")
    line.append(own.outcome, style=STYLES[own.outcome])
    line.append(f" {own.setting.spec.name}: ", style="bold")
    return line.append(_because(own))


def report(own: Campaign, *, folder: str, files: Sequence[str], verbose: bool) -> list[RenderableType]:
    """The whole report as renderables; `folder` holds the `files`."""
    aimed, lasts = int(own.aimed.sum()), short(own.setting.samples * own.setting.Ts)
    about = f"{aimed} adversaries and {own.runs - aimed} random runs over {lasts} s, seed {own.attack.seed}"
    parts: list[RenderableType] = [
        Text(CAVEAT),
        Text(f"{about}; {_CODES[own.controller]}"),
        *(Text(_told(violation), "red") for violation in own.violations[: None if verbose else 3]),
        _shares(own),
        *map(Text, _ranges(own)),
    ]
    return [verdict_line(own), *map(indented, parts), kept_in(folder, files)]


def _because(own: Campaign) -> str:
    runs = f"{own.runs} runs"
    match own.outcome:
        case "falsified" if violations := own.violations:
            return f"the tube is left in {len(own.outside)} of {runs}, first {_told(violations[0])}"
        case "falsified":
            return f"an input or an obstacle is not as certified ({runs})"
        case "no result":
            error = short(own.error)
            return f"an integration is wrong by {error} of a half-width: too much to judge ({runs})"
        case "interrupted":
            return (
                f"{own.runs} of {own.asked} runs finished, which attained {short(own.attained)} of the tube"
            )
    return f"0 of {runs} left the tube, of which {short(own.attained)} was attained"


def _told(own: Violation) -> str:
    who, peak = f"adversary of {own.aimed}" if own.aimed else "random", own.peak
    where = f"by {own.of} at t = {short(peak.t)} s in run {peak.run} ({who})"
    return f"{where}: {short(peak.value)}, proven {up(peak.bound)}"


def _shares(own: Campaign) -> Table:
    late = [">in the long run"] if len(own.setting.stages) > 1 else []
    table = plain_table("largest share of what is proven", ">adversaries", ">random runs", *late, "at", "by")
    for i, name in enumerate(own.setting.names):
        peaks = [own.peak(i, own.aimed), own.peak(i, ~own.aimed)]
        shares = ["" if peak is None else short(peak.share, 3) for peak in peaks]
        long_run = [short(float(own.by_stage[:, i, -1].max()), 3)] * len(late)
        most = max(filter(None, peaks), key=lambda peak: peak.share)
        table.add_row(name, *shares, *long_run, f"t = {short(most.t)} s", f"run {most.run}")
    return table


def _ranges(own: Campaign) -> Iterator[str]:
    for name, went in own.went.items():
        proven = went.proven and f", proven: {ends(*went.proven)}"
        yield f"{name} went from {short(went.least)} to {short(went.greatest)}{proven or ''}"
    for i, passed in enumerate(own.passed, 1):
        yield f"obstacle {i}: {short(passed.distance)} away at least"

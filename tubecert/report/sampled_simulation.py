"""A simulation of a sampled loop as a page: what broke first, then what was attained. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

from tubecert.digits import short
from tubecert.report.page import Block, Facts, Page, Reason, Section, Table, Words
from tubecert.report.simulation import CAVEAT, clearance, told, went

if TYPE_CHECKING:
    from tubecert.simulation.sampled.campaign import Campaign
    from tubecert.simulation.told import Violation

_CODES: Final = {"c": "the controller is the exported C code", "floats": "the controller's tables in floats"}
_FIRST: Final = 2  # of what broke, on the first screen


def page_of(own: Campaign) -> Page:
    """The page of a campaign."""
    return Page(
        name=own.setting.spec.name,
        verdict=own.outcome,
        summary=_because(own),
        meaning=CAVEAT,
        sections=tuple(Section.each(_sections(own))),
        about="simulation",
    )


def _sections(own: Campaign) -> Iterator[tuple[str, str, Iterable[Block]]]:
    broken = [Reason(verdict="falsified", claim=each.of, message=_told(each)) for each in own.violations]
    yield "runs", "Runs", (*broken[:_FIRST], *_runs(own))
    yield "broken", "Everything that broke", broken if len(broken) > _FIRST else ()


def _runs(own: Campaign) -> Iterator[Block]:
    aimed, lasts = int(own.aimed.sum()), short(own.setting.samples * own.setting.Ts)
    about = f"{aimed} adversaries and {own.runs - aimed} random runs over {lasts} s, seed {own.attack.seed}"
    yield Words(text=f"{about}; {_CODES[own.controller]}.")
    yield _shares(own)
    yield Facts.of([*_ranges(own)])


def _because(own: Campaign) -> str:
    runs, attained = f"{own.runs} runs", short(own.attained)
    match own.outcome:
        case "falsified" if violations := own.violations:
            first = f"{violations[0].of}, {_told(violations[0])}"
            return f"the tube is left in {len(own.outside)} of {runs}, first {first}"
        case "falsified":
            return f"an input or an obstacle is not as certified ({runs})"
        case "no result":
            error = short(own.error)
            return f"an integration is wrong by {error} of a half-width: too much to judge ({runs})"
        case "interrupted":
            return f"{own.runs} of {own.asked} runs finished, which attained {attained} of the tube"
    return f"0 of {runs} left the tube, of which {attained} was attained"


def _told(own: Violation) -> str:
    return told(own, f"run {own.run} ({f'adversary of {own.aimed}' if own.aimed else 'random'})")


def _shares(own: Campaign) -> Table:
    """The largest share of what is proven of every state and input."""
    late = [">in the long run"] if len(own.setting.stages) > 1 else []
    rows = []
    for i, name in enumerate(own.setting.names):
        peaks = [own.peak(i, own.aimed), own.peak(i, ~own.aimed)]
        shares = ["" if peak is None else short(peak.share, 3) for peak in peaks]
        long_run = [short(float(own.by_stage[:, i, -1].max()), 3)] * len(late)
        most = max(filter(None, peaks), key=lambda peak: peak.share or 0.0)
        rows.append((name, *shares, *long_run, f"t = {short(most.t)} s", str(most.run)))
    return Table.of(("attained", ">adversaries", ">random runs", *late, "at", "in run"), rows)


def _ranges(own: Campaign) -> Iterator[tuple[str, str]]:
    for name, each in own.went.items():
        ways, proven = went(each)
        yield name, f"went from {ways}, proven: {proven}"
    yield from ((f"distance to obstacle {i}", clearance(each)) for i, each in enumerate(own.obstacles, 1))

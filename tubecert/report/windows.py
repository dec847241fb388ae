"""The tube window by window, in words and drawn: what certificates B, C and H prove of every part of the plan.

In: a result. Out: lines, figures and tables for the console and for the page.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from tubecert.certificate.follows import InputData
from tubecert.certificate.result import Result
from tubecert.digits import down, up
from tubecert.kinds import Name
from tubecert.kinds.data import SectionData
from tubecert.kinds.distance import DistanceData
from tubecert.kinds.hardware import HardwareData
from tubecert.kinds.sampled import SampledData
from tubecert.kinds.windows import WindowData
from tubecert.report.figures_axes import Axis, Chart
from tubecert.report.page import Block, Cell, Figure, Figures, Table
from tubecert.verdict import Verdict

STYLE = "h"  # as in the figures of the gains


def windows_of(section: SectionData | None) -> tuple[WindowData, ...]:
    """The windows in which a section proves something; empty where it has one level, or none."""
    if not isinstance(section, (DistanceData, SampledData, HardwareData)):
        return ()
    if section.verdict is not Verdict.CERTIFIED:
        return ()
    return tuple(each for each in section.windows if each.radius is not None)


def deciding(result: Result) -> tuple[WindowData, ...]:
    """The windows of what decides, if that is one kind."""
    return windows_of(result.sections.get(result.decided_by[0])) if len(result.decided_by) == 1 else ()


def of_gains(result: Result) -> Iterator[tuple[Name, tuple[WindowData, ...]]]:
    """The windows of B and of C; those of H stand with its machine."""
    for section in result.sections.values():
        if (own := windows_of(section)) and not isinstance(section, HardwareData):
            yield section.name, own


def lines(result: Result) -> Iterator[str]:
    """How the tube of B and of C is along the plan, for the console."""
    for name, own in of_gains(result):
        yield f"with {name}, {along(own)}"


def along(windows: Sequence[WindowData]) -> str | None:
    """How the tube is along the plan: its radius where it is widest and where it is narrowest; None without windows."""
    known = [(w, w.radius) for w in windows if w.radius is not None]
    if not known:
        return None
    (widest, most), (narrowest, least) = (pick(known, key=lambda item: item[1]) for pick in (max, min))
    if len(known) == 1:
        return f"one window: radius {up(most)}"
    return (
        f"{len(known)} windows: radius {up(most)} {between(widest)}, where the tube is widest; "
        f"{up(least)} {between(narrowest)}"
    )


def between(window: WindowData) -> str:
    """The time of a window: `from 0.5 to 1 s`."""
    return f"from {down(window.begin)} to {up(window.end)} s"


def blocks(
    result: Result, windows: Sequence[WindowData], key: str, title: str = "The tube along the plan"
) -> Iterator[Block]:
    """The tube along the plan, drawn and by window; nothing for one width."""
    known = [(w, w.radius) for w in windows if w.radius is not None]
    if not known:
        return
    path = [(float(t), radius) for w, radius in known for t in (w.begin, w.end)]
    x = Axis.around([t for t, _ in path], "time (s)", pad=0.0)
    chart = Chart(key, title, x, Axis.around([0.0, *(r for _, r in path)], "radius"))
    chart.line(path, STYLE)
    yield Figures(
        figures=(
            Figure(
                key=key,
                title=title,
                svg=chart.text(),
                legend=((STYLE, "|x - x*| is proven to stay below"),),
                caption="Each window has constants and a level of its own.",
            ),
        )
    )
    limited = bool(result.inputs) and any(w.inputs for w, _ in known)
    yield Table(
        columns=("time", "radius", "half-widths", "inputs", *(["limits"] if limited else [])),
        rows=tuple(
            (
                Cell(text=between(w)),
                Cell(text=up(radius), kind="number"),
                Cell(text=half_widths(result, w.half_widths)),
                Cell(text=inputs(result, w.inputs)),
                *([Cell(text=limits(result, w.inputs))] if limited else []),
            )
            for w, radius in known
        ),
        note="What is proven in each window; the facts above are the widest of them.",
    )


def of_gains_blocks(result: Result) -> Iterator[Block]:
    """The tubes of B and of C along the plan."""
    for name, own in of_gains(result):
        yield from blocks(result, own, f"along-{name.key}", f"The tube along the plan with {name}")


def limits(result: Result, ranges: Mapping[str, tuple[float, float]]) -> str:
    """How much of its limits every input uses that has some: `u 83 %`; if beyond them, that they are not proven."""
    return ", ".join(
        f"{own.input} {_used(own, ranges[own.input])}" for own in result.inputs if own.input in ranges
    )


def _used(own: InputData, found: tuple[float, float]) -> str:
    share = own.share(found)
    return f"{up(100 * share, 3)} %" + ("" if share <= 1 else ", not proven to stay within them")


def nearest(own: InputData, windows: Sequence[WindowData]) -> str | None:
    """When an input with limits is nearest to them, and in how many windows it is not proven to keep them."""
    known = [(w, own.share(w.inputs[own.input])) for w in windows if own.input in w.inputs]
    if len(known) < 2:
        return None
    window, most = max(known, key=lambda item: item[1])
    beyond = sum(share > 1 for _, share in known)
    told = (
        f"most {between(window)} ({up(100 * most, 3)} %), least {down(100 * min(s for _, s in known), 3)} %"
    )
    return told + (f"; beyond its limits in {beyond} of {len(known)} windows" if beyond else "")


def half_widths(result: Result, widths: Mapping[str, float]) -> str:
    """What is proven of every state."""
    units = result.spec.effective.system.units
    return ", ".join(f"{name} {up(w)} {units.get(name, '')}".rstrip() for name, w in widths.items())


def inputs(result: Result, ranges: Mapping[str, tuple[float, float]]) -> str:
    """What every input does in the loop, feedforward, feedback and adaptation together."""
    units = result.spec.effective.system.units
    return ", ".join(
        f"{name} in [{down(low)}, {up(high)}] {units.get(name, '')}".rstrip()
        for name, (low, high) in ranges.items()
    )

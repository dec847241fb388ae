"""A simulation as a page: what broke first, then what every loop used of the tube. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from tubecert.digits import UNKNOWN, short, up
from tubecert.report.claimed import ends
from tubecert.report.page import Block, Facts, Page, Reason, Section, Table, Words

if TYPE_CHECKING:
    from tubecert.simulation.adaptive.campaign import Campaign, Followed
    from tubecert.simulation.adaptive.judge import Comparison
    from tubecert.simulation.adaptive.loops import Loop
    from tubecert.simulation.told import Clearance, RunAt, Stopped, Violation, Went

CAVEAT: Final = "A simulation can falsify a certificate, it never supports one."
_FIRST: Final = 2  # of what broke, on the first screen
_LISTED: Final = 3  # runs without a result, of each kind of runs
_WORDS: Final = {
    "deviation": "|x - x*|",
    "distance": "d(x*, x)",
    "k": "|k|",
    "u": "|u|",
    "xtilde": "|xtilde|",
    "sigma_error": "|sigma_hat - h|",
    "speed": "|x'|",
}


def page_of(data: Campaign) -> Page:
    """The page of a campaign."""
    return Page(
        name=data.setting.spec.name,
        verdict=data.outcome,
        summary=_because(data, [part.comparison for part in data.followed if part.loop.adapts]),
        meaning=CAVEAT,
        sections=tuple(Section.each(_sections(data))),
        about="simulation",
    )


def _because(data: Campaign, tested: list[Comparison]) -> str:
    """What decided, in a few words."""
    runs = _runs(sum(own.runs for own in tested))
    shares = [own.worst["distance"].share for own in tested if own.worst]
    use = max((share for share in shares if share is not None), default=None)
    reached = f"d(x*, x) reached {short(use)} of its bound"
    match data.outcome:
        case "falsified":
            return f"a promise of the certificate is broken ({runs})"
        case "tube left":
            left = sum(own.left_the_tube for own in tested)
            exits = [own.first_exit.t for own in tested if own.first_exit is not None]
            first = f"first at t = {short(min(t for t in exits if t is not None))} s"
            return f"the tube is left in {left} of {runs}, {first}; no certificate covers these gains"
        case "no result":
            return f"the error estimate of some runs exceeds rho/100, or they failed ({runs})"
        case "interrupted":
            return f"{runs} finished, in which {reached}"
    return "no loop adapts" if use is None else f"{reached} in {runs}"


def _runs(count: int) -> str:
    return "1 run" if count == 1 else f"{count} runs"


def _who(data: Campaign, part: Followed, run: int) -> str:
    """Which run it was; `--replay` shows a random one."""
    seed = f"seed {data.seed}"
    match part.kind:
        case "one":
            return f"uncertainty {data.uncertainty}"
        case "random":
            return f"random run {run}, {seed}"
        case "other plans" if data.members is not None:
            return f"random plans, run {run}, {data.members.runs_each} along each, {seed}"
    return f"adversary, {seed}"


def _sections(data: Campaign) -> Iterator[tuple[str, str, Iterator[Block]]]:
    parts = data.followed
    broken = [_violation(data, part, item) for part in parts for item in part.comparison.violations]
    yield "runs", "Runs", _first(data, broken[:_FIRST])
    yield "broken", "Everything that broke", iter(broken[_FIRST:] and broken)
    yield "bounds", "Largest share of every bound", _bounds(parts)
    yield "inputs", "Inputs, in all runs", _inputs(parts)
    yield "acted", "What acted on the loops", _about(data)


def _first(data: Campaign, broken: list[Reason]) -> Iterator[Block]:
    yield from broken
    for part in data.followed:
        yield from (Words(text=_stopped(data, part, item)) for item in part.comparison.stopped[:_LISTED])
        yield from (
            Words(text=_unresolved(data, part, item)) for item in part.comparison.unresolved[:_LISTED]
        )
    columns = ("loop", "runs", ">number", ">left", ">no result", ">max d/bound", "at", "settled")
    yield Table.of(columns, map(_row, data.followed))
    loops = {each.loop.controller: _gains(each.loop) for each in data.loops}
    yield Facts.of(loops.items(), tuple(loops))
    if data.setting.spec.obstacles:
        yield _obstacles(data)


def _violation(data: Campaign, part: Followed, item: Violation) -> Reason:
    return Reason(
        verdict="falsified",
        claim=f"{part.loop.controller}, {_WORDS.get(item.of, item.of)}",
        message=told(item, _who(data, part, item.run)),
        relax=f"to see it alone: the same command with --replay {item.run}" if part.asked else "",
    )


def told(item: Violation, who: str) -> str:
    """By how much a run broke a bound, when, and `who` it was."""
    when = "" if item.t is None else f"t = {short(item.t)} s, "
    return f"{short(item.value, 6)}, proven at most {up(item.bound, 6)}; {when}{who}"


def _stopped(data: Campaign, part: Followed, item: Stopped) -> str:
    return f"{part.loop.controller}: {item.reason} at t = {short(item.t)} s, {_who(data, part, item.run)}"


def _unresolved(data: Campaign, part: Followed, item: RunAt) -> str:
    since = UNKNOWN if item.t is None else f"{short(item.t)} s"
    return (
        f"{part.loop.controller}: no result from t = {since} on, where the run depends on the steps of the "
        f"integration: the loop is unstable, or too fast to be followed; {_who(data, part, item.run)}"
    )


def _row(part: Followed) -> tuple[str, ...]:
    found, use = part.comparison, part.comparison.worst.get("distance")
    share, at = (UNKNOWN, "") if use is None or use.share is None else (short(use.share), f"{short(use.t)} s")
    return (
        part.loop.controller,
        part.kind,
        str(found.runs) + (f" of {part.asked}" if found.runs < part.asked else ""),
        str(found.left_the_tube),
        str(found.no_result),
        share,
        at,
        UNKNOWN if found.settled is None else f"{short(found.settled)} s",
    )


def _obstacles(data: Campaign) -> Table:
    from tubecert.simulation.adaptive.judge import of_plan, of_tube

    columns = ("obstacle", "plan", "tube", *(own.loop.controller for own in data.loops))
    pairs = zip(of_plan(data.setting), of_tube(data.setting), strict=True)
    rows = (
        (str(i + 1), *map(clearance, (plan, tube, *(own.obstacles[i] for own in data.loops))))
        for i, (plan, tube) in enumerate(pairs)
    )
    return Table.of(columns, rows)


def clearance(item: Clearance) -> str:
    """The least distance; below zero it collides."""
    value = short(item.clearance)
    return f"collides, {value} at {short(item.t)} s" if item.collides else value


def _bounds(parts: list[Followed]) -> Iterator[Block]:
    """What the loops that adapt used of every bound, over all their runs."""
    most: dict[str, dict[str, float]] = {}
    for part in parts:
        for name, use in part.comparison.worst.items() if part.loop.adapts else ():
            shares = most.setdefault(part.loop.controller, {})
            if use.share is not None:
                shares[name] = max(shares.get(name, 0.0), use.share)
    names = [name for name in _WORDS if any(name in shares for shares in most.values())]
    rows = [(own, *(short(shares.get(name)) for name in names)) for own, shares in most.items()]
    if rows:
        yield Table.of(("loop", *(f">{_WORDS[name]}" for name in names)), rows)


def _inputs(parts: list[Followed]) -> Iterator[Block]:
    """How far every input with limits went over all runs of a loop."""
    found: dict[tuple[str, str], Went] = {}
    for part in parts:
        for name, own in part.comparison.went.items():
            key = part.loop.controller, name
            found[key] = found.get(key, own).joined(own)
    if found:
        rows = ((*key, *went(own)) for key, own in found.items())
        yield Table.of(("loop", "input", "went", "is proven to stay in"), rows)


def went(own: Went) -> tuple[str, str]:
    """From where to where an input went, and where it is proven to stay."""
    return f"{short(own.least)} to {short(own.greatest)}", ends(*own.proven) if own.proven else UNKNOWN


def _about(data: Campaign) -> Iterator[Block]:
    """The uncertainty that is drawn, the class that attacked, and the plans that were drawn."""
    own = data.setting.uncertainty
    yield Words(text=f"one: the uncertainty {data.uncertainty}, 0 <= t <= {short(data.setting.horizon)} s.")
    yield Words(
        text=f"random, adversary: |h| <= {short(own.h)}, |dh/dx| <= {short(own.h_x)}, |dh/dt| <= {short(own.h_t)}, "
        f"|h| <= {short(own.h_initial)} at the start; seed {data.seed}."
    )
    if (members := data.members) is not None:
        count = str(members.plans) + ("" if members.plans == members.asked else f" of {members.asked}")
        yield Words(
            text=f"other plans: {count} of the family, {_runs(members.runs_each)} along each, every one with its own "
            "start and uncertainty; x* and u* keep to the boxes, |x*' - f - B u*| <= "
            f"{short(members.largest_defect)} (in many points, not proven)."
        )


def _gains(loop: Loop) -> str:
    """What a loop adapts with, and what certifies it."""
    gains = loop.gains
    if gains is None:
        return loop.gains_are
    rate = "" if gains.adaptation_rate is None else f", Gamma {short(gains.adaptation_rate)}"
    return (
        f"omega {short(gains.bandwidth)}{rate}, {loop.gains_are}; projection radius "
        f"{short(gains.projection_radius, 6)}, predictor gain {gains.predictor_gain}"
    )

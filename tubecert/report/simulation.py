"""The report of a simulation: what broke first, then what every loop used of the tube. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from rich.table import Table
from rich.text import Text

from tubecert.digits import UNKNOWN, down, short, up
from tubecert.report.layout import indented, kept_in, titled

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.simulation.adaptive.judge import Clearance, Comparison, InputUse, RunAt, Stopped, Violation
    from tubecert.simulation.adaptive.loops import LoopGains
    from tubecert.simulation.adaptive.record import LoopData, MembersData, Summary

STYLES: Final = {
    "falsified": "bold red",
    "tube left": "bold red",
    "no result": "bold yellow",
    "interrupted": "bold yellow",
    "not falsified": "bold green",
    "nothing claimed": "bold",
}
CAVEAT: Final = "A simulation can falsify a certificate, it never supports one."
_COUNTED: Final = ("controller", "runs", "left the tube", "no result", "max d/bound", "settled")
_WORDS: Final = {
    "deviation": "|x - x*|",
    "distance": "d(x*, x)",
    "k": "|k|",
    "u": "|u|",
    "xtilde": "|xtilde|",
    "sigma_error": "|sigma_hat - h|",
    "speed": "|x'|",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Part:
    """Runs of a loop, and what they are about; `each`: what one of many is, which `--replay` may show alone."""

    loop: LoopData
    comparison: Comparison
    what: str
    each: str = ""
    replayed: bool = False

    @property
    def counts(self) -> bool:
        """Whether the loop is meant to stay in the tube, and there are runs that say whether it does."""
        return self.loop.tested and bool(self.comparison.worst)

    def run(self, item: RunAt | Stopped | Violation) -> str:
        """Which run it was."""
        return f"{self.each} {item.run}, {self.what}" if self.each else self.what


def verdict_line(data: Summary) -> Text:
    """The outcome on one line."""
    line = Text(no_wrap=True, overflow="ignore")
    line.append(data.outcome, style=STYLES[data.outcome])
    line.append(f" {data.name}: ", style="bold")
    line.append(_because(data))
    return line


def report(data: Summary, *, folder: str, files: Sequence[str], verbose: bool) -> list[RenderableType]:
    """The whole report as renderables; `folder` holds the `files`."""
    parts: list[RenderableType] = [verdict_line(data), indented(Text(CAVEAT))]
    for title, body in _sections(data, verbose):
        parts += titled(title, body)
    return [*parts, Text(), kept_in(folder, files)]


def _because(data: Summary) -> str:
    """What decided, in a few words."""
    tested = [part.comparison for part in _parts(data) if part.loop.tested]
    runs = sum(own.runs for own in tested)
    shares = [own.worst["distance"].share for own in tested if own.worst]
    use = max((share for share in shares if share is not None), default=None)
    match data.outcome:
        case "falsified":
            return f"a promise of the certificate is broken; see VIOLATION below ({_runs(runs)})"
        case "tube left":
            left = sum(own.left_the_tube for own in tested)
            exits = [own.first_exit.t for own in tested if own.first_exit is not None]
            first = f"first at t = {short(min(t for t in exits if t is not None))} s"
            return f"the tube is left in {left} of {_runs(runs)}, {first}; no certificate covers these gains"
        case "no result":
            return f"the error estimate of some runs exceeds rho/100, or they failed ({_runs(runs)})"
        case "interrupted":
            return f"{_runs(runs)} finished, in which d(x*, x) reached {short(use)} of its bound"
        case "not falsified":
            return f"d(x*, x) reached {short(use)} of its bound in {_runs(runs)}"
    return (
        f"d(x*, x) reached {short(use)} of its bound in {_runs(runs)}"
        if use is not None
        else "no loop adapts"
    )


def _runs(count: int) -> str:
    return "1 run" if count == 1 else f"{count} runs"


def _parts(data: Summary) -> Iterator[_Part]:
    """Every comparison, with what it is about."""
    for own in data.loops:
        yield _Part(loop=own.loop, comparison=own.comparison, what=f"uncertainty {data.uncertainty}")
    seed = f"seed {data.seed}"
    for attack in data.attacks:
        random, worst = attack.random, attack.adversary
        yield _Part(
            loop=attack.loop, comparison=random.comparison, what=seed, each="random run", replayed=True
        )
        if worst is not None:
            yield _Part(loop=attack.loop, comparison=worst.comparison, what=f"adversary, {seed}")
    if (members := data.members) is not None:
        words, each = f"{members.runs_each} along each, {seed}", "random plans, run"
        yield from (
            _Part(loop=own.loop, comparison=own.comparison, what=words, each=each) for own in members.loops
        )


def _sections(data: Summary, verbose: bool) -> Iterator[tuple[str, list[RenderableType]]]:
    parts = list(_parts(data))
    broken = [_violation(part, item) for part in parts for item in part.comparison.violations]
    if broken:
        yield "VIOLATION", list(broken)
    stopped = [_stopped(part, item) for part in parts for item in part.comparison.stopped[:3]]
    stopped += [_unresolved(part, item) for part in parts for item in part.comparison.unresolved[:3]]
    if stopped:
        yield "Stopped, or no result", list(stopped)
    yield (
        f"Loops under the uncertainty {data.uncertainty}, 0 <= t <= {short(data.horizon)} s",
        [_loops(data)],
    )
    if data.attacks:
        yield f"Attacks within the class, seed {data.seed}", [_class(data), _attacks(data)]
    if data.members is not None:
        yield "Random plans of the family", [*_members(data.members)]
    if any(part.counts for part in parts):
        yield "Largest share of every bound", [_bounds(data)]
    if inputs := _inputs(data):
        yield "Inputs, in all runs", [_table_of(inputs)]
    if data.obstacles.plan:
        yield "Obstacles (least distance; negative: collision)", [_obstacles(data)]
    if verbose:
        yield "Gains", [_gains(own.loop, own.loop.gains) for own in data.loops if own.loop.gains is not None]


def _when(item: Violation) -> str:
    return "" if item.t is None else f"t = {short(item.t)} s, "


def _violation(part: _Part, item: Violation) -> Text:
    where, name = part.run(item), _WORDS.get(item.bound_of, item.bound_of)
    what = f"{part.loop.controller}: {name} is {short(item.value, 6)}"
    text = Text(f"{what}, promised at most {short(item.bound, 6)}; {_when(item)}{where}", "red")
    if part.replayed:
        text.append(f"\n  to see it alone: the same command with --replay {item.run}", style="default")
    return text


def _stopped(part: _Part, item: Stopped) -> Text:
    return Text(f"{part.loop.controller}: {item.reason} at t = {short(item.t)} s, {part.run(item)}")


def _unresolved(part: _Part, item: RunAt) -> Text:
    since = UNKNOWN if item.t is None else f"{short(item.t)} s"
    return Text(
        f"{part.loop.controller}: no result from t = {since} on, where the run depends on the steps of the "
        f"integration: the loop is unstable, or too fast to be followed; {part.run(item)}"
    )


def _loops(data: Summary) -> Table:
    table = _table("controller", "gains", "are", "max d/bound", "max |x-x*|/bound", "settled")
    for own in data.loops:
        shares = (_share(own.comparison, name) for name in ("distance", "deviation"))
        table.add_row(
            own.loop.controller, _gain_words(own.loop), own.loop.gains_are, *shares, _settled(own.comparison)
        )
    return table


def _gain_words(loop: LoopData) -> str:
    gains = loop.gains
    if gains is None:
        return UNKNOWN
    Gamma = "" if gains.adaptation_rate is None else f", Gamma {short(gains.adaptation_rate)}"
    return f"omega {short(gains.bandwidth)}{Gamma}"


def _share(own: Comparison, name: str) -> str:
    use = own.worst.get(name)
    if use is None or use.share is None:
        return UNKNOWN
    return f"{short(use.share)} at {short(use.t)} s"


def _class(data: Summary) -> Text:
    own = data.bounds
    return Text(
        f"|h| <= {short(own.h)}, |dh/dx| <= {short(own.h_x)}, |dh/dt| <= {short(own.h_t)}, "
        f"|h| <= {short(own.h_initial)} at the start"
    )


def _attacks(data: Summary) -> Table:
    table = _table(*_COUNTED, "adversary")
    for attack in data.attacks:
        found = attack.random.comparison
        worst = UNKNOWN if attack.adversary is None else _share(attack.adversary.comparison, "distance")
        table.add_row(*_counted(attack.loop, found, attack.random.asked), worst)
    return table


def _counted(loop: LoopData, found: Comparison, asked: int) -> Iterator[str]:
    """A row of `_COUNTED`."""
    yield loop.controller
    yield str(found.runs) + (f" of {asked}" if found.runs < asked else "")
    yield str(found.left_the_tube)
    yield str(found.no_result)
    yield _share(found, "distance")
    yield _settled(found)


def _settled(found: Comparison) -> str:
    return UNKNOWN if found.settled is None else f"{short(found.settled)} s"


def _members(members: MembersData) -> Iterator[RenderableType]:
    """What the loops did along further plans of the family."""
    plans, asked = members.plans, members.asked
    drawn = f"{plans} further plans" if plans == asked else f"{plans} of {asked} further plans"
    yield Text(
        f"{drawn}, {_runs(members.runs_each)} along each, every one with its own start and uncertainty; x* and "
        f"u* keep to the boxes, |x*' - f - B u*| <= {short(members.largest_defect)} (in many points, not proven)"
    )
    table = _table(*_COUNTED)
    for own in members.loops:
        table.add_row(*_counted(own.loop, own.comparison, own.comparison.runs))
    yield table


def _bounds(data: Summary) -> Table:
    """What the loops that adapt used of every bound, over all their runs."""
    most: dict[str, dict[str, float]] = {}
    for part in _parts(data):
        if part.counts:
            shares = most.setdefault(part.loop.controller, {})
            for name, use in part.comparison.worst.items():
                if use.share is not None:
                    shares[name] = max(shares.get(name, 0.0), use.share)
    names = [name for name in _WORDS if any(name in shares for shares in most.values())]
    table = _table("controller", *(_WORDS[name] for name in names))
    for controller, shares in most.items():
        table.add_row(controller, *(short(shares[name]) if name in shares else UNKNOWN for name in names))
    return table


def _inputs(data: Summary) -> dict[tuple[str, str], InputUse]:
    """How far every input with limits went over all runs of a loop, by controller and input."""
    found: dict[tuple[str, str], InputUse] = {}
    for part in _parts(data):
        for own in part.comparison.inputs:
            key = part.loop.controller, own.input
            found[key] = own if key not in found else found[key].joined(own)
    return found


def _table_of(inputs: Mapping[tuple[str, str], InputUse]) -> Table:
    table = _table("controller", "input", "went", "is proven to stay in")
    for (controller, name), own in inputs.items():
        stays = UNKNOWN if own.proven is None else f"[{down(own.proven[0])}, {up(own.proven[1])}]"
        table.add_row(controller, name, f"[{short(own.least)}, {short(own.greatest)}]", stays)
    return table


def _obstacles(data: Summary) -> Table:
    table = _table("obstacle", "plan", "tube", *(own.loop.controller for own in data.loops))
    rows = zip(data.obstacles.plan, data.obstacles.tube, strict=True)
    for i, (plan, tube) in enumerate(rows):
        loops = (_clearance(own.obstacles[i]) for own in data.loops)
        table.add_row(str(i + 1), _clearance(plan), _clearance(tube), *loops)
    return table


def _clearance(item: Clearance) -> str:
    value = short(item.clearance)
    return f"collides, {value} at {short(item.t)} s" if item.collides else value


def _gains(loop: LoopData, gains: LoopGains) -> Text:
    return Text(
        f"{loop.controller}: projection radius {short(gains.projection_radius, 6)}, "
        f"predictor gain {gains.predictor_gain}"
    )


def _table(*columns: str) -> Table:
    return Table(*columns, box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")

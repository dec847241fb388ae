"""The report of a simulation: what broke first, then what every loop used of the tube. It claims nothing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from rich.table import Table
from rich.text import Text

from tubecert.records import from_json
from tubecert.report.layout import indented, titled
from tubecert.report.numbers import UNKNOWN, down, short, up
from tubecert.simulate.inputs import InputUse

if TYPE_CHECKING:
    from rich.console import RenderableType

Data = Mapping[str, Any]

STYLES: Final = {
    "falsified": "bold red",
    "tube left": "bold red",
    "no result": "bold yellow",
    "interrupted": "bold yellow",
    "not falsified": "bold green",
    "nothing claimed": "bold",
}
_CAVEAT: Final = "A simulation can falsify a certificate, it never supports one."
_WORDS: Final = {
    "deviation": "|x - x*|",
    "distance": "d(x*, x)",
    "k": "|k|",
    "u": "|u|",
    "xtilde": "|xtilde|",
    "sigma_error": "|sigma_hat - h|",
    "estimate": "|q - h|",
    "speed": "|x'|",
}


def verdict_line(data: Data) -> Text:
    """The outcome on one line."""
    line = Text(no_wrap=True, overflow="ignore")
    line.append(data["outcome"], style=STYLES[data["outcome"]])
    line.append(f" {data['name']}: ", style="bold")
    line.append(_because(data))
    return line


def report(data: Data, *, folder: str, files: int, verbose: bool) -> list[RenderableType]:
    """The whole report as renderables; `folder` holds the files."""
    parts: list[RenderableType] = [verdict_line(data), indented(Text(_CAVEAT))]
    for title, body in _sections(data, verbose):
        parts += titled(title, body)
    where = Text(f"{files} files ", style="bold", no_wrap=True, overflow="ignore").append(
        f"in {folder}: summary.json, runs.npz, tables (CSV) and figures (PNG, SVG)", style="not bold"
    )
    return [*parts, Text(), where]


def _because(data: Data) -> str:
    """What decided, in a few words."""
    runs = sum(part["runs"] for part in _parts(data) if part["tested"])
    use = max((part["worst"]["distance"]["share"] for part in _parts(data) if _counts(part)), default=None)
    left = sum(part["left_the_tube"] for part in _parts(data) if part["tested"])
    match data["outcome"]:
        case "falsified":
            return f"a promise of the certificate is broken; see VIOLATION below ({_runs(runs)})"
        case "tube left":
            exits = [
                part["first_exit"]["t"] for part in _parts(data) if part["tested"] and part["first_exit"]
            ]
            first = f"first at t = {short(min(exits))} s"
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


def _counts(part: Data) -> bool:
    return bool(part["tested"] and part["worst"])


def _parts(data: Data) -> Iterator[dict[str, Any]]:
    """Every comparison, with what it is about."""
    for loop in data["loops"]:
        yield {**loop, "what": f"uncertainty {data['uncertainty']}"}
    for attack in data["attacks"]:
        for name, words in (
            ("random", "random run {run}, seed {seed}"),
            ("adversary", "adversary, seed {seed}"),
        ):
            if name in attack:
                yield {**attack, **attack[name], "what": words.replace("{seed}", str(data["seed"]))}


def _sections(data: Data, verbose: bool) -> Iterator[tuple[str, list[RenderableType]]]:
    broken = [_violation(part, item) for part in _parts(data) for item in part["violations"]]
    if broken:
        yield "VIOLATION", list(broken)
    stopped = [_stopped(part, item) for part in _parts(data) for item in part["stopped"][:3]]
    stopped += [_unresolved(part, item) for part in _parts(data) for item in part["unresolved"][:3]]
    cautions = [
        Text(f"{loop['controller']}: {loop['caution']}") for loop in data["loops"] if "caution" in loop
    ]
    if stopped or cautions:
        yield "Stopped, or no result" if stopped else "Unstable", [*cautions, *stopped]
    yield (
        f"Loops under the uncertainty {data['uncertainty']}, 0 <= t <= {short(data['horizon'])} s",
        [_loops(data)],
    )
    if data["attacks"]:
        yield f"Attacks within the class, seed {data['seed']}", [_class(data), _attacks(data)]
    if any(_counts(part) for part in _parts(data)):
        yield "Largest share of every bound", [_bounds(data)]
    if inputs := _inputs(data):
        yield "Inputs, in all runs", [_table_of(inputs)]
    if data["obstacles"]["plan"]:
        yield "Obstacles (least distance; negative: collision)", [_obstacles(data)]
    if verbose:
        yield "Gains", [_gains(loop) for loop in data["loops"] if "gains" in loop]


def _where(part: Data, item: Data) -> str:
    """Which run it was."""
    return str(part["what"]).replace("{run}", str(item["run"]))


def _when(item: Data) -> str:
    return "" if item["t"] is None else f"t = {short(item['t'])} s, "


def _violation(part: Data, item: Data) -> Text:
    where = _where(part, item)
    what = (
        f"{part['controller']}: {_WORDS.get(item['bound_of'], item['bound_of'])} is {short(item['value'], 6)}"
    )
    text = Text(f"{what}, promised at most {short(item['bound'], 6)}; {_when(item)}{where}", "red")
    if "random run" in where:
        text.append(f"\n  to see it alone: the same command with --replay {item['run']}", style="default")
    return text


def _stopped(part: Data, item: Data) -> Text:
    where = _where(part, item)
    return Text(f"{part['controller']}: {item['reason']} at t = {short(item['t'])} s, {where}")


def _unresolved(part: Data, item: Data) -> Text:
    where = _where(part, item)
    since = UNKNOWN if item["t"] is None else f"{short(item['t'])} s"
    return Text(
        f"{part['controller']}: from t = {since} on the run depends on the steps of the integration: "
        f"the loop is unstable, or too fast to be followed; {where}"
    )


def _loops(data: Data) -> Table:
    table = _table("controller", "gains", "are", "max d/bound", "max |x-x*|/bound", "settled")
    for loop in data["loops"]:
        settled = loop["settled"]
        table.add_row(
            loop["controller"],
            _gain_words(loop),
            loop["gains_are"],
            _share(loop, "distance"),
            _share(loop, "deviation"),
            UNKNOWN if settled is None else f"{short(settled)} s",
        )
    return table


def _gain_words(loop: Data) -> str:
    gains = loop.get("gains")
    if not gains:
        return UNKNOWN
    bandwidth = gains["bandwidth"]
    words = ["no filter" if bandwidth is None else f"omega {short(bandwidth)}"]
    if gains["adaptation_rate"] is not None:
        words.append(f"Gamma {short(gains['adaptation_rate'])}")
    if gains["sample_time"] is not None:
        words.append(f"Ts {short(gains['sample_time'])}")
    if "control_rate" in loop:
        words.append(f"held at {short(loop['control_rate'])} Hz")
    return ", ".join(words)


def _share(part: Data, name: str) -> str:
    use = part["worst"].get(name)
    if use is None or use["share"] is None:
        return UNKNOWN
    return f"{short(use['share'])} at {short(use['t'])} s"


def _class(data: Data) -> Text:
    kind = data["class"]
    return Text(
        f"|h| <= {short(kind['h'])}, |dh/dx| <= {short(kind['h_x'])}, |dh/dt| <= {short(kind['h_t'])}, "
        f"|h| <= {short(kind['h_initial'])} at the start"
    )


def _attacks(data: Data) -> Table:
    table = _table("controller", "runs", "left the tube", "no result", "max d/bound", "adversary", "settled")
    for attack in data["attacks"]:
        random, adversary = attack.get("random"), attack.get("adversary")
        settled = random and random["settled"]
        runs = UNKNOWN
        if random:
            asked = random["asked"]
            runs = str(random["runs"]) + (f" of {asked}" if random["runs"] < asked else "")
        table.add_row(
            attack["controller"],
            runs,
            str(random["left_the_tube"]) if random else UNKNOWN,
            str(random["no_result"] + len(random["stopped"])) if random else UNKNOWN,
            _share(random, "distance") if random else UNKNOWN,
            _share(adversary, "distance") if adversary else UNKNOWN,
            UNKNOWN if settled is None else f"{short(settled)} s",
        )
    return table


def _bounds(data: Data) -> Table:
    """What the loops that adapt used of every bound, over all their runs."""
    most: dict[str, dict[str, float]] = {}
    for part in _parts(data):
        if _counts(part):
            shares = most.setdefault(part["controller"], {})
            for name, use in part["worst"].items():
                if use["share"] is not None:
                    shares[name] = max(shares.get(name, 0.0), use["share"])
    names = [name for name in _WORDS if any(name in shares for shares in most.values())]
    table = _table("controller", *(_WORDS[name] for name in names))
    for controller, shares in most.items():
        table.add_row(controller, *(short(shares[name]) if name in shares else UNKNOWN for name in names))
    return table


def _inputs(data: Data) -> dict[tuple[str, str], InputUse]:
    """How far every input with limits went over all runs of a loop, by controller and input."""
    found: dict[tuple[str, str], InputUse] = {}
    for part in _parts(data):
        for own in from_json(tuple[InputUse, ...], part.get("inputs", []), "inputs"):
            key = str(part["controller"]), own.input
            found[key] = own if key not in found else found[key].joined(own)
    return found


def _table_of(inputs: Mapping[tuple[str, str], InputUse]) -> Table:
    table = _table("controller", "input", "went", "is proven to stay in")
    for (controller, name), own in inputs.items():
        stays = UNKNOWN if own.proven is None else f"[{down(own.proven[0])}, {up(own.proven[1])}]"
        table.add_row(controller, name, f"[{short(own.least)}, {short(own.greatest)}]", stays)
    return table


def _obstacles(data: Data) -> Table:
    loops = data["loops"]
    table = _table("obstacle", "plan", "tube", *(loop["controller"] for loop in loops))
    rows = data["obstacles"]
    for i, (plan, tube) in enumerate(zip(rows["plan"], rows["tube"], strict=True)):
        table.add_row(
            str(i + 1),
            _clearance(plan),
            _clearance(tube),
            *(_clearance(loop["obstacles"][i]) for loop in loops),
        )
    return table


def _clearance(item: Data) -> str:
    value = short(item["clearance"])
    return f"collides, {value} at {short(item['t'])} s" if item["collides"] else value


def _gains(loop: Data) -> Text:
    gains = loop["gains"]
    return Text(
        f"{loop['controller']}: projection radius {short(gains['projection_radius'], 6)}, "
        f"predictor gain {gains['predictor_gain']}"
    )


def _table(first: str, *others: str) -> Table:
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style="dim")
    table.add_column(first)
    for name in others:
        table.add_column(name)
    return table

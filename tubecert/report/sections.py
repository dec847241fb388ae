"""The sections of the report, each a title and what stands below it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tubecert.bounds.constants import DERIVED, TABLE
from tubecert.report.gains import NAMES, rows
from tubecert.report.layout import plain_table
from tubecert.report.numbers import UNKNOWN, Number, down, exact, short, up
from tubecert.report.reasons import assumption_of, reason_of
from tubecert.words.advice import advice
from tubecert.words.claims import message, title

if TYPE_CHECKING:
    from rich.console import RenderableType

Section = tuple[str, list["RenderableType"]]
MEANINGS = {**TABLE, **DERIVED}
VERDICTS = {"certified": "green", "refuted": "red", "undecided": "yellow"}


def of(result: Mapping[str, Any], *, verbose: bool) -> Iterator[Section]:
    """The sections that a result has something to say in."""
    failed = [item for item in result["reasons"] if item.get("verdict") != "certified"]
    holding = [item for item in result["reasons"] if item.get("verdict") == "certified"]
    if failed:
        yield "Not certified", [_reason(result, item) for item in failed]
    if any(name in result for name in NAMES):
        yield "Gains", _gains(result)
    if holding:
        yield "What limits them", [_reason(result, item) for item in holding]
    if "tube" in result:
        yield "Tube", _tube(result)
    if "metric" in result:
        yield "Metric", _metric(result["metric"], result["safe_set"])
    if verbose and "constants" in result:
        yield "Constants over the tube", [_constants(result)]
    yield "Assumed, not proven", _assumptions(result, verbose)


def span(result: Mapping[str, Any]) -> str:
    """The time that is claimed."""
    end = horizon(result)
    return "for all t >= 0" if end is None else f"for 0 <= t <= {short(end, 12)} s"


def horizon(result: Mapping[str, Any]) -> Number | None:
    """The end of the plan in s, None if it has none."""
    end: Number | None = result["spec"]["effective"]["trajectory"].get("horizon")
    return end


# -- why not


def _reason(result: Mapping[str, Any], reason: Mapping[str, Any]) -> Group:
    verdict = reason.get("verdict", "undecided")
    told = reason_of(reason)
    text = Text.assemble(
        (f"{verdict} ", VERDICTS[verdict]), (title(told.claim), "bold"), f": {message(told)}"
    )
    more = []
    if at := reason.get("at"):
        more.append(Text(f"at {point(result, at)}"))
    if relax := advice(told.relax):
        more.append(Text.assemble(("help: ", "green"), relax))
    return Group(text, *(Padding(line, (0, 0, 0, 2)) for line in more))


def point(result: Mapping[str, Any], at: Mapping[str, Any]) -> str:
    """A witness: `t = 0.2 s, x1 = 0.1, ...`."""
    states = result["spec"]["effective"]["system"]["states"]
    parts = [] if at.get("t") is None else [f"t = {short(at['t'], 6)} s"]
    parts += [f"{name} = {short(value, 6)}" for name, value in zip(states, at.get("x", ()), strict=False)]
    return ", ".join(parts)


# -- gains


def _gains(result: Mapping[str, Any]) -> list[RenderableType]:
    found = list(rows(result))
    body: list[RenderableType] = []
    if found:
        table = plain_table("certificate", "gains", "verdict", ">omega", ">Gamma", ">Ts", "margin left")
        before = ""
        for row in found:
            table.add_row(
                "" if row.section == before else NAMES[row.section],
                f"{row.which} *" if row.decides else row.which,
                Text(row.verdict, style=VERDICTS[row.verdict]),
                exact(row.bandwidth),
                "" if row.adaptation_rate is None else exact(row.adaptation_rate),
                "" if row.sample_time is None else exact(row.sample_time),
                row.slack,
            )
            before = row.section
        body.append(table)
        if any(row.decides for row in found):
            body.append(
                Text(
                    "* decides the verdict; rows do not mix; omega in rad/s, Ts in s",
                    style="dim",
                )
            )
    missing = [NAMES[key] for key in NAMES if key in result and not any(row.section == key for row in found)]
    body += [Text(f"{title}: no gains were found") for title in missing]
    return body + _limit(result)


def _limit(result: Mapping[str, Any]) -> list[Text]:
    """What no bandwidth can go beyond."""
    limit = result.get("sampled", {}).get("sample_time_limit")
    return [] if limit is None else [Text(f"However large the bandwidth, C needs Ts < {down(limit)} s.")]


# -- tube and metric


def _tube(result: Mapping[str, Any]) -> list[RenderableType]:
    tube = result["tube"]
    line = f"rho = {up(tube['rho'])}"
    if "rho_r" in tube:
        line += f" = {up(tube['rho_r'])} (rho_r) + {up(tube['rho_a'])} (rho_a)"
    lines = [f"{line}; epsilon = {short(tube['epsilon'])}"]
    if widths := tube.get("half_widths"):
        units = result["spec"]["effective"]["system"].get("units", {})
        sides = (f"{name} {up(width)} {units.get(name, '')}".rstrip() for name, width in widths.items())
        lines.append(f"half-widths: {', '.join(sides)}")
    return [*map(Text, lines), *_in_the_long_run(result)]


def _in_the_long_run(result: Mapping[str, Any]) -> list[Text]:
    """The radius that remains when the initial error has died out, for each certificate that holds."""
    if horizon(result) is not None:
        return []
    found = [
        (title, data["ultimate_radius"])
        for key, title in NAMES.items()
        if (data := result.get(key, {})).get("verdict") == "certified"
        and data.get("ultimate_radius") is not None
    ]
    return [Text(f"in the long run |x - x*| <= {up(radius)} with {title}") for title, radius in found]


def _metric(metric: Mapping[str, Any], safe_set: Mapping[str, Any]) -> list[RenderableType]:
    body = [f"rate {short(metric['rate'], 12)} 1/s: {metric['verdict']} on the safe set"]
    if (largest := metric.get("largest_rate")) is not None:
        body[0] += f"; the metric supports rates up to {down(largest[0], 7)} 1/s"
    if (margin := metric.get("margin")) and metric["verdict"] == "certified":
        body[0] += f" (margin {down(margin[0], 3)} 1/s)"
    for words, low, high in (
        ("over the tube", "lower", "upper"),
        ("on the safe set", "lower_on_set", "upper_on_set"),
    ):
        if low in metric and high in metric:
            a, A = metric[low], metric[high]
            body.append(f"{down(a[0])} I <= M <= {up(A[1])} I {words}")
    sides = ", ".join(f"{name} in [{exact(low)}, {exact(high)}]" for name, (low, high) in safe_set.items())
    return [Text(line) for line in [*body, f"safe set: {sides}"]]


def _constants(result: Mapping[str, Any]) -> Table:
    table = plain_table("symbol", "what it is, and where", ">proven", "unit", ">gap", wrapped=1)
    for name, item in result["constants"].items():
        table.add_row(
            item["symbol"], _described(result, name, item), proven(name, item), item["unit"], gap(item)
        )
    return table


def _described(result: Mapping[str, Any], name: str, item: Mapping[str, Any]) -> Text:
    text = Text(described(name))
    if item.get("at") and (where := point(result, item["at"])):
        text.append(f"\nat {where}", style="dim")
    return text


def described(name: str) -> str:
    """A constant in words, whatever its name."""
    meaning = MEANINGS.get(name)
    return name.replace("_", " ") if meaning is None else meaning.words


def proven(name: str, item: Mapping[str, Any]) -> str:
    """The side that the certificate uses: from below for an infimum, from above for a supremum."""
    meaning = MEANINGS.get(name)
    if meaning is not None and meaning.side == "below":
        return f">= {down(item['below'], 6)}"
    return f"<= {up(item['above'], 6)}"


def gap(item: Mapping[str, Any]) -> str:
    """How far the two proven sides are apart, relative to the larger one."""
    low, high = item["below"], item["above"]
    if low is None or high is None or low < 0 < high:
        return UNKNOWN
    return "exact" if low == high else f"{up(100 * (high - low) / max(abs(low), abs(high)), 2)} %"


# -- assumptions


def _assumptions(result: Mapping[str, Any], verbose: bool) -> list[RenderableType]:
    stated = result["assumptions"]
    declared = result.get("declared", {})
    believed = [
        f"declared, believed as given: {', '.join(f'{k} <= {exact(v)}' for k, v in declared.items())}"
    ]
    if verbose:
        table = Table.grid(padding=(0, 1, 0, 0))
        for item in [*map(assumption_of, stated), *(believed if declared else [])]:
            table.add_row("-", Text(item))
        return [table]
    proven = result.get("metric", {}).get("unique_geodesics", {}).get("holds", False)
    geodesics = "exact geodesics (their uniqueness is proven)" if proven else "exact and unique geodesics"
    brief = (
        f"exact continuous-time control, full state, no noise, delay or saturation; {geodesics}; filter "
        f"and predictor start at rest; the uncertainty is as specified ({len(stated)} in all, -v shows them)"
    )
    return [Text(line) for line in [brief, *(believed if declared else [])]]

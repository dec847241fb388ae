"""The report of a synthesis: the metric and what was proven of it, the metrics compared, or why there is none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.text import Text

from tubecert.report.layout import indented, plain_table, titled
from tubecert.report.numbers import UNKNOWN, down, exact, short, up
from tubecert.report.reasons import outcome_of, reason_of
from tubecert.report.sections import VERDICTS, place
from tubecert.words.advice import advice
from tubecert.words.claims import message, outcome

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.spec import Spec

FLOORS = {"identity": "condition", "input": "input gain"}
_SHOWN = 12  # attempts


def verdict_line(data: Mapping[str, Any], file: Mapping[str, Any] | None, name: str) -> Text:
    """What came of it, on one line."""
    if file is None:
        line = Text.assemble((data["verdict"], f"bold {VERDICTS[data['verdict']]}"), (f" {name}: ", "bold"))
        line.append(message(reason_of(data["reason"])))
        return line
    line = Text.assemble(("metric proven", "bold green"), (f" {name}: ", "bold"))
    line.append(f"rate {exact(file['rate'])} 1/s, condition number {up(file['condition_number'][1])}")
    if "margin" in file:
        line.append(f", margin {down(file['margin'][0], 3)} 1/s")
    return line


def report(
    data: Mapping[str, Any], file: Mapping[str, Any] | None, system: Spec, target: str
) -> list[RenderableType]:
    """The whole report as renderables; `target` is the metric file."""
    name = system.name
    parts: list[RenderableType] = [verdict_line(data, file, name)]
    if file is not None:
        parts += map(indented, _proven(file))
    if rows := data.get("table"):
        parts += titled("Metrics compared", [_compared(rows)])
    if file is None:
        return [*parts, *_failure(data, system.states)]
    certify = f"certify with it: tubecert certify SPEC --metric {target}"
    return [*parts, Text(), Text(f"Metric: {target}"), Text(certify, style="dim")]


def _failure(data: Mapping[str, Any], states: Sequence[str]) -> list[RenderableType]:
    """What would help, and what was tried."""
    parts: list[RenderableType] = []
    reason = reason_of(data["reason"])
    if reason.at is not None:
        parts.append(indented(Text(f"at {place(states, reason.at)}")))
    if relax := advice(reason.relax):
        parts.append(indented(Text.assemble(("help: ", "green"), relax)))
    if attempts := data["attempts"]:
        parts += titled("Tried", _tried(attempts))
    return parts


def _proven(file: Mapping[str, Any]) -> list[Text]:
    sides = ", ".join(
        f"{name} in [{exact(low)}, {exact(high)}]" for name, (low, high) in file["verified_on"].items()
    )
    solver = file["solver"]
    depends = ", ".join(solver["variables"]) if solver["degree"] else ""
    kind = f"of degree {solver['degree']} in {depends}" if depends else "constant"
    lower, upper = file["lower"], file["upper"]
    found = f"{solver['digits']} digits ({solver['route']})"
    return [
        Text(f"proven on {sides}: C1 and C2 by branch and bound, C3 exactly"),
        Text(f"{down(1 / upper[1])} I <= W <= {up(1 / lower[0])} I; W is {kind}, {found}"),
    ]


def _compared(rows: Sequence[Mapping[str, Any]]) -> RenderableType:
    shown = plain_table(
        ">rate", "least", ">condition number", ">beta/sqrt(a)", ">rho", ">Gamma (B)", "verdict"
    )
    for row in rows:
        verdict = row.get("verdict", "")
        shown.add_row(
            exact(row["rate"]),
            FLOORS[row["floor"]],
            up(row["condition_number"]),
            _number(row.get("input_gain")),
            _number(row.get("rho")),
            _number(row.get("adaptation_rate")),
            Text(verdict, style=VERDICTS.get(verdict, "")),
        )
    return shown


def _tried(attempts: Sequence[Mapping[str, Any]]) -> list[Text]:
    lines = [
        Text(f"rate {short(a['rate'], 6)}, degree {a['degree']}: {outcome(outcome_of(a['outcome']))}")
        for a in attempts[-_SHOWN:]
    ]
    left = len(attempts) - len(lines)
    return [*([Text(f"({left} attempts before these)", style="dim")] if left else []), *lines]


def _number(value: float | None) -> str:
    return UNKNOWN if value is None else up(value)

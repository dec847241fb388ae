"""The report of a synthesis: the metric and what was proven of it, the metrics compared, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.text import Text

from tubecert.digits import UNKNOWN, down, end, exact, short, up
from tubecert.expression import free_symbols, parse, symbol
from tubecert.printable import visible
from tubecert.report.claimed import place
from tubecert.report.cut import cut_short
from tubecert.report.layout import VERDICTS, indented, plain_table, titled
from tubecert.words.advice import advice
from tubecert.words.claims import message, outcome

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.certificate.metric_file import MetricFile
    from tubecert.certificate.searched import AttemptData, MetricRow, RateLimits, SearchData
    from tubecert.spec import Spec

FLOORS = {"identity": "condition", "input": "input gain"}
_SHOWN = 12  # attempts
_COLUMNS = (
    "rate in 1/s, omega in rad/s; omega and Gamma are those of certificate B. beta/sqrt(a): how strongly the metric "
    "lets inputs act over the tube (tubecert explain 'beta/sqrt(a)')."
)
_HARDLY = 1.05  # times as much
_NONE = "no metric that certifies was found by then"
_CAUSES = {
    "distance": "{more}: the distance that the uncertainty drives the state grows as 1/rate",
    "gains": "no gains suffice: the distance that the uncertainty drives the state leaves no room in the tube",
    "overshoot": "the tube does not fit into the safe set: the overshoot sqrt(A/a) of the initial error is too large",
    "no_metric": "no metric was found",
    "idle": "the filter would be slower than the contraction: more feedback, and nothing that adaptation needs",
    "input_gain": "{more}: the input gain beta/sqrt(a) grows",
    "tube": "{more}: the tube grows, and the constants over it",
}


def verdict_line(data: SearchData, file: MetricFile | None, name: str) -> Text:
    """What came of it, on one line."""
    if file is None:
        line = Text.assemble((data.verdict, f"bold {VERDICTS[data.verdict]}"), (f" {name}: ", "bold"))
        return line if data.reason is None else line.append(message(data.reason))
    line = Text.assemble(("metric proven", "bold green"), (f" {name}: ", "bold"))
    line.append(f"rate {exact(file.rate)} 1/s, condition number {up(file.condition_number.above)}")
    if file.margin is not None:
        line.append(f", margin {down(file.margin.below, 3)} 1/s")
    return line


def report(data: SearchData, file: MetricFile | None, system: Spec, target: str) -> list[RenderableType]:
    """The whole report as renderables; `target` is the metric file."""
    name = system.name
    parts: list[RenderableType] = [verdict_line(data, file, name)]
    if file is not None:
        parts += map(indented, _proven(file))
    if data.table:
        parts += titled("Metrics compared", [_compared(data.table), Text(_COLUMNS, style="dim")])
    if data.limits is not None and (lines := _limits(data.limits)):
        parts += titled("What limits the rate", lines)
    if data.cut is not None:
        parts += cut_short(data.cut, _NONE) if file is None else cut_short(data.cut)
    if file is None:
        return [*parts, *_failure(data, system.states)]
    certify = f"certify with it: tubecert certify {visible(system.path)} --metric {target}"
    if system.lacks:
        certify = f"to certify with it, add {' and '.join(system.lacks)} to {visible(system.path)}"
    return [*parts, Text(), Text(f"Metric: {target}"), Text(certify, style="dim")]


def _failure(data: SearchData, states: Sequence[str]) -> list[RenderableType]:
    """What would help, and what was tried."""
    parts: list[RenderableType] = []
    reason = data.reason
    if reason is not None and reason.at is not None:
        parts.append(indented(Text(f"at {place(states, reason.at)}")))
    if reason is not None and (relax := advice(reason.relax)):
        parts.append(indented(Text.assemble(("help: ", "green"), relax)))
    if data.attempts:
        parts += titled("Tried", _tried(data.attempts))
    return parts


def _proven(file: MetricFile) -> list[Text]:
    sides = ", ".join(
        f"{name} in [{end(low)}, {end(high)}]" for name, (low, high) in file.verified_on.items()
    )
    solver = file.solver
    found = f"{solver.digits} digits ({solver.route})"
    return [
        Text(f"proven on {sides}: C1 and C2 by branch and bound, C3 exactly"),
        Text(
            f"{down(1 / file.upper.above)} I <= W <= {up(1 / file.lower.below)} I; W {_kind(file)}, {found}"
        ),
    ]


def _kind(file: MetricFile) -> str:
    """What W depends on, read from its expressions: what was asked for may be another thing."""
    states = {name: symbol(name) for name in file.verified_on}
    entries = [parse(text, symbols=states).expression for row in file.dual_metric for text in row]
    moving = [name for name in states if name in free_symbols(entries)]
    return f"depends on {', '.join(moving)}" if moving else "is constant"


def _limits(limits: RateLimits) -> list[Text]:
    """What is against slower and against faster rates, in words."""
    lines = []
    for side, limit in (("slower", limits.slower), ("faster", limits.faster)):
        if limit is None:
            continue
        more = "more gain" if limit.factor is None else f"{short(limit.factor, 2)} times the gain"
        if limit.factor is not None and limit.factor < _HARDLY:
            more = "hardly more gain"
        lines.append(Text(f"{side}: at {exact(limit.rate)} 1/s {_CAUSES[limit.cause].format(more=more)}"))
    return lines


def _compared(rows: Sequence[MetricRow]) -> RenderableType:
    heads = ["least", ">condition number", ">beta/sqrt(a)", ">rho", ">omega", ">Gamma (B)", "verdict"]
    degrees = len({row.degree for row in rows}) > 1  # else all rows of a rate differ by what is least
    shown = plain_table(">rate", *([">degree"] if degrees else []), *heads)
    for row in rows:
        shown.add_row(
            exact(row.rate),
            *([str(row.degree)] if degrees else []),
            FLOORS[row.floor],
            up(row.condition_number),
            _number(row.input_gain),
            _number(row.rho),
            _number(row.bandwidth),
            _number(row.adaptation_rate),
            Text() if row.verdict is None else Text(row.verdict, style=VERDICTS[row.verdict]),
        )
    return shown


def _tried(attempts: Sequence[AttemptData]) -> list[Text]:
    lines = [
        Text(f"rate {short(a.rate, 6)}, degree {a.degree}: {outcome(a.outcome)}") for a in attempts[-_SHOWN:]
    ]
    left = len(attempts) - len(lines)
    return [*([Text(f"({left} attempts before these)", style="dim")] if left else []), *lines]


def _number(value: float | None) -> str:
    return UNKNOWN if value is None else up(value)

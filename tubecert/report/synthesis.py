"""A synthesis as a page: the metric and what was proven of it, the metrics compared, or why there is none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from tubecert.claims.advice import advice
from tubecert.digits import down, exact, short, up
from tubecert.expression import free_symbols, parse, symbol
from tubecert.report.claimed import box, place
from tubecert.report.page import Block, Facts, Items, Page, Section, Table, Words

if TYPE_CHECKING:
    from tubecert.certificate.result import MetricFile, MetricRow, RateLimits, SearchData
    from tubecert.claims.failures import Attempt

FLOORS = {"identity": "kappa", "input": "input gain"}
_SHOWN = 12  # attempts
_COLUMNS = (
    "rate in 1/s, omega in rad/s, kappa: condition number; omega and Gamma are those of the certificate that decides, "
    "else of B. Gamma |B|^2, in 1/s^2, compares metrics, since Gamma is of the coordinates of each tube. beta/sqrt(a): "
    "how strongly the metric lets inputs act over the tube (tubecert explain 'beta/sqrt(a)')."
)
_HARDLY = 1.05  # times as much
_BEST: Final = "this is the best of what was proven by then"
_NONE: Final = "no metric that certifies was found by then"
_CUT: Final = {  # why a search was ended before its end, and what that means for what is shown
    "deadline": "cut short by the deadline: {}",
    "interrupted": "interrupted: {}",
    "no_adaptation": "ended with the first metric whose tube needs no adaptation (certificate 0): one of less, or of a "
    "narrower tube, is looked for with --objective adaptation or tube",
    "plan": "ended after two rates at which the plan alone misses the dynamics by more than the tube allows: it is the "
    "plan that has to be mended",
}
_CAUSES = {
    "distance": "{more}: the distance beta/sqrt(a)/rate, by which |h| = 1 may drive the state, is more of the tube",
    "gains": "nothing is certified",
    "overshoot": "the tube does not fit into the safe set: the overshoot sqrt(A/a) of the initial error is too large",
    "no_metric": "no metric was found",
    "idle": "the filter is slower than the contraction already, and no faster rate was tried",
    "input_gain": "{more}: the input gain beta/sqrt(a) is more of the tube",
    "tube": "{more}: it is not beta/sqrt(a) that grows, but other constants over the tube",
}


def page_of(data: SearchData, file: MetricFile | None, name: str, states: Sequence[str] = ()) -> Page:
    """The page of a search in a system of this name; `file` is the metric, None if there is none."""
    first = Section(key="metric", title="Metric", blocks=tuple(_first(data, file, states)))
    tried = Section.each([("tried", "Tried", _tried(data.attempts))])
    return Page(
        name=name,
        verdict=data.verdict if file is None else "metric proven",
        summary=_numbers(file) if file is not None else data.reason.message if data.reason else "",
        sections=(first, *tried),
        about="synthesis",
    )


def _numbers(file: MetricFile) -> str:
    margin = "" if file.margin is None else f", margin {down(file.margin.below, 3)} 1/s"
    return f"rate {exact(file.rate)} 1/s, condition number {up(file.condition_number.above)}{margin}"


def _first(data: SearchData, file: MetricFile | None, states: Sequence[str]) -> Iterator[Block]:
    """What was proven, or what would help; the metrics that were compared."""
    reason = data.reason
    if file is not None:
        yield Facts.of(_proven(file))
    elif reason is not None:
        helped = ("at", place(states, reason.at) if reason.at else ""), ("help", advice(reason.relax))
        yield Facts.of((what, told) for what, told in helped if told)
    if data.table:
        yield _compared(data.table, file)
    if data.limits is not None and (lines := tuple(_limits(data.limits))):
        yield Items(title="What limits the rate", items=lines)
    if data.cut is not None:
        yield Words(text=_CUT[data.cut].format(_NONE if file is None else _BEST))


def _proven(file: MetricFile) -> Iterator[tuple[str, str]]:
    yield "proven on", f"{box(file.verified_on)}: C1 and C2 by branch and bound, C3 exactly"
    bounds = f"{down(1 / file.upper.above)} I <= W <= {up(1 / file.lower.below)} I"
    yield "W", f"{bounds}; W {_kind(file)}, {file.solver.digits} digits ({file.solver.route})"


def _kind(file: MetricFile) -> str:
    """What W depends on, read from its expressions: what was asked for may be another thing."""
    states = {name: symbol(name) for name in file.verified_on}
    entries = [parse(text, symbols=states).expression for row in file.dual_metric for text in row]
    moving = [name for name in states if name in free_symbols(entries)]
    return f"depends on {', '.join(moving)}" if moving else "is constant"


def _limits(limits: RateLimits) -> Iterator[str]:
    """What is against slower and against faster rates, in words."""
    for side, limit in (("slower", limits.slower), ("faster", limits.faster)):
        if limit is None:
            continue
        hardly = limit.factor is not None and limit.factor < _HARDLY
        often = "more of" if limit.factor is None else f"{short(limit.factor, 2)} times"
        more = f"{'hardly more of' if hardly else often} Gamma |B|^2"
        yield f"{side}: at {exact(limit.rate)} 1/s {_CAUSES[limit.cause].format(more=more)}"


def _compared(found: Sequence[MetricRow], file: MetricFile | None) -> Table:
    """A metric a row: first, where no screen cuts it off, the one of the file, known by its rate and kappa."""
    best = None if file is None else (file.rate, up(file.condition_number.above))
    chosen = [row for row in found if (row.rate, up(row.condition_number)) == best]
    found = [*chosen, *(row for row in found if row not in chosen)]
    heads = ["least", ">kappa", ">beta/sqrt(a)", ">rho", ">omega", ">Gamma", ">Gamma |B|^2", "!verdict"]
    degrees = len({row.degree for row in found}) > 1  # else all rows of a rate differ by what is least
    rows = (
        (
            exact(row.rate),
            *([str(row.degree)] if degrees else []),
            f"{FLOORS[row.floor]}{', chosen' if row in chosen else ''}",
            up(row.condition_number),
            *map(up, (row.input_gain, row.rho, row.bandwidth, row.adaptation_rate, row.demand)),
            row.verdict or "",
        )
        for row in found
    )
    return Table.of((">rate", *([">degree"] if degrees else []), *heads), rows, _COLUMNS)


def _tried(attempts: Sequence[Attempt]) -> Iterator[Block]:
    lines = [f"rate {short(a.rate, 6)}, degree {a.degree}: {a.outcome.told()}" for a in attempts[-_SHOWN:]]
    if left := len(attempts) - len(lines):
        yield Words(text=f"{left} attempts before these")
    if lines:
        yield Items(items=tuple(lines))

"""The sections of the report, each a title and what stands below it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import TYPE_CHECKING

from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tubecert.bounds.meanings import meaning
from tubecert.certificate.result import Bound, MetricData, Result, TubeData
from tubecert.claims.family import Reason
from tubecert.digits import UNKNOWN, down, end, exact, short, up
from tubecert.kinds import ALONE, DISTANCE, RATES
from tubecert.kinds.alone import AloneData
from tubecert.report.claimed import point
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.layout import VERDICTS, plain_table
from tubecert.report.reach import input_lines, safe_set, tube_lines
from tubecert.verdict import Verdict
from tubecert.words.advice import advice
from tubecert.words.assumptions import assumed
from tubecert.words.claims import message, title
from tubecert.words.conditions import SAYS

if TYPE_CHECKING:
    from rich.console import RenderableType

Section = tuple[str, list["RenderableType"]]


def of(result: Result, *, verbose: bool) -> Iterator[Section]:
    """The sections that a result has something to say in."""
    failed = failures(result)
    holding = [item for item in result.reasons if item.verdict is Verdict.CERTIFIED]
    if failed:
        yield "Not certified", failed
    if result.sections:
        yield "Gains", _gains(result)
    if holding:
        yield "What limits them", [_reason(result, item) for item in holding]
    if result.tube is not None:
        yield "Tube", tube_lines(result, result.tube)
    if result.inputs:
        yield "Inputs", [Text(line) for own in result.inputs for line in input_lines(result, own)]
    if result.metric is not None:
        yield "Metric", _metric(result, result.metric)
    if verbose and result.constants:
        yield "Constants over the tube", [_constants(result)]
    yield "Assumed, not proven", _assumptions(result, verbose)


# -- why not


def failures(result: Result) -> list[RenderableType]:
    """What is not proven, each with what would help."""
    return [_reason(result, item) for item in result.failed]


def _reason(result: Result, reason: Reason) -> Group:
    verdict = reason.verdict
    told = f": {message(reason)}"
    text = Text.assemble((f"{verdict} ", VERDICTS[verdict]), (title(reason.claim), "bold"), told)
    more = []
    if reason.at is not None:
        more.append(Text(f"at {point(result, reason.at)}"))
    if relax := advice(reason.relax, result.spec.effective.uncertainty.h):
        more.append(Text.assemble(("help: ", "green"), relax))
    return Group(text, *(Padding(line, (0, 0, 0, 2)) for line in more))


# -- gains


def _gains(result: Result) -> list[RenderableType]:
    found = list(rows(result))
    body: list[RenderableType] = []
    if found:
        table = plain_table("certificate", "gains", "verdict", ">omega", ">Gamma", "margin left")
        before = ""
        for row in found:
            table.add_row(
                "" if row.section == before else NAMES[row.section],
                f"{row.which} *" if row.decides else row.which,
                Text(row.verdict, style=VERDICTS[row.verdict]),
                *(exact(gain) if gain is not None else "" for gain in gain_columns(row)),
                row.slack,
            )
            before = row.section
        body.append(table)
        if any(row.decides for row in found):
            body.append(
                Text(
                    "Each row stands on its own: do not take omega from one row and Gamma from another. The row marked "
                    "* decides the verdict. omega is in rad/s. Gains of a row that is certified are the least that "
                    "were proven, so a margin of next to nothing is no sign of danger.",
                    style="dim",
                )
            )
    missing = [
        NAMES[key] for key in NAMES if key in result.sections and all(row.section != key for row in found)
    ]
    body += [Text(f"{title}: no gains were found") for title in missing]
    lines = (*less_by_distance(result), *beyond_its_theorem(result), *without_adaptation(result))
    body += [Text(line) for line in lines]
    return body


def less_by_distance(result: Result) -> Iterator[str]:
    """That A decides unasked, though B is certified with smaller gains: which, and the key."""
    if result.spec.effective.says_what_decides or result.decided_by != (RATES.key,):
        return
    found = [
        row for row in rows(result) if row.pair.adaptation_rate is not None and row.pair.bandwidth is not None
    ]
    own = [row for row in found if row.decides]
    others = [row for row in found if row.section == DISTANCE.key and row.verdict is Verdict.CERTIFIED]
    if not own or not others:
        return
    best = min(others, key=_adaptation)
    if 2 * _adaptation(best) <= _adaptation(own[0]) or own[0].verdict is not Verdict.CERTIFIED:
        yield (
            f"The specification does not say what decides: A does. B holds the same tube with {best.text()}: "
            "conditions: {decides: B} in the specification, or --conditions B, takes it."
        )


def _adaptation(row: Gains) -> Fraction:
    return row.pair.adaptation_rate or Fraction(0)


def beyond_its_theorem(result: Result) -> Iterator[str]:
    """Why certificate A decides nothing though it has gains: what acts is more than it is stated for."""
    section = result.sections.get(RATES.key)
    acts = result.claim.wind is not None or result.claim.parameters is not None
    if acts and section is not None and section.verdict == Verdict.UNDECIDED:
        yield f"{NAMES[RATES.key]} is undecided: {SAYS['wind_not_covered']}."


def without_adaptation(result: Result) -> Iterator[str]:
    """What adaptation is for: how much uncertainty the feedback alone can take in this tube."""
    section, h = result.sections.get(ALONE.key), result.constants.get("h")
    if not isinstance(section, AloneData) or h is None or h.above is None:
        return
    limit = (
        "no |h|" if section.uncertainty_limit is None else f"every |h| < {down(section.uncertainty_limit)}"
    )
    joined = result.spec.effective.part("disturbance") or not all(map(_is_one, _parameters(result)))
    whole = "|h| with what wind and parameters add to it" if joined else "|h|"
    end = ": this tube needs no adaptation." if section.verdict is Verdict.CERTIFIED else "."
    yield f"In this tube the feedback alone can take {limit}; the uncertainty has {whole} <= {up(h.above)}{end}"


def _parameters(result: Result) -> Iterable[object]:
    """The values of parameters: texts, or ranges."""
    known: Mapping[str, object] = result.spec.effective.part("system").get("parameters", {})
    return known.values()


def _is_one(value: object) -> bool:
    return isinstance(value, str)


def gain_columns(row: Gains) -> tuple[Fraction | None, Fraction | None]:
    """Bandwidth and adaptation rate."""
    return row.pair.bandwidth, row.pair.adaptation_rate


# -- tube and metric


def _metric(result: Result, metric: MetricData) -> list[RenderableType]:
    body = [f"rate {short(metric.rate, 12)} 1/s: {metric.verdict} on the safe set"]
    if metric.largest_rate is not None:
        body[0] += f"; the metric supports rates up to {down(metric.largest_rate.below, 7)} 1/s"
    if metric.margin is not None and metric.verdict is Verdict.CERTIFIED:
        body[0] += f" (margin {down(metric.margin.below, 3)} 1/s)"
    body += [f"{bounds} {words}" for words, bounds in metric_bounds(metric, result.tube)]
    sides = (f"{name} in [{end(low)}, {end(high)}]" for name, (low, high) in safe_set(result))
    return [Text(line) for line in [*body, f"safe set: {', '.join(sides)}"]]


def metric_bounds(metric: MetricData, tube: TubeData | None) -> Iterator[tuple[str, str]]:
    """Where the metric is bounded, and by what; over a tube with coordinates, by S'S."""
    plain = tube is None or tube.coordinates is None
    unit = "I" if plain else "S'S"
    for words, a, A, of in (
        (
            "over the tube" if plain else "over the tube (z = S x: its coordinates)",
            metric.lower,
            metric.upper,
            unit,
        ),
        ("on the safe set", metric.lower_on_set, metric.upper_on_set, "I"),
    ):
        if a is not None and A is not None:
            yield words, f"{down(a.below)} {of} <= M <= {up(A.above)} {of}"


def _constants(result: Result) -> Table:
    table = plain_table("symbol", "what it is, and where", ">proven", "unit", ">gap", wrapped=1)
    for name, item in result.constants.items():
        own = meaning(name)
        table.add_row(own.symbol, _described(result, name, item), proven(name, item), own.unit, gap(item))
    return table


def _described(result: Result, name: str, item: Bound) -> Text:
    text = Text(described(name))
    if item.at is not None and (where := point(result, item.at)):
        text.append(f"\nat {where}", style="dim")
    return text


def described(name: str) -> str:
    """A constant in words, whatever its name."""
    return meaning(name).words


def proven(name: str, item: Bound) -> str:
    """The side that the certificate uses: from below for an infimum, from above for a supremum."""
    if meaning(name).side == "below":
        return f">= {down(item.below, 6)}"
    return f"<= {up(item.above, 6)}"


def gap(item: Bound) -> str:
    """How far the two proven sides are apart, relative to the larger one."""
    low, high = item.below, item.above
    if low is None or high is None or low < 0 < high:
        return UNKNOWN
    return "exact" if low == high else f"{up(100 * (high - low) / max(abs(low), abs(high)), 2)} %"


# -- assumptions


def _assumptions(result: Result, verbose: bool) -> list[RenderableType]:
    stated, declared = result.assumptions, result.declared
    believed = [
        f"declared, believed as given: {', '.join(f'{k} <= {exact(v)}' for k, v in declared.items())}"
    ]
    if verbose:
        table = Table.grid(padding=(0, 1, 0, 0))
        for item in [*map(assumed, stated), *(believed if declared else [])]:
            table.add_row("-", Text(item))
        return [table]
    test = None if result.metric is None else result.metric.unique_geodesics
    proven = test is not None and test.holds
    geodesics = "exact geodesics (their uniqueness is proven)" if proven else "exact and unique geodesics"
    brief = (
        f"exact continuous-time control, full state, no noise, delay or saturation; {geodesics}; filter "
        f"and predictor start at rest; the uncertainty is as specified ({len(stated)} in all, -v shows them)"
    )
    return [Text(line) for line in [brief, *(believed if declared else [])]]

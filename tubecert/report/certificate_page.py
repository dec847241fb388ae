"""A certificate as a page: what a screen shows first, then which sections there are, and what each one says.

In: the certificate as data. Out: a `Page`, which terminals, HTML, Markdown and notebooks show. Bounds from above are
rounded up, bounds from below down.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from math import isfinite

from tubecert.bounds.constants import EVERY, meaning
from tubecert.certificate.result import Bound, Certificate, MetricData, Result, TubeData
from tubecert.claims.conditions import SAYS, SHOWN, condition_name, equation
from tubecert.claims.statements import InputWithinLimits
from tubecert.digits import UNKNOWN, down, exact, short, up
from tubecert.enclosure.constant import Constant
from tubecert.records import to_json
from tubecert.report import claimed, reach
from tubecert.report.certificate_brief import first_blocks, reasons
from tubecert.report.figures_gains import trade_off
from tubecert.report.figures_tube import input_figures, state_figures, tube_figures
from tubecert.report.gains import NAMES, Gains, deciding, rows
from tubecert.report.outline import level_set, widths
from tubecert.report.page import (
    Block,
    Cell,
    Facts,
    Figures,
    Items,
    Listing,
    Page,
    Section,
    Table,
    Words,
)
from tubecert.report.page_origin import check_again, provenance, system
from tubecert.report.page_simulation import Simulated, simulated_blocks
from tubecert.report.shares import filled
from tubecert.verdict import Verdict

_ELLIPSE = (
    "The tube in each plane: the projection of the states whose Riemannian distance to the plan stays below the proven "
    "bound, an ellipse around every point of the plan."
)
_CUT = (
    "The tube in each plane: what the proven radius and the half-widths leave, around every point of the plan. The "
    "metric depends on the state, so the states that are nearer than the proven distance are fewer than what is drawn."
)
_SHARES = (
    "Shares of what the contraction can make good at the edge of the proven tube, from above. What has a large share "
    "makes the tube wide; a better plan or model helps there. What is missing to 100 % is the margin. The gains of "
    "each certificate were chosen by themselves, so columns need not agree."
)
_MARGIN = (
    "A margin is (allowed - needed)/allowed: positive means that the condition holds. Its lower side is proven; the "
    "upper side is what the margin can be at most, whatever the constants are within their enclosures."
)
_ROWS = (
    "Each row stands on its own: do not take ω from one row and Γ from another. The row marked * decides the verdict. "
    "Gains that are certified are the least that were proven, so a margin of next to nothing is no sign of danger."
)
_NOTES = "Advice, curves of gains, where constants are largest and points to draw the plan by"
_INPUTS = (
    "Proven for every uncertainty of the class: what the plan needs, and what feedback and adaptation add at most. "
    "Used: 0 % in the middle of the limits, 100 % at one of them. The verdict is about the loops that decide."
)
_NO_LIMITS = (
    "The specification gives no limits of the inputs, so nothing is claimed of them; figures show the plan's."
)


def page_of(certificate: Certificate, simulated: Simulated | None = None, *, all_of_it: bool = True) -> Page:
    """The page of a certificate, the same once it is read back; or its first section alone, and nothing is drawn."""
    result = certificate.result
    holds = result.verdict is Verdict.CERTIFIED
    return Page(
        name=result.spec.effective.name,
        verdict=result.verdict,
        summary=_numbers(result) if holds else "" if result.reason is None else result.reason.sentence,
        claim=_claim(result) if holds else "",
        meaning=_meaning(result),
        caveat=claimed.NOT_RECHECKED,
        sections=tuple(islice(Section.each(_sections(certificate, simulated)), None if all_of_it else 1)),
    )


def _claim(result: Result) -> str:
    return f"the state stays in the tube around {claimed.plan_words(result)} {claimed.span(result)}"


def _numbers(result: Result) -> str:
    """The radius and the gains of a certified verdict."""
    chosen, extent = deciding(result), reach.extent(result)
    numbers = [f"rho = {extent}" if reach.is_radius(result) else extent]
    return "; ".join([*numbers, *(gains.text(titled=len(chosen) > 1) for gains in chosen)])


def _meaning(result: Result) -> str:
    """What the verdict says, and what it does not say."""
    match result.verdict:
        case Verdict.CERTIFIED:
            loops = "; or ".join(gains.words() for gains in deciding(result))
            return (
                f"With this metric, {loops}, the state stays within {reach.extent(result)} of "
                f"{claimed.plan_words(result)} {claimed.span(result)} if it starts {claimed.start_words(result)}, "
                "under the assumptions of the certificate."
            )
        case Verdict.REFUTED if result.reason and isinstance(result.reason.claim, InputWithinLimits):
            return "The plan itself asks more of an input than its limits allow, whatever the gains."
        case Verdict.REFUTED if result.tube is not None and result.tube.rho_r is not None:
            return (
                "That condition is proven not to hold. It is a sufficient one: that it fails does not prove that "
                "the state leaves the tube."
            )
        case Verdict.REFUTED:
            return "That claim is proven false, so nothing that rests on it is certified."
        case _:
            return "This is neither proven nor refuted; it must not be relied on."


def _sections(
    certificate: Certificate, simulated: Simulated | None
) -> Iterator[tuple[str, str, Iterable[Block]]]:
    result = certificate.result
    yield "brief", "In brief", first_blocks(result)
    yield "gains", "Gains", _gains(result)
    yield "fills", "What fills the tube", _filled(result)
    yield "tube", "Safe set" if result.tube is None else "Tube", _tube(result)
    yield "inputs", "Inputs", _inputs(result)
    yield "conditions", "Conditions and margins", _conditions(result)
    yield "simulation", "Simulation", simulated_blocks(simulated)
    yield "rests-on", "What this rests on", _rests_on(result)
    yield "metric", "Metric", _metric(result.metric, result.tube)
    yield "constants", "Constants over the tube", _constants(result)
    yield "system", "The specification", system(result.spec.effective, to_json(result.overrides))
    yield "provenance", "Provenance", provenance(certificate)
    yield "check", "Check it again", check_again(_NOTES)


# -- section by section


def _gains(result: Result) -> Iterator[Block]:
    if not result.sections:
        return
    found = list(rows(result))
    columns = ("certificate", "gains", "!verdict", ">ω (rad/s)", ">Γ", ">margin left")
    if found:
        note = _ROWS if any(row.decides for row in found) else ""
        yield Table.of(columns, map(_gains_row, found), note)
    known = {row.section for row in found}
    if missing := [NAMES[key] for key in NAMES if key in result.sections and key not in known]:
        yield Words(text=f"No gains were found for {', '.join(missing)}.")
    yield from reasons(result, [each for each in result.reasons if each.verdict is Verdict.CERTIFIED])
    chart = trade_off(result)
    if chart is not None and any(mark.kind == "line" for mark in chart.marks):
        yield Figures(figures=(chart,))


def _gains_row(row: Gains) -> tuple[str, ...]:
    chosen = f"{row.chosen} *" if row.decides else row.chosen
    gains = ("" if gain is None else exact(gain) for gain in (row.pair.bandwidth, row.pair.adaptation_rate))
    return NAMES[row.section], chosen, row.verdict, *gains, row.slack


def _filled(result: Result) -> Iterator[Block]:
    """What fills the tube of every kind that is certified, a column each."""
    found = filled(result)
    causes = dict.fromkeys(cause for shares in found.values() for cause in shares)
    if found:
        yield Table(
            columns=("cause", *(NAMES[key] for key in found)),
            rows=tuple(
                (Cell(text=each), *(_share(own.get(each)) for own in found.values())) for each in causes
            ),
            note=_SHARES,
        )


def _share(share: float | None) -> Cell:
    if share is None:
        return Cell(text="", kind="number")
    return Cell(text=f"{up(100 * share, 3)} %", kind="number", share=min(1.0, share))


def _tube(result: Result) -> Iterator[Block]:
    if result.tube is not None:
        yield Facts.of(_radii(result, result.tube))
    if figures := tuple(tube_figures(result)):
        yield Figures(figures=figures)
        if widths(result) is not None:
            yield Words(text=_CUT if level_set(result) is None else _ELLIPSE)
    if figures := tuple(state_figures(result)):
        yield Figures(figures=figures)


def _radii(result: Result, tube: TubeData) -> Iterator[tuple[str, str]]:
    """What the first section does not say of it."""
    yield "epsilon", short(tube.epsilon)
    if tube.coordinates is not None:
        yield "radius rho", reach.radii(tube)
        yield (
            "measured by",
            "z = S x, in which rho, rho_a and epsilon are lengths, whatever the units of states",
        )
        yield "epsilon, by state", reach.in_states(result, tube, tube.epsilon, "epsilon")
    for words, rest in reach.long_run(result):
        yield f"in the long run, {words}", rest


def _inputs(result: Result) -> Iterator[Block]:
    columns = (
        "input", "limits", "!verdict", ">on the plan", "loop of", ">stays within", ">used", ">feedback adds",
        ">adaptation adds",
    )  # fmt: skip
    if result.inputs:
        yield Table.of(columns, _input_rows(result), _INPUTS)
    if figures := tuple(input_figures(result)):
        yield Figures(figures=figures)
        if not result.inputs:
            yield Words(text=_NO_LIMITS)


def _input_rows(result: Result) -> Iterator[tuple[str, ...]]:
    """An input with every kind that bounds it, in their order; one row without any if there is none."""
    for own in result.inputs:
        name, limits = claimed.labelled(own.input, result.spec.effective.system), reach.ends_of(own.limits)
        first = name, limits, own.verdict, reach.span_of(own.plan.least.below, own.plan.greatest.above)
        for key in (key for key in NAMES if key in own.bounds):
            bound = own.bounds[key]
            span, used = reach.span_of(bound.least, bound.greatest), reach.used(own, key)
            yield (*first, NAMES[key], span, used, up(bound.feedback), up(bound.adaptation))
        if not own.bounds:
            yield (*first, *(UNKNOWN,) * 5)


def _conditions(result: Result) -> Iterator[Block]:
    """The conditions of each certificate at its gains with what is left of each, then what is missing without gains."""
    pairs = ((key, own.decisive(asked=result.asked)) for key, own in result.sections.items())
    found = [
        _condition(NAMES[key], condition, margin)
        for key, pair in pairs
        for condition, margin in (pair.margins.items() if pair is not None else ())
    ]
    if found:
        columns = ("certificate", "condition", "what it says", "proven margin", "at most")
        yield Table(columns=columns, rows=tuple(found), note=_MARGIN)
    for key, section in result.sections.items():
        for item in section.shortfalls:
            if item.needed is not None and item.allowed is not None:
                told = f"{up(item.needed)} is needed, {down(item.allowed)} is allowed"
                yield Words(text=f"{NAMES[key]}, {condition_name(item.condition)}: {told}.")


def _condition(title: str, condition: str, margin: Constant) -> tuple[Cell, ...]:
    low, high = margin.below, margin.above
    return (
        Cell(text=title),
        Cell(text=SHOWN.get(condition, equation(condition))),
        Cell(text=SAYS[condition]),
        Cell(text=_percent(low, down), kind="number", share=min(low, 1.0) if low > 0 else None),
        Cell(text=_percent(high, up), kind="number"),
    )


def _percent(share: float, shown: Callable[[float, int], str]) -> str:
    return f"{shown(100 * share, 3)} %" if isfinite(share) else UNKNOWN


def _rests_on(result: Result) -> Iterator[Block]:
    """What the specification declares and nobody proves, and what is assumed."""
    names = {"h": "|h|", "h_x": "|dh/dx|", "h_t": "|dh/dt|"}
    declared = [f"{names.get(k, k)} <= {up(v, 12)} on the tube" for k, v in sorted(result.declared.items())]
    yield Items(title="Declared, believed as given", items=tuple(declared) or ("nothing",))
    yield Items(title="Assumed, not proven", items=tuple(item.told() for item in result.assumptions))


def _metric(metric: MetricData | None, tube: TubeData | None) -> Iterator[Block]:
    if metric is None:
        return
    facts = [("verdict", str(metric.verdict)), ("rate", f"{exact(metric.rate)} 1/s")]
    if metric.largest_rate is not None:
        facts.append(("supports rates up to", f"{down(metric.largest_rate.below, 7)} 1/s"))
    yield Facts.of([*facts, *_metric_bounds(metric, tube)])
    yield Listing(text=_entries(metric))
    yield Words(text="W is the dual metric, the inverse of M; it is symmetric.")


def _metric_bounds(metric: MetricData, tube: TubeData | None) -> Iterator[tuple[str, str]]:
    """Where the metric is bounded, and by what; over a tube with coordinates, by S'S."""
    plain = tube is None or tube.coordinates is None
    over, unit = ("over the tube", "I") if plain else ("over the tube (z = S x: its coordinates)", "S'S")
    for words, a, A, of in (
        (over, metric.lower, metric.upper, unit),
        ("on the safe set", metric.lower_on_set, metric.upper_on_set, "I"),
    ):
        if a is not None and A is not None:
            yield words, f"{down(a.below)} {of} <= M <= {up(A.above)} {of}"


def _entries(metric: MetricData) -> str:
    """The upper triangle of W, an entry on a line."""
    return "\n".join(
        f"W[{i + 1},{j + 1}] = {entry}"
        for i, row in enumerate(metric.dual_metric)
        for j, entry in enumerate(row[i:], start=i)
    )


def _constants(result: Result) -> Iterator[Block]:
    if not result.constants:
        return
    yield Table(
        columns=("symbol", "meaning", "proven", "unit", "equation", "gap"),
        rows=tuple(_constant(result, name, result.constants[name]) for name in _order(result.constants)),
        note="The proven side is the one that the conditions use. The gap is how far both proven sides are apart. "
        "In units, x and u stand for the units of states and inputs, d for Riemannian distance.",
    )


def _order(constants: Mapping[str, Bound]) -> list[str]:
    """The constants of the paper first, then what follows from them, each in the order of its table."""
    known = {name: i for i, name in enumerate(EVERY)}
    return sorted(constants, key=lambda name: (known.get(name, len(known)), name))


def _constant(result: Result, name: str, item: Bound) -> tuple[Cell, ...]:
    at, own = "" if item.at is None else claimed.point(result, item.at), meaning(name)
    return (
        Cell(text=own.symbol, kind="code"),
        Cell(text=meaning(name).words, note=f"at {at}" if at else ""),
        Cell(text=_safe_side(name, item), kind="number"),
        Cell(text=own.unit if own.unit != "1" else UNKNOWN),
        Cell(text=own.equation),
        Cell(text=_gap(item), kind="number"),
    )


def _safe_side(name: str, item: Bound) -> str:
    """The side that the certificate uses: from below for an infimum, from above for a supremum."""
    if meaning(name).side == "below":
        return f">= {down(item.below, 6)}"
    return f"<= {up(item.above, 6)}"


def _gap(item: Bound) -> str:
    """How far the two proven sides are apart, relative to the larger one."""
    low, high = item.below, item.above
    if low is None or high is None or low < 0 < high:
        return UNKNOWN
    return "exact" if low == high else f"{up(100 * (high - low) / max(abs(low), abs(high)), 2)} %"

"""A certificate as a page: what a screen shows first, then which sections there are, and what each one says.

In: the certificate as data. Out: a `Page`, which terminals, HTML, Markdown and notebooks show. Bounds from above are
rounded up, bounds from below down.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import islice

from tubecert.bounds.meanings import EVERY, meaning
from tubecert.certificate.follows import InputData
from tubecert.certificate.result import Bound, Certificate, MetricData, Result, TubeData
from tubecert.claims import family as claims
from tubecert.claims.gains import GainsSuffice
from tubecert.claims.limits import InputWithinLimits
from tubecert.digits import UNKNOWN, down, end, exact, short, up
from tubecert.kinds import ALONE, DISTANCE, RATES
from tubecert.kinds.alone import AloneData
from tubecert.records import to_json
from tubecert.report import claimed, reach
from tubecert.report.figures_gains import gain_figures
from tubecert.report.figures_time import input_figures, state_figures
from tubecert.report.figures_tube import places, suprema_figures, tube_figures
from tubecert.report.gains import NAMES, Gains, deciding, rows
from tubecert.report.mathml import matrix, named
from tubecert.report.outline import tube_outline, widths
from tubecert.report.page import (
    Block,
    Cell,
    Facts,
    Figures,
    Items,
    Listing,
    Page,
    Reason,
    Section,
    Table,
    Tile,
    Words,
)
from tubecert.report.page_conditions import conditions
from tubecert.report.page_origin import check_again, provenance, system
from tubecert.report.page_simulation import Simulated, simulated_blocks
from tubecert.report.page_trust import declared, proven
from tubecert.report.shares import filled
from tubecert.verdict import Verdict
from tubecert.words.advice import advice
from tubecert.words.assumptions import assumed
from tubecert.words.claims import message, sentence, title
from tubecert.words.conditions import SAYS, equation
from tubecert.words.sampled_loop import family

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
_NOTES = "Advice, curves of gains, where constants are largest and points to draw the plan by"
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
        summary=_numbers(result) if holds else "" if result.reason is None else sentence(result.reason),
        claim=_claim(result) if holds else "",
        meaning=_meaning(result),
        caveat=claimed.NOT_RECHECKED,
        tiles=tuple(_tiles(result)),
        sections=tuple(islice(_sections(certificate, simulated), None if all_of_it else 1)),
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
                "under the assumptions below."
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


def _tiles(result: Result) -> Iterator[Tile]:
    """The numbers that a certified verdict is about; other verdicts have none to rely on."""
    if result.verdict is not Verdict.CERTIFIED:
        return
    yield from _sizes(result)
    chosen = deciding(result)
    for row in chosen:
        who = f", {NAMES[row.section]}" if len(chosen) > 1 else ""
        if row.pair.bandwidth is not None:
            yield Tile(symbol="ω", value=exact(row.pair.bandwidth), unit="rad/s", words=f"bandwidth{who}")
        if row.pair.adaptation_rate is not None:
            yield Tile(
                symbol="Γ", value=exact(row.pair.adaptation_rate), unit="", words=f"adaptation rate{who}"
            )


_MOST_TILES = 4  # half-widths that are shown first


def _sizes(result: Result) -> Iterator[Tile]:
    """How wide the tube is: its radius, or half-widths where that is no length in the states, or is not proven."""
    units, known = result.spec.effective.system.units, widths(result)
    if reach.is_radius(result) or known is None:
        yield Tile(symbol="ρ", value=up(claimed.radius(result)), unit="", words="radius of the tube")
        return
    for name, width in list(known.items())[:_MOST_TILES]:
        yield Tile(symbol=name, value=up(width), unit=units.get(name, ""), words="half-width")


def _sections(certificate: Certificate, simulated: Simulated | None) -> Iterator[Section]:
    result = certificate.result
    brief = Facts(facts=tuple((name, Cell(text=told)) for name, told in _brief(result)))
    beside = [reason for reason in result.failed if reason is not result.reason]
    yield Section(key="brief", title="In brief", blocks=(brief, *reasons(result, beside)))
    if result.sections:
        yield Section(key="gains", title="Gains", blocks=tuple(_gains(result)))
    if blocks := tuple(_filled(result)):
        yield Section(key="fills", title="What fills the tube", blocks=blocks)
    if blocks := tuple(_tube(result)):
        yield Section(key="tube", title="Safe set" if result.tube is None else "Tube", blocks=blocks)
    if blocks := tuple(_inputs(result)):
        yield Section(key="inputs", title="Inputs", blocks=blocks)
    if result.sections:
        yield Section(key="conditions", title="Conditions and margins", blocks=tuple(conditions(result)))
    if simulated is not None:
        yield Section(key="simulation", title="Simulation", blocks=tuple(simulated_blocks(simulated)))
    yield Section(key="rests-on", title="What this rests on", blocks=tuple(_rests_on(result)))
    if result.metric is not None:
        yield Section(key="metric", title="Metric", blocks=tuple(_metric(result.metric, result.tube)))
    if result.constants:
        yield Section(key="constants", title="Constants over the tube", blocks=tuple(_constants(result)))
    yield Section(
        key="system",
        title="The specification",
        blocks=tuple(system(result.spec.effective, to_json(result.overrides))),
    )
    yield Section(key="provenance", title="Provenance", blocks=tuple(provenance(certificate)))
    again = check_again(result.spec.effective.name, _NOTES)
    yield Section(key="check", title="Check it again", blocks=tuple(again))


def reasons(result: Result, some: Sequence[claims.Reason] | None = None) -> tuple[Reason, ...]:
    """Why the verdict is what it is, in words; or what only `some` of the reasons say."""
    return tuple(
        Reason(
            verdict=reason.verdict,
            claim=title(reason.claim),
            message=message(reason),
            at="" if reason.at is None else claimed.point(result, reason.at),
            relax=advice(reason.relax, result.spec.effective.uncertainty.h),
        )
        for reason in (result.reasons if some is None else some)
    )


# -- in brief


def _brief(result: Result) -> Iterator[tuple[str, str]]:
    """What is seen first, a line each where there is room."""
    if result.reason is not None and result.reason.verdict is not Verdict.CERTIFIED:
        [why] = reasons(result, [result.reason])  # what it says stands in the first line
        yield from ((name, told) for name, told in (("at", why.at), ("help", why.relax)) if told)
    if result.claim.plans is not None:
        yield "plans", family(result.spec.effective)
    yield "start", claimed.start_words(result)
    if result.tube is not None:
        yield from _brief_tube(result, result.tube)
    for row in deciding(result):
        how = "" if row.verdict is Verdict.CERTIFIED else f"{row.verdict} "
        yield "gains", f"{row.text()}, {how}by certificate {NAMES[row.section]}"
    yield from less_by_distance(result)
    yield from beyond_its_theorem(result)
    if result.verdict is Verdict.CERTIFIED:  # else it says above what would help
        yield from (row for reason in result.reasons for row in _limits(reason))
    for own in result.inputs:
        yield from ((f"input {own.input}", told) for told in reach.input_lines(result, own))
    yield from (("clearance", told) for told in reach.clearances(result))
    yield from without_adaptation(result)
    if result.declared:
        yield (
            "declared",
            f"{', '.join(f'{k} <= {exact(v)}' for k, v in result.declared.items())}: believed as given",
        )
    every = len(result.assumptions)
    yield (
        "assumed",
        f"exact continuous-time control, full state, no noise, delay or saturation; {every} in all",
    )


def _brief_tube(result: Result, tube: TubeData) -> Iterator[tuple[str, str]]:
    radii = f"rho = {reach.radii(tube)}"
    if tube.half_widths is None:
        yield "tube", radii
    else:
        known = reach.half_widths(result, tube.half_widths, sign="+-")
        yield "tube", f"{known}; {radii}" if tube.coordinates is None else known
        yield from (("wish", told) for told in reach.asked_for(result, tube.half_widths))
    own = result.spec.effective.tube.rho_a
    asked = own if result.overrides.rho_a is None else result.overrides.rho_a
    if asked is not None and tube.rho_r is not None and tube.rho_a < asked:
        name = "tube.rho_a" if result.overrides.rho_a is None else "--rho-a"
        yield (
            "rho_a",
            f"{name} {short(asked)} is more than the start leaves of this tube: half of that is taken",
        )
    yield from (("plan", told) for told in reach.excursion(result))
    chosen = [NAMES[key] for key in result.decided_by]
    yield from (("long run", rest) for words, rest in reach.long_run(result) if words in chosen)


def _limits(reason: claims.Reason) -> Iterator[tuple[str, str]]:
    """What sets certified gains, and what would lower them most."""
    if isinstance(reason.claim, GainsSuffice) and reason.claim.binds is not None:
        yield "limit", f"{equation(reason.claim.binds)} sets the bandwidth"
    if reason.relax:
        yield "help", advice(reason.relax[:1])


def less_by_distance(result: Result) -> Iterator[tuple[str, str]]:
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
            "or",
            f"{best.text()}, by {NAMES[best.section]}: --conditions B",
        )


def _adaptation(row: Gains) -> Fraction:
    return row.pair.adaptation_rate or Fraction(0)


def beyond_its_theorem(result: Result) -> Iterator[tuple[str, str]]:
    """Why certificate A is undecided though it has gains; where it decides, and so is told why, what to do."""
    section = result.sections.get(RATES.key)
    acts = result.claim.wind is not None or result.claim.parameters is not None
    if not acts or section is None or section.verdict != Verdict.UNDECIDED:
        return
    if RATES.key not in result.decided_by:
        yield "undecided", f"certificate {NAMES[RATES.key]}: {SAYS['wind_not_covered']}"
    elif not list(less_by_distance(result)):
        yield "help", f"{NAMES[DISTANCE.key]} is stated for them as well: --conditions B"


def without_adaptation(result: Result) -> Iterator[tuple[str, str]]:
    """What adaptation is for: how much uncertainty the feedback alone can take in this tube."""
    section, h = result.sections.get(ALONE.key), result.constants.get("h")
    if not isinstance(section, AloneData) or h is None or h.above is None:
        return
    limit = (
        "no |h|" if section.uncertainty_limit is None else f"every |h| < {down(section.uncertainty_limit)}"
    )
    known: Mapping[str, object] = result.spec.effective.part("system").get("parameters", {})
    ranges = any(not isinstance(value, str) for value in known.values())
    joined = result.spec.effective.part("disturbance") or ranges
    whole = "|h| with what wind and parameters add to it" if joined else "|h|"
    end = ": this tube needs no adaptation" if section.verdict is Verdict.CERTIFIED else ""
    yield "alone", f"feedback alone can take {limit}; there is {whole} <= {up(h.above)}{end}"


# -- section by section


def gains_table(result: Result) -> Table | None:
    """Every set of gains, a row each; None if there is none."""
    found = list(rows(result))
    if not found:
        return None
    columns = ("certificate", "gains", "verdict", "ω (rad/s)", "Γ", "margin left")
    note = (
        "Each row stands on its own: do not take ω from one row and Γ from another. The row marked * "
        "decides the verdict. Gains that are certified are the least that were proven, so a margin of next to nothing "
        "is no sign of danger."
    )
    decided = any(row.decides for row in found)
    return Table(columns=columns, rows=tuple(map(_gains_row, found)), note=note if decided else "")


def _gains(result: Result) -> Iterator[Block]:
    found = list(rows(result))
    if (table := gains_table(result)) is not None:
        yield table
    if missing := [
        NAMES[key] for key in NAMES if key in result.sections and all(r.section != key for r in found)
    ]:
        yield Words(text=f"No gains were found for {', '.join(missing)}.")
    yield from reasons(result, [each for each in result.reasons if each.verdict is Verdict.CERTIFIED])
    if curves := tuple(gain_figures(result)):
        yield Figures(figures=curves)


def _gains_row(row: Gains) -> tuple[Cell, ...]:
    return (
        Cell(text=NAMES[row.section]),
        Cell(text=f"{row.which} *" if row.decides else row.which),
        Cell(text=row.verdict, kind="verdict"),
        *(
            Cell(text="" if gain is None else exact(gain), kind="number")
            for gain in (row.pair.bandwidth, row.pair.adaptation_rate)
        ),
        Cell(text=row.slack, kind="number"),
    )


def _filled(result: Result) -> Iterator[Block]:
    """What fills the tube of every kind that is certified, a column each."""
    found = filled(result)
    causes = dict.fromkeys(each.cause for kind in found for each in kind.shares)
    told = [{each.cause: each.share for each in kind.shares} for kind in found]
    if found:
        yield Table(
            columns=("cause", *(NAMES[kind.key] for kind in found)),
            rows=tuple((Cell(text=cause), *(_share(own.get(cause)) for own in told)) for cause in causes),
            note=_SHARES,
        )


def _share(share: float | None) -> Cell:
    if share is None:
        return Cell(text="", kind="number")
    return Cell(text=f"{up(100 * share, 3)} %", kind="number", share=min(1.0, share))


def _tube(result: Result) -> Iterator[Block]:
    if result.tube is not None:
        yield Facts(facts=tuple(_radii(result, result.tube)))
    figures = tuple(tube_figures(result))
    if figures:
        yield Figures(figures=figures)
        yield from _drawn(result)
    if figures := tuple(state_figures(result)):
        yield Figures(figures=figures)


def _drawn(result: Result) -> Iterator[Block]:
    """What the outline of the tube is."""
    outline = tube_outline(result, (0, 1))
    if outline is not None and widths(result) is not None:
        yield Words(text=_ELLIPSE if outline.sides is None else _CUT)


def _radii(result: Result, tube: TubeData) -> Iterator[tuple[str, Cell]]:
    yield "radius rho", Cell(text=reach.radii(tube))
    yield "epsilon", Cell(text=short(tube.epsilon))
    if tube.coordinates is not None:
        yield (
            "measured by",
            Cell(text="z = S x, in which rho, rho_a and epsilon are lengths, whatever the units of states"),
        )
        yield "epsilon, by state", Cell(text=reach.in_states(result, tube, tube.epsilon, "epsilon"))
    known = widths(result)
    if known:
        yield "half-widths", Cell(text=reach.half_widths(result, known))
        yield from (("asked for", Cell(text=told)) for told in reach.asked_for(result, known))
    for line in reach.clearances(result):
        yield "obstacles", Cell(text=line)
    yield "claimed", Cell(text=claimed.span(result))
    yield "starts", Cell(text=claimed.start_words(result))
    for words, rest in reach.long_run(result):
        yield f"in the long run, {words}", Cell(text=rest)


def _inputs(result: Result) -> Iterator[Block]:
    if result.inputs:
        yield _input_table(result)
    if figures := tuple(input_figures(result)):
        yield Figures(figures=figures)
        if not result.inputs:
            yield Words(text=_NO_LIMITS)


def _input_table(result: Result) -> Table:
    loops = [(own, key) for own in result.inputs for key in _loops(own)]
    columns = ("input", "limits", "verdict", "on the plan", "loop of", "stays within", "used")
    return Table(
        columns=(*columns, "feedback", "adaptation"),
        rows=tuple(_input_row(result, own, key) for own, key in loops),
        note="Proven for every uncertainty of the class: what the plan needs, and what feedback and adaptation add at "
        "most. Used: 0 % in the middle of the limits, 100 % at one of them. The verdict is about the loops that "
        "decide.",
    )


def _loops(own: InputData) -> list[str | None]:
    """The kinds that bound an input, in their order; one row without any if there is none."""
    found: list[str | None] = [key for key in NAMES if key in own.bounds]
    return found or [None]


def _input_row(result: Result, own: InputData, key: str | None) -> tuple[Cell, ...]:
    unit = result.spec.effective.system.units.get(own.input, "")
    bound = None if key is None else own.bounds[key]
    return (
        Cell(text=f"{own.input} ({unit})" if unit else own.input),
        Cell(text=f"[{end(own.limits[0])}, {end(own.limits[1])}]", kind="number"),
        Cell(text=own.verdict, kind="verdict"),
        Cell(text=reach.span_of(own.plan.least.below, own.plan.greatest.above), kind="number"),
        *(
            (
                Cell(text=NAMES[key]),
                Cell(text=reach.span_of(bound.least, bound.greatest), kind="number"),
                Cell(text=reach.used(own, key), kind="number"),
                Cell(text=up(bound.feedback), kind="number"),
                Cell(text=up(bound.adaptation), kind="number"),
            )
            if bound is not None and key is not None
            else (Cell(text=UNKNOWN),) * 5
        ),
    )


def _rests_on(result: Result) -> Iterator[Block]:
    yield Items(title="Proven", items=tuple(proven(result)) or ("nothing that could be relied on",))
    yield Items(title="Declared, believed as given", items=tuple(declared(result)) or ("nothing",))
    yield Items(title="Assumed, not proven", items=tuple(map(assumed, result.assumptions)))


def _metric(metric: MetricData, tube: TubeData | None) -> Iterator[Block]:
    facts = [
        ("verdict", Cell(text=metric.verdict, kind="verdict")),
        ("rate", Cell(text=f"{exact(metric.rate)} 1/s")),
    ]
    if metric.largest_rate is not None:
        facts.append(("supports rates up to", Cell(text=f"{down(metric.largest_rate.below, 7)} 1/s")))
    facts += [(words, Cell(text=bounds)) for words, bounds in _metric_bounds(metric, tube)]
    yield Facts(facts=tuple(facts))
    yield Listing(text=_entries(metric), math=named("W", matrix(metric.dual_metric)))
    yield Words(text="W is the dual metric, the inverse of M; it is symmetric.")


def _metric_bounds(metric: MetricData, tube: TubeData | None) -> Iterator[tuple[str, str]]:
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


def _entries(metric: MetricData) -> str:
    """The upper triangle of W, an entry on a line."""
    return "\n".join(
        f"W[{i + 1},{j + 1}] = {entry}"
        for i, row in enumerate(metric.dual_metric)
        for j, entry in enumerate(row[i:], start=i)
    )


def _constants(result: Result) -> Iterator[Block]:
    figures = tuple(suprema_figures(result))
    if figures:
        yield Words(
            text="Where in the tube, with all of its radius, each constant was found largest or smallest "
            "(computed, not examined by recheck):"
        )
        yield Figures(figures=figures, places=places(result))
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

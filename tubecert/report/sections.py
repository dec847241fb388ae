"""The sections of the report, each a title and what stands below it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from typing import TYPE_CHECKING

from rich.console import Group
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from tubecert.bounds.meanings import EVERY
from tubecert.certificate.follows import InputData
from tubecert.certificate.result import Bound, MetricData, Plans, Result, TubeData
from tubecert.claims.assumptions import MachineAsGiven
from tubecert.claims.family import Assumption, Reason
from tubecert.digits import UNKNOWN, down, end, exact, near, percent, short, up
from tubecert.enclosure.constant import Witness
from tubecert.kinds import ALONE, HARDWARE, RATES, SAMPLED
from tubecert.kinds.alone import AloneData
from tubecert.kinds.sampled import SampledData
from tubecert.report import windows
from tubecert.report.gains import NAMES, Gains, rows
from tubecert.report.layout import plain_table
from tubecert.report.machine import lines as machine_lines
from tubecert.report.machine import proven as hardware_proven
from tubecert.report.machine import section_of
from tubecert.trajectory.hermite import ends_of_pieces
from tubecert.verdict import Verdict
from tubecert.words.advice import advice
from tubecert.words.assumptions import assumed
from tubecert.words.claims import message, title
from tubecert.words.conditions import SAYS

if TYPE_CHECKING:
    from rich.console import RenderableType

Section = tuple[str, list["RenderableType"]]
MEANINGS = EVERY
_NOTABLE = 0.01  # of the range of the knots
VERDICTS = {Verdict.CERTIFIED: "green", Verdict.REFUTED: "red", Verdict.UNDECIDED: "yellow"}


def of(result: Result, *, verbose: bool) -> Iterator[Section]:
    """The sections that a result has something to say in."""
    failed = [item for item in result.reasons if item.verdict is not Verdict.CERTIFIED]
    holding = [item for item in result.reasons if item.verdict is Verdict.CERTIFIED]
    if failed:
        yield "Not certified", [_reason(result, item) for item in failed]
    if result.sections:
        yield "Gains", _gains(result)
    if section_of(result) is not None:
        yield "Machine", [Text(line) for line in machine_lines(result)]
    if holding:
        yield "What limits them", [_reason(result, item) for item in holding]
    if result.tube is not None:
        yield "Tube", _tube(result, result.tube)
    if result.inputs:
        yield "Inputs", [Text(line) for own in result.inputs for line in input_lines(result, own)]
    if result.metric is not None:
        yield "Metric", _metric(result, result.metric)
    if verbose and result.constants:
        yield "Constants over the tube", [_constants(result)]
    yield "Assumed, not proven", _assumptions(result, verbose)


def span(result: Result) -> str:
    """The time that is claimed."""
    end = horizon(result)
    return "for all t >= 0" if end is None else f"for 0 <= t <= {short(end, 12)} s"


def plan_words(result: Result) -> str:
    """What the state stays close to."""
    return "the plan" if result.claim.plans is None else "every plan of the family"


def family_words(plans: Plans) -> str:
    """Which plans belong to a family."""
    sides = [*((f"{name}*", ends) for box in (plans.x, plans.u) for name, ends in box.items())]
    boxes = ", ".join(f"{name} in [{low}, {high}]" for name, (low, high) in sides)
    return f"{boxes}; |x*' - f(x*) - B(x*) u*| <= {plans.defect}"


def horizon(result: Result) -> Fraction | None:
    """The end of the plan in s, None if it has none."""
    return result.spec.effective.trajectory.horizon


def radius(result: Result) -> Fraction | None:
    """The radius of the tube, None if there is none."""
    return None if result.tube is None else result.tube.rho


# -- why not


def _reason(result: Result, reason: Reason) -> Group:
    verdict = reason.verdict
    told = f": {message(reason)}"
    text = Text.assemble((f"{verdict} ", VERDICTS[verdict]), (title(reason.claim), "bold"), told)
    more = []
    if reason.at is not None:
        more.append(Text(f"at {point(result, reason.at)}"))
    if relax := advice(reason.relax):
        more.append(Text.assemble(("help: ", "green"), relax))
    return Group(text, *(Padding(line, (0, 0, 0, 2)) for line in more))


def point(result: Result, at: Witness) -> str:
    """A witness: `t = 0.2 s, x1 = 0.1, ...`."""
    return place(result.spec.effective.system.states, at)


def place(states: Sequence[str], at: Witness) -> str:
    """The same for any states."""
    parts = [] if at.t is None else [f"t = {short(at.t, 6)} s"]
    parts += [f"{name} = {short(value, 6)}" for name, value in zip(states, at.x, strict=False)]
    return ", ".join(parts)


# -- gains


def _gains(result: Result) -> list[RenderableType]:
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
                *(exact(gain) if gain is not None else "" for gain in gain_columns(row)),
                row.slack,
            )
            before = row.section
        body.append(table)
        if any(row.decides for row in found):
            body.append(
                Text(
                    "Each row was proven on its own: do not take omega from one row and Gamma from another. The row "
                    "marked * decides the verdict. omega is in rad/s, Ts in s. Gains are the least that are proven, so "
                    "a margin of next to nothing is no sign of danger.",
                    style="dim",
                )
            )
    missing = [
        NAMES[key] for key in NAMES if key in result.sections and all(row.section != key for row in found)
    ]
    body += [Text(f"{title}: no gains were found") for title in missing]
    body += [Text(line) for line in (*beyond_its_theorem(result), *without_adaptation(result))]
    return body + _limit(result)


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
    yield f"In this tube the feedback alone can take {limit}; the uncertainty has {whole} <= {up(h.above)}."


def _parameters(result: Result) -> Iterable[object]:
    """The values of parameters: texts, or ranges."""
    known: Mapping[str, object] = result.spec.effective.part("system").get("parameters", {})
    return known.values()


def _is_one(value: object) -> bool:
    return isinstance(value, str)


def gain_columns(row: Gains) -> tuple[Fraction | None, Fraction | None, Fraction | None]:
    """Bandwidth, adaptation rate and sample time."""
    return row.pair.bandwidth, row.pair.adaptation_rate, row.pair.sample_time


def sample_time_limit(result: Result) -> float | None:
    """What no sample time reaches, whatever the bandwidth."""
    section = result.sections.get(SAMPLED.key)
    return section.sample_time_limit if isinstance(section, SampledData) else None


def _limit(result: Result) -> list[Text]:
    """What no bandwidth can go beyond."""
    limit = sample_time_limit(result)
    return [] if limit is None else [Text(f"However large the bandwidth, C needs Ts < {down(limit)} s.")]


# -- tube and metric


def _tube(result: Result, tube: TubeData) -> list[RenderableType]:
    lines = [f"rho = {radii(tube)}; epsilon = {short(tube.epsilon)}"]
    if tube.coordinates is None and len(result.spec.effective.system.states) > 1:
        lines[0] += " (Euclidean norm over all states)"
    if result.claim.plans is not None:
        lines.append(f"around every plan with {family_words(result.claim.plans)}")
    if tube.half_widths:
        lines.append(f"half-widths: {half_widths(result, tube.half_widths)}")
    if tube.coordinates is not None:
        lines[0] += " (lengths in the coordinates of the tube)"
        lines.append(in_states(result, tube, tube.epsilon, "epsilon"))
    own = result.spec.effective.tube.rho_a
    asked = own if result.overrides.rho_a is None else result.overrides.rho_a
    if asked is not None and tube.rho_r is not None and tube.rho_a < asked:
        name = "tube.rho_a" if result.overrides.rho_a is None else "--rho-a"
        lines.append(
            f"{name} {short(asked)} is more than the start leaves of these half-widths: half of that is taken"
        )
    lines += [*windows.lines(result), *excursion(result), *clearances(result)]
    found = (f"in the long run {rest} with {title}" for title, rest in long_run(result))
    return [*map(Text, lines), *map(Text, found)]


def excursion(result: Result) -> Iterator[str]:
    """How far the plan leaves the range of its knots, where that is worth a word; by the points it is drawn by."""
    knots, drawn = result.plan.exact_knots(), result.plan.samples
    if knots is None or drawn is None:
        return
    for name, own, curve in zip(
        result.spec.effective.system.states,
        zip(*ends_of_pieces(knots).x, strict=True),
        zip(*drawn.x, strict=True),
        strict=True,
    ):
        low, high = float(min(own)), float(max(own))
        beyond = max(low - min(curve), max(curve) - high)
        if beyond > _NOTABLE * (high - low):
            span = f"[{near(low, 4)}, {near(high, 4)}]"
            yield f"between its knots the plan takes {name} {near(beyond, 3)} beyond all of them, which are in {span}"


def is_radius(result: Result) -> bool:
    """Whether the radius of the tube is a length in the states, and is what is proven."""
    decides = hardware_proven(result) is not None and result.decided_by == (HARDWARE.key,)
    return not decides and (result.tube is None or result.tube.coordinates is None)


def extent(result: Result) -> str:
    """How far the state may be from the plan: the radius, or the half-widths of a tube measured by the metric."""
    tube, own = result.tube, hardware_proven(result)
    if is_radius(result) or tube is None or tube.half_widths is None:
        return f"{up(radius(result))} {_unit(result)}".rstrip()
    decides = own is not None and result.decided_by == (HARDWARE.key,)
    return f"the half-widths {half_widths(result, own.half_widths if own and decides else tube.half_widths)}"


def _unit(result: Result) -> str:
    """The unit of a length over all states, if they have one."""
    system = result.spec.effective.system
    units = {system.units.get(name, "") for name in system.states}
    return units.pop() if len(units) == 1 else ""


def in_states(result: Result, tube: TubeData, length: Fraction, name: str) -> str:
    """What a share of dbar is in each state: a distance within it keeps |x_i - x_i*| within that share."""
    share = float(length / tube.rho)
    widths = half_widths(result, {name: share * width for name, width in (tube.half_widths or {}).items()})
    return f"{name} is {percent(share)} of the tube; a distance of that share of dbar is at most {widths}"


def clearances(result: Result) -> Iterator[str]:
    """How far the tube keeps from each obstacle."""
    for number, (obstacle, own) in enumerate(
        zip(result.spec.effective.obstacles, result.clearance, strict=False), start=1
    ):
        where = f"obstacle {number} ({', '.join(obstacle.states)})"
        when = f"nearest at t = {short(own.t, 4)} s"
        if own.verdict is Verdict.CERTIFIED:
            yield f"clear of {where} by at least {down(own.clearance.below)}; {when}"
        else:
            told = "the tube meets it" if own.verdict is Verdict.REFUTED else "the tube may meet it"
            yield f"{where}: {told}; {when}" + ("" if own.decides else " (does not decide)")


def input_lines(result: Result, own: InputData) -> Iterator[str]:
    """How far an input with limits goes, and what takes it there, in the loop of every kind that decides."""
    unit = result.spec.effective.system.units.get(own.input, "")
    limits = f"limits [{end(own.limits[0])}, {end(own.limits[1])}]".rstrip()
    plan = span_of(own.plan.least.below, own.plan.greatest.above)
    told = [key for key in result.decided_by if key in own.bounds]
    for key in told:
        bound = own.bounds[key]
        reaches = f"{span_of(bound.least, bound.greatest)} {unit}".rstrip()
        stays = "stays within" if own.verdict is Verdict.CERTIFIED else "is proven to stay within"
        where = f" with {NAMES[key]}" if len(told) > 1 else ""
        adapts = f", adaptation adds {up(bound.adaptation)}" if bound.adaptation else ""
        yield (
            f"{own.input} {stays} {reaches}{where}; {limits}: {used(own, key)} used (the plan is in {plan}, feedback "
            f"adds {up(bound.feedback)}{adapts})"
        )
    if not told:
        yield f"{own.input} is in {plan} on the plan; {limits}; nothing is proven of it in the loop"
    if own.verdict is Verdict.REFUTED:
        yield f"{own.input} of the plan itself leaves its limits"


def span_of(low: float, high: float) -> str:
    """A range that contains this one."""
    return f"[{down(low)}, {up(high)}]"


def used(own: InputData, key: str) -> str:
    """How much of its limits an input uses: 0 % in the middle of them, 100 % at one of them."""
    share = own.use([key])
    return UNKNOWN if share is None else f"{up(100 * share, 3)} %"


def radii(tube: TubeData) -> str:
    """The radius and its parts."""
    parts = "" if tube.rho_r is None else f" = {up(tube.rho_r)} (rho_r) + {up(tube.rho_a)} (rho_a)"
    return f"{up(tube.rho)}{parts}"


def half_widths(result: Result, widths: Mapping[str, float]) -> str:
    """The half-width of every state."""
    units = result.spec.effective.system.units
    return ", ".join(
        f"{name} {up(widths[name])} {units.get(name, '')}".rstrip()
        for name in result.spec.effective.system.states
        if name in widths
    )


def long_run(result: Result) -> Iterator[tuple[str, str]]:
    """How near the plan the state is when the initial error has died out, for each certificate that holds."""
    if horizon(result) is not None:
        return
    for key, words in NAMES.items():
        section = result.sections.get(key)
        held = section is not None and section.verdict is Verdict.CERTIFIED
        if section is not None and held and section.ultimate_radius is not None:
            yield words, _rest(result, section.ultimate_radius)


def _rest(result: Result, ultimate: float) -> str:
    tube = result.tube
    if tube is None or tube.coordinates is None:
        return f"|x - x*| <= {up(ultimate)}"
    return f"|x_i - x_i*| <= {up(100 * ultimate / float(tube.rho), 3)} % of the half-widths"


def _metric(result: Result, metric: MetricData) -> list[RenderableType]:
    body = [f"rate {short(metric.rate, 12)} 1/s: {metric.verdict} on the safe set"]
    if metric.largest_rate is not None:
        body[0] += f"; the metric supports rates up to {down(metric.largest_rate.below, 7)} 1/s"
    if metric.margin is not None and metric.verdict is Verdict.CERTIFIED:
        body[0] += f" (margin {down(metric.margin.below, 3)} 1/s)"
    body += [f"{bounds} {words}" for words, bounds in metric_bounds(metric, result.tube)]
    sides = (f"{name} in [{end(low)}, {end(high)}]" for name, (low, high) in safe_set(result))
    return [Text(line) for line in [*body, f"safe set: {', '.join(sides)}"]]


def safe_set(result: Result) -> Iterator[tuple[str, tuple[Fraction, Fraction]]]:
    """The range of every state, in the order of the states."""
    for name in result.spec.effective.system.states:
        if name in result.safe_set:
            yield name, result.safe_set[name]


def metric_bounds(metric: MetricData, tube: TubeData | None) -> Iterator[tuple[str, str]]:
    """Where the metric is bounded, and by what; over a tube with coordinates, by S'S."""
    unit = "I" if tube is None or tube.coordinates is None else "S'S"
    for words, a, A, of in (
        ("over the tube", metric.lower, metric.upper, unit),
        ("on the safe set", metric.lower_on_set, metric.upper_on_set, "I"),
    ):
        if a is not None and A is not None:
            yield words, f"{down(a.below)} {of} <= M <= {up(A.above)} {of}"


def _constants(result: Result) -> Table:
    table = plain_table("symbol", "what it is, and where", ">proven", "unit", ">gap", wrapped=1)
    for name, item in result.constants.items():
        table.add_row(item.symbol, _described(result, name, item), proven(name, item), item.unit, gap(item))
    return table


def _described(result: Result, name: str, item: Bound) -> Text:
    text = Text(described(name))
    if item.at is not None and (where := point(result, item.at)):
        text.append(f"\nat {where}", style="dim")
    return text


def described(name: str) -> str:
    """A constant in words, whatever its name."""
    meaning = MEANINGS.get(name)
    return name.replace("_", " ") if meaning is None else meaning.words


def proven(name: str, item: Bound) -> str:
    """The side that the certificate uses: from below for an infimum, from above for a supremum."""
    meaning = MEANINGS.get(name)
    if meaning is not None and meaning.side == "below":
        return f">= {down(item.below, 6)}"
    return f"<= {up(item.above, 6)}"


def gap(item: Bound) -> str:
    """How far the two proven sides are apart, relative to the larger one."""
    low, high = item.below, item.above
    if low is None or high is None or low < 0 < high:
        return UNKNOWN
    return "exact" if low == high else f"{up(100 * (high - low) / max(abs(low), abs(high)), 2)} %"


# -- assumptions


def _computes(stated: Sequence[Assumption]) -> str:
    """How the controller of a machine computes."""
    found = next((each.arithmetic for each in stated if isinstance(each, MachineAsGiven)), None)
    return (
        "it computes exactly"
        if found is None
        else f"it computes in {found} precision, whose rounding is covered"
    )


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
    if result.decided_by == (HARDWARE.key,):
        brief = (
            "the machine is as stated: it samples on time, its inputs follow after exactly the delay, its measurements "
            f"are as good as stated, {_computes(stated)}; the uncertainty and the wind are as specified"
        )
        return [
            Text(line)
            for line in [f"{brief} ({len(stated)} in all, -v shows them)", *believed[: len(declared)]]
        ]
    geodesics = "exact geodesics (their uniqueness is proven)" if proven else "exact and unique geodesics"
    brief = (
        f"exact continuous-time control, full state, no noise, delay or saturation; {geodesics}; filter "
        f"and predictor start at rest; the uncertainty is as specified ({len(stated)} in all, -v shows them)"
    )
    return [Text(line) for line in [brief, *(believed if declared else [])]]

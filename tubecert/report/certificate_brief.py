"""What is seen first of a certificate, a line each where there is room.

In: `result` of a certificate. Out: names and what is told of them; what is left out where there is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from tubecert.certificate.result import Result, TubeData
from tubecert.claims import family as claims
from tubecert.claims.advice import advice
from tubecert.claims.conditions import SAYS, equation
from tubecert.claims.statements import GainsSuffice
from tubecert.digits import down, exact, short, up
from tubecert.kinds import ALONE, DISTANCE, RATES
from tubecert.kinds.alone import AloneData
from tubecert.report import claimed, reach
from tubecert.report.gains import NAMES, Gains, deciding, named, rows
from tubecert.report.page import Block, Facts, Reason
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import family

_SPARE = {  # where the screen is full: what holds, or why it does not, and what helps, is left
    True: ("limit", "alone", "help", "plan", "undecided", "long run", "wish", "rho_a", "clearance", "or"),
    False: (
        "alone",
        "assumed",
        "undecided",
        "gains",
        "long run",
        "wish",
        "plan",
        "clearance",
        "tube",
        "start",
    ),
}


def first_blocks(result: Result) -> tuple[Block, ...]:
    """The first section: facts, then what else is not proven."""
    beside = [reason for reason in result.failed if reason is not result.reason]
    return Facts.of(_brief(result), _SPARE[result.verdict is Verdict.CERTIFIED]), *reasons(result, beside)


def reasons(result: Result, some: Sequence[claims.Reason] | None = None) -> tuple[Reason, ...]:
    """Why the verdict is what it is, in words; or what only `some` of the reasons say."""
    return tuple(
        Reason(
            verdict=reason.verdict,
            claim=reason.claim.title,
            message=reason.message,
            at="" if reason.at is None else claimed.point(result, reason.at),
            relax=advice(reason.relax, result.spec.effective.uncertainty.h),
        )
        for reason in (result.reasons if some is None else some)
    )


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
        yield "gains", f"{row.text()}, {how}by certificate {named(row.section)}"
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
            f"{best.text()}, by {named(best.section)}: --conditions B",
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
        yield "undecided", f"certificate {named(RATES.key)}: {SAYS['wind_not_covered']}"
    elif not list(less_by_distance(result)):
        yield "help", f"{named(DISTANCE.key)}, is stated for them as well: --conditions B"


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

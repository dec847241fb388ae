"""A certificate of a sampled loop as a page: what a terminal shows first, figures, and what one may ask next.

In: a certificate. Out: a `Page`, which terminals, HTML, Markdown and notebooks show. Bounds are rounded outward.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import islice
from typing import Final

from tubecert.certificate.effective import Effective
from tubecert.digits import near, up
from tubecert.expression import derivative, parse, symbol
from tubecert.report.claimed import NOT_RECHECKED, ends, labelled, size, started
from tubecert.report.figures_sampled import figures, period
from tubecert.report.page import Block, Cell, Facts, Figures, Items, Listing, Page, Section, Table
from tubecert.report.page_origin import check_again, system
from tubecert.report.page_simulation import Simulated, simulated_blocks
from tubecert.sampled_loop.record import Certificate, Notes, Result, Stage
from tubecert.verdict import Verdict
from tubecert.words.sampled_loop import (
    assumed,
    causes,
    extent,
    family,
    filling,
    is_alone,
    loop,
    misses,
    plan,
    promise,
    remedy,
)

_MOST, _ROWS = 6, 4  # states of the first screen; where there are more than four, they stand side by side
_NOTES: Final = "What fills the tube and the points to draw the plan by"
_LAW: Final = (
    "y_k = x(t_k) + noise,   t_k = k times the sample time",
    "u = u* + M z_k + N (y_k - x*(t_k)),   held for a sample time from t_k + delay on",
    "z_k+1 = F z_k + G (y_k - x*(t_k)),   z_0 = 0",
)


def page_of(certificate: Certificate, simulated: Simulated | None = None, *, all_of_it: bool = True) -> Page:
    """The page of a certificate, whatever its verdict; or its first section alone, for which nothing is drawn."""
    result, sections = certificate.result, Section.each(_sections(certificate, simulated))
    return Page(
        name=result.spec.effective.name,
        verdict=result.verdict,
        summary=promise(result),
        meaning=_meaning(result),
        caveat=NOT_RECHECKED,
        sections=tuple(islice(sections, None if all_of_it else 1)),
    )


def _sections(
    certificate: Certificate, simulated: Simulated | None
) -> Iterator[tuple[str, str, Iterable[Block]]]:
    result, notes = certificate.result, certificate.notes
    own = result.spec.effective
    yield "loop", "The loop", _screen(result, notes)
    drawn = tuple(figures(certificate))
    yield "figures", "Figures", [Figures(figures=drawn)] if drawn else []
    widths = [_widths(result, own.system.states, notes)] if result.tube else []
    yield "tube", "Half-widths, and what fills them", widths
    yield "simulation", "Simulation", simulated_blocks(simulated)
    yield "assumed", "Assumed, not proven", [Items(items=tuple(assumed(result)))]
    law, exported = ([], []) if is_alone(own) else ([Listing(text="\n".join(_LAW))], [" --controller FOLDER"])
    yield "system", "The specification", [*system(own, result.spec.settings), *law]
    yield "origin", "Where it comes from", [_origin(certificate)]
    yield "check", "Check it again", check_again(_NOTES, *exported)


def _meaning(result: Result) -> str:
    if result.verdict is Verdict.REFUTED:
        return "A tube contains its plan and must lie in the safe set: with this plan there is none."
    if result.verdict is not Verdict.CERTIFIED:
        return "This is neither proven nor refuted; it must not be relied on."
    return (
        f"With this controller ({loop(result.spec.effective)}) every state stays within its half-width of "
        f"{plan(result)} {extent(result)} if it starts {_start(result)}, under the assumptions of the certificate."
    )


def _start(result: Result) -> str:
    effective = result.spec.effective
    whose = "its plan" if effective.trajectory.kind == "any" else "the plan"
    return started(effective.part("initial_state"), effective.system, whose)


def _screen(result: Result, notes: Notes) -> Iterator[Block]:
    """What is seen first."""
    effective = result.spec.effective
    plans = [("plans", family(effective))] if effective.trajectory.kind == "any" else []
    yield Facts.of([("loop", loop(effective)), *plans, ("start", _start(result))])
    if result.tube:
        yield _widths(result, _first(result))
    proven = result.verdict is Verdict.CERTIFIED
    told = (*_inputs(result), *_worst(result, notes), *_obstacles(result)) if proven else ()
    missed = [] if notes.missed is None else [("plan", misses(notes.missed))]
    if rows := [*told, *missed, *_lacking(result, notes)]:
        spare = tuple(name for name, _ in rows if name.startswith("fills") or name == "obstacles")
        yield Facts.of(rows, spare)


def _first(result: Result) -> Sequence[str]:
    """The states of the first screen: those with a wish, and others as far as there is room, in their order."""
    names, wishes = result.spec.effective.system.states, result.spec.effective.tube.half_widths
    room = max(1, _MOST - len(_outputs(result.spec.effective)))
    chosen = sorted(names, key=lambda name: name not in wishes)[:room]
    return [name for name in names if name in chosen]


def _outputs(effective: Effective) -> dict[str, dict[str, Fraction]]:
    """Outputs of which a half-width was asked: how much of every state each has, as a magnitude."""
    system, known = effective.system, {name: symbol(name) for name in effective.system.states}
    sums = {name: parse(text, symbols=known).expression for name, text in system.outputs.items()}
    rows = {name: {x: abs(derivative(own, x).fraction) for x in known} for name, own in sums.items()}
    return {name: row for name, row in rows.items() if name in effective.tube.half_widths}


def _bounds(stage: Stage, outputs: Mapping[str, Mapping[str, Fraction]]) -> dict[str, Fraction]:
    """How wide the tube is in a stage, by state, input and output."""
    own = stage.half_widths
    sums = {name: sum((q * own[x] for x, q in row.items()), Fraction(0)) for name, row in outputs.items()}
    return {**own, **stage.deviations, **sums}


def _widths(result: Result, names: Sequence[str], notes: Notes | None = None) -> Table:
    """Half-widths at the start, in the long run, as wished, of outputs too; `notes` say what fills them, and inputs."""
    system, wishes = result.spec.effective.system, result.spec.effective.tube.half_widths
    outputs = _outputs(result.spec.effective)
    named = (*names, *outputs, *(system.inputs if notes else ()))
    columns = [["tube" if result.verdict is Verdict.CERTIFIED else "not proven"]]
    columns[0] += [labelled(name, system) for name in named]
    for stages in filter(None, (result.tube, result.tube[1:][-1:])):  # what is never left, and the long run
        bounds = [_bounds(stage, outputs) for stage in stages]
        widths = (size(max(own[name] for own in bounds)) for name in named)
        columns.append([f"from {up(stages[0].start * period(result))} s", *widths])
    if wishes:
        columns.append(["wish", *(near(wishes[name]) if name in wishes else "" for name in named)])
    if filled := notes.filled if notes else {}:
        words = causes(result)
        told = {name: filling(shares, words) for name, shares in filled.items()}
        columns.append(["filled by", *(told.get(name, "") for name in named)])
    aside = len(named) > _ROWS and not notes
    head, *rows = columns if aside else zip(*columns, strict=True)
    left = len(system.states) - len(names)
    return Table(
        columns=tuple(head),
        rows=tuple(tuple(Cell(text=told) for told in row) for row in rows),
        note=f"{left} more with -v" if left else "",
    )


def _inputs(result: Result) -> Iterator[tuple[str, str]]:
    units = result.spec.effective.system.units
    for use in result.inputs:
        told = f"{ends(*use.range, use.limits)} {units.get(use.input, '')}".rstrip()
        if use.limits is not None and use.share is not None:
            limits, used = " to ".join(map(near, use.limits)), up(100 * use.share, 3)
            told += f" of {limits}: {used} % of the way to a limit"
        yield use.input, told


def _worst(result: Result, notes: Notes) -> Iterator[tuple[str, str]]:
    """What fills the tube of the state that is widest beside its wish, or else beside the safe set."""
    wishes, safe = result.spec.effective.tube.half_widths, result.spec.effective.part("safe_set")
    wished = [name for name in wishes if name in safe]
    last = result.spec.effective.system.ordered(result.tube[-1].half_widths if result.tube else {})
    sizes = {
        name: width / (wishes[name] if wished else Fraction(safe[name][1]) - Fraction(safe[name][0]))
        for name, width in last.items()
        if name in notes.long_run and name in (wished or safe)
    }
    if sizes:
        name = max(sizes, key=sizes.__getitem__)
        yield f"fills {name}", filling(notes.long_run[name], causes(result))


def _obstacles(result: Result) -> Iterator[tuple[str, str]]:
    missed = [str(each.index + 1) for each in result.clearance if each.verdict is not Verdict.CERTIFIED]
    if missed:
        yield "obstacles", f"not proven to keep away from number {', '.join(missed)}"
    elif result.clearance:
        yield "obstacles", f"the tube keeps away from {'all of them' if len(result.clearance) > 1 else 'it'}"


def _lacking(result: Result, notes: Notes) -> Iterator[tuple[str, str]]:
    """What fills that which lacks, and what would help."""
    for lack in result.lacks:
        if lack.where in notes.filled:
            yield f"fills {lack.where}", filling(notes.filled[lack.where], causes(result))
    helps = dict.fromkeys(remedy(lack, result, notes) for lack in result.lacks)
    yield from (("help", help) for help in helps)


def _origin(certificate: Certificate) -> Facts:
    tables, evaluations = certificate.result.controller, certificate.notes.evaluations
    rows = [("hash", certificate.hash)]
    if tables is not None:
        about = f"{tables.size} states, the best of {evaluations} that were tried"
        rows.append(("controller", about))
    rows += [
        (name, str(told)) for name, told in sorted(certificate.run.items()) if not isinstance(told, dict)
    ]
    return Facts.of(rows)

"""Where a certificate comes from: the specification that it is about, how it was made, how to check it again."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from tubecert.certificate.effective import Effective, TableView
from tubecert.digits import exact
from tubecert.records import to_json
from tubecert.report.claimed import box
from tubecert.report.page import Block, Facts, Listing, Words
from tubecert.words.sampled_loop import family

if TYPE_CHECKING:
    from tubecert.certificate.result import Certificate

_POINTS = 8  # of a table


def system(effective: Effective, overrides: Mapping[str, object]) -> Iterator[Block]:
    """The effective specification in equations and words."""
    yield Listing(text="\n".join(equations(effective)))
    yield Facts.of(_facts(effective, overrides))


def equations(effective: Effective) -> Iterator[str]:
    """The dynamics, one line per state, then h."""
    model, wind = effective.system, effective.disturbance.E
    taken = {*model.states, *model.inputs}
    hs = _named(("h", "uncertainty"), model.inputs, taken)
    told = [f"({u} + {h})" for u, h in zip(model.inputs, hs, strict=True)]
    for i, (state, f, row) in enumerate(zip(model.states, model.f, model.B, strict=False)):
        blows = wind[i] if wind else ()
        acting = [*zip(row, told, strict=True), *zip(blows, _named(("w", "wind"), blows, taken), strict=True)]
        terms = (_times(factor, other) for factor, other in acting if factor != "0")
        yield f"{state}' = {' + '.join((f, *terms))}"
    for name, h in zip(hs, effective.uncertainty.h, strict=False):  # none where only bounds are declared
        yield f"{name} = {h}"


def _named(words: Sequence[str], items: Sequence[str], taken: Collection[str]) -> list[str]:
    """A name for each, of the first word that is free: alone where there is one, else with its number."""
    made = [[word if len(items) == 1 else f"{word}{i + 1}" for i in range(len(items))] for word in words]
    return next((found for found in made if not set(found) & set(taken)), made[-1])


def _times(factor: str, other: str) -> str:
    """A product; what is multiplied by one stays alone."""
    return other if factor == "1" else f"({factor})*{other}"


def _facts(effective: Effective, overrides: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    model = effective.system
    if model.parameters:
        yield "parameters", _list(model.parameters)
    for name, table in sorted(model.tables.items()):
        yield f"table {name}", _points(table)
    if model.units:
        yield "units", ", ".join(f"{name}: {unit}" for name, unit in sorted(model.units.items()))
    yield "safe set", box(model.ordered(effective.part("safe_set")))
    if bounds := effective.uncertainty.bounds:
        yield "bounds declared", _list(bounds)
    told, any_of = effective.part("trajectory"), effective.trajectory.kind == "any"
    yield "plan", f"any with {family(effective)}" if any_of else _plan(told)
    if wind := effective.part("disturbance"):
        yield "wind", _list({name: value for name, value in wind.items() if name != "E"})
    for name in ("initial_state", "adaptation", "hardware", "limits"):
        if part := effective.part(name):
            yield name.replace("_", " "), _list(part)
    for obstacle in effective.parts("obstacles"):
        yield "obstacle", _list(obstacle)
    if overrides:
        yield "overridden by the command", _list(overrides)


def _points(table: TableView) -> str:
    """The first points of a table, and how many there are."""
    shown = ", ".join(f"({x}, {y})" for x, y, *_ in table.points[:_POINTS])
    more = ", ..." if len(table.points) > _POINTS else ""
    last = table.points[-1]
    return f"smooth through {len(table.points)} points: {shown}{more}" + (
        f", ({last[0]}, {last[1]})" if more else ""
    )


def _plan(trajectory: Mapping[str, object]) -> str:
    rest = {key: value for key, value in trajectory.items() if key != "kind"}
    kind = trajectory.get("kind", "")
    return f"{kind}: {_list(rest)}" if rest else str(kind)


def _list(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} = {_value(value)}" for name, value in sorted(values.items()))


def _value(value: object) -> str:
    if isinstance(value, Mapping):
        return f"({_list(value)})"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    return exact(value) if isinstance(value, float) else str(value)


def provenance(certificate: Certificate) -> Iterator[Block]:
    """Hashes, versions, the command."""
    result, run = certificate.result, certificate.run
    facts = [
        ("certificate", certificate.hash),
        ("specification, as read", result.spec.effective_hash),
        ("specification, the file", result.spec.file_hash),
        ("format", certificate.format),
    ]
    if result.effort is not None:
        facts.append(("effort", _list(to_json(result.effort))))
    if run.command:
        facts.append(("command", run.command))
    if run.versions:
        facts.append(("versions", ", ".join(f"{k} {v}" for k, v in sorted(run.versions.items()))))
    if run.started:
        facts.append(("made", f"{run.started}, in {'?' if run.seconds is None else run.seconds} s"))
    yield Facts.of(facts)


def check_again(notes: str, *more: str) -> Iterator[Block]:
    """How a stranger convinces himself; `notes` are computed only, `more` follows the command."""
    yield Words(
        text="This page shows a certificate and proves nothing itself. The certificate, a JSON file with the hash "
        "above, is what can be checked: without a solver, in another arithmetic, and against its specification. "
        f"{notes} are its notes: computed, not hashed, not examined by recheck."
    )
    options = ("", " --spec SPEC.yaml", *more)
    yield Listing(text="\n".join(f"tubecert recheck CERT.json{option}" for option in options))
    yield Words(
        text="The command above, run again on the same machine with the same versions, gives the same hash; "
        "elsewhere numbers may differ."
    )

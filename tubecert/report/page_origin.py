"""Where a certificate comes from: the specification that it is about, how it was made, how to check it again."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tubecert.report.numbers import exact
from tubecert.report.page import Block, Cell, Facts, Listing, Words


def system(result: Mapping[str, Any]) -> Iterator[Block]:
    """The effective specification in words and equations."""
    effective = result["spec"]["effective"]
    yield Listing(text="\n".join(_equations(effective)))
    yield Facts(facts=tuple(_facts(result, effective)))


def _equations(effective: Mapping[str, Any]) -> Iterator[str]:
    """The dynamics, one line per state, then h."""
    model = effective["system"]
    inputs = model["inputs"]
    told = [f"({u} + h{i + 1})" if len(inputs) > 1 else f"({u} + h)" for i, u in enumerate(inputs)]
    for state, f, row in zip(model["states"], model.get("f", ()), model.get("B", ()), strict=False):
        terms = [f"({b})*{u}" for b, u in zip(row, told, strict=True) if b != "0"]
        yield f"{state}' = {' + '.join([f, *terms])}"
    for i, h in enumerate(effective.get("uncertainty", {}).get("h", ())):
        yield f"h{i + 1 if len(inputs) > 1 else ''} = {h}"


def _facts(result: Mapping[str, Any], effective: Mapping[str, Any]) -> Iterator[tuple[str, Cell]]:
    model = effective["system"]
    if parameters := model.get("parameters"):
        yield "parameters", Cell(text=_list(parameters))
    if units := model.get("units"):
        yield "units", Cell(text=", ".join(f"{name}: {unit}" for name, unit in units.items()))
    safe = result["safe_set"]
    box = (f"{name} in [{exact(safe[name][0])}, {exact(safe[name][1])}]" for name in model["states"])
    yield "safe set", Cell(text=", ".join(box))
    if bounds := effective.get("uncertainty", {}).get("bounds"):
        yield "bounds declared", Cell(text=_list(bounds))
    yield "plan", Cell(text=_plan(effective["trajectory"]))
    if start := effective.get("initial_state"):
        yield "initial state", Cell(text=_list(start))
    if adaptation := effective.get("adaptation"):
        yield "adaptation", Cell(text=_list(adaptation))
    for obstacle in effective.get("obstacles", ()):
        yield "obstacle", Cell(text=_list(obstacle))
    if overrides := result["overrides"]:
        yield "overridden by the command", Cell(text=_list(overrides))


def _plan(trajectory: Mapping[str, Any]) -> str:
    rest = {key: value for key, value in trajectory.items() if key != "kind"}
    return f"{trajectory['kind']}: {_list(rest)}" if rest else str(trajectory["kind"])


def _list(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {_value(value)}" for name, value in values.items())


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"({_list(value)})"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    return exact(value) if isinstance(value, float) else str(value)


def provenance(certificate: Mapping[str, Any]) -> Iterator[Block]:
    """Hashes, versions, the command."""
    result, run = certificate["result"], certificate.get("run", {})
    facts = [
        ("certificate", Cell(text=certificate["hash"], kind="code")),
        ("specification, as read", Cell(text=result["spec"]["effective_hash"], kind="code")),
        ("specification, the file", Cell(text=result["spec"]["file_hash"], kind="code")),
        ("format", Cell(text=certificate["format"])),
        ("formulas", Cell(text=result["formulas"])),
    ]
    if effort := result.get("effort"):
        facts.append(("effort", Cell(text=_list(effort))))
    if command := run.get("command"):
        facts.append(("command", Cell(text=command, kind="code")))
    if versions := run.get("versions"):
        facts.append(("versions", Cell(text=", ".join(f"{k} {v}" for k, v in versions.items()))))
    if started := run.get("started"):
        facts.append(("made", Cell(text=f"{started}, in {run.get('seconds', '?')} s")))
    yield Facts(facts=tuple(facts))


def check_again(certificate: Mapping[str, Any]) -> Iterator[Block]:
    """How a stranger convinces himself."""
    name = shlex.quote(f"{certificate['result']['spec']['effective']['name']}.certificate.json")
    yield Words(
        text="This page shows a certificate and proves nothing itself. The certificate, a JSON file with the hash "
        "above, is what can be checked: without a solver, in another arithmetic, and against its specification."
    )
    yield Listing(text=f"tubecert recheck {name}\ntubecert recheck {name} --spec SPEC.yaml")
    yield Words(
        text="The command above, run again on the same machine with the same versions, gives the same hash; "
        "elsewhere numbers may differ within the gap."
    )

"""`check --family`: whether plans belong to a family of plans."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.findings import Finding, Severity
from tubecert.printable import visible

if TYPE_CHECKING:
    from tubecert.checking import Checked
    from tubecert.spec import Spec


def members(paths: Sequence[str], family: str) -> list[Checked]:
    """What there is to say of each plan: a CSV file, or a specification whose trajectory it is."""
    spec = _family(family)
    return [_member(path, spec) for path in paths]


def _family(path: str) -> Spec:
    """The family of a specification or of a certificate; raises `SpecError` if there is none."""
    from tubecert.spec import load, load_text

    if Path(path).suffix.lower() == ".json":
        from tubecert.library.certification import read

        effective = read(path).result.spec.effective
        spec = load_text(json.dumps(dict(effective.data)), path)
    else:
        spec = load(path)
    if spec.trajectory.bundle is None:
        message = f"{visible(path)} is about one plan, not about a family"
        help = "a family has trajectory: {kind: any, x: {...}, u: {...}}"
        raise SpecError([Finding(code="TC411", message=message, help=help)])
    return spec


def _member(path: str, family: Spec) -> Checked:
    from tubecert.checking import Checked
    from tubecert.pipeline.membership import NO_MEMBER, UNDECIDED, membership

    try:
        findings = membership(_plan(path, family), family, visible(path))
    except TubecertError as error:
        return Checked(path=path, findings=error.findings, code=error.exit_code)
    codes = {item.code for item in findings if item.severity is Severity.ERROR}
    code = ExitCode.CERTIFIED
    if codes:
        code = ExitCode.NOT_CERTIFIED if NO_MEMBER in codes else ExitCode.UNDECIDED
    assert codes <= {NO_MEMBER, UNDECIDED}
    return Checked(path=path, findings=tuple(findings), code=code)


def _plan(path: str, family: Spec) -> Spec:
    """The family's system with one plan; raises `SpecError` if the file has none that fits."""
    from tubecert.spec import canonical, load, load_text

    if Path(path).suffix.lower() == ".csv":
        table = {"kind": "csv", "file": Path(path).name}
        kept = ("tubecert", "name", "system", "safe_set", "uncertainty")
        own = {key: value for key, value in canonical(family).items() if key in kept} | {"trajectory": table}
        return load_text(json.dumps(own), str(Path(path).with_name("family")))
    spec = load(path)
    if _system(spec) != _system(family):
        message = f"{visible(path)} is about another system than the family"
        help = "states, inputs, parameters, f and B must be the same"
        raise SpecError([Finding(code="TC604", message=message, location=spec.location("system"), help=help)])
    if spec.trajectory.task is not None or spec.trajectory.bundle is not None:
        message = f"{visible(path)} has no plan that could be compared"
        help = "give a plan with its own x and u: expressions, an equilibrium or a CSV file"
        location = spec.location("trajectory.kind")
        raise SpecError([Finding(code="TC411", message=message, location=location, help=help)])
    return replace(family, trajectory=spec.trajectory)


def _system(spec: Spec) -> object:
    """What must be the same for a plan to be compared: names, f and B."""
    B = [[term.expression for term in row] for row in spec.B]
    return spec.states, spec.inputs, [term.expression for term in spec.f], B

"""`check --family`: whether plans belong to a family of plans."""

from __future__ import annotations

from collections.abc import Sequence
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
        from tubecert.library.reading import read

        spec = load_text(read(path).result.spec.effective.text, path)
    else:
        spec = load(path)
    if spec.trajectory.bundle is None:
        message = f"{visible(path)} is about one plan, not about a family"
        help = "a family has trajectory: {kind: any, x: {...}, u: {...}}"
        raise SpecError([Finding(code="TC411", message=message, help=help)])
    return spec


def _member(path: str, family: Spec) -> Checked:
    from tubecert.checking import Checked
    from tubecert.pipeline.membership import NO_MEMBER, UNDECIDED, member_spec, membership

    try:
        findings = membership(member_spec(path, family), family, visible(path))
    except TubecertError as error:
        return Checked(path=path, findings=error.findings, code=error.exit_code)
    codes = {item.code for item in findings if item.severity is Severity.ERROR}
    code = ExitCode.CERTIFIED
    if codes:
        code = ExitCode.NOT_CERTIFIED if NO_MEMBER in codes else ExitCode.UNDECIDED
    assert codes <= {NO_MEMBER, UNDECIDED}
    return Checked(path=path, findings=tuple(findings), code=code)

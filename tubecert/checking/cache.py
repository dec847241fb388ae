"""What checks have found, kept in the user's cache, so that an unchanged file costs nothing.

Findings belong to a text (they have places), outcomes of certifications to the effective specification. Both keys
hold a fingerprint of this program and of the libraries that results rest on. An entry that this user's tubecert has not
written (`kept`), or that does not hold what it should, counts as absent: a cache never changes a verdict.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

from tubecert.checking.expectations import Outcome
from tubecert.findings import Finding
from tubecert.kept import keep, read_kept
from tubecert.libraries import versions
from tubecert.records import from_json, to_json
from tubecert.spec import Spec, canonical

KIND = "checks"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    """Findings as an entry holds them."""

    findings: tuple[Finding, ...]


def key_of_text(what: str, spec: Spec) -> str:
    """The name of what follows from a file's text (and its plan file)."""
    return _key([what, spec.source, list(spec.settings), _plan_file(spec)])


def key_of_system(spec: Spec, gap: Fraction, budget: int) -> str:
    """The name of what follows from the effective specification and the effort; `expect` decides nothing."""
    effective = {name: value for name, value in canonical(spec).items() if name != "expect"}
    return _key(["outcome", effective, _plan_file(spec), str(gap), budget])


def _plan_file(spec: Spec) -> str:
    """The knots: of the same bytes `columns` may make others."""
    return "" if spec.trajectory.table is None else repr(spec.trajectory.table.knots)


def _key(content: Any) -> str:
    return hashlib.sha256(json.dumps([_program(), content], sort_keys=True).encode()).hexdigest()


@cache
def _program() -> list[str]:
    """A fingerprint of the program: its source, and the versions of all that results rest on."""
    package = Path(__file__).parents[1]
    source = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source.update(path.relative_to(package).as_posix().encode() + path.read_bytes())
    return [source.hexdigest(), *(f"{name} {version}" for name, version in versions().items())]


def read_findings(name: str, spec: Spec) -> list[Finding] | None:
    """The findings kept under a name, at their places in the file of `spec`."""
    data = read_kept(KIND, name)
    try:
        kept = None if data is None else from_json(_Kept, data, "findings")
    except ValueError:
        return None
    return None if kept is None else [_placed(item, spec.path) for item in kept.findings]


def write_findings(name: str, findings: list[Finding]) -> None:
    """Keep findings; those of other files (a plan's) are not kept, since these may change."""
    files = {item.location.file for item in findings if item.location}
    if len(files) <= 1:
        keep(KIND, name, to_json(_Kept(findings=tuple(findings))))


def _placed(finding: Finding, path: str) -> Finding:
    """The finding in the file that was asked about: the text is the same, the name may be another."""
    place = finding.location
    return finding if place is None else replace(finding, location=replace(place, file=path))


def read_outcome(name: str) -> Outcome | None:
    """The outcome kept under a name."""
    data = read_kept(KIND, name)
    try:
        return None if data is None else from_json(Outcome, data, KIND)
    except ValueError:
        return None


def write_outcome(name: str, found: Outcome) -> None:
    """Keep an outcome."""
    keep(KIND, name, to_json(found))

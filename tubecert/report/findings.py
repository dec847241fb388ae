"""Findings as text for people and as data for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.text import Text

from tubecert.findings import Finding, Severity

_STYLES = {Severity.ERROR: "bold red", Severity.WARNING: "bold yellow", Severity.NOTE: "bold cyan"}


def render(findings: Sequence[Finding], *, closing: str | None = None) -> list[Text]:
    """The findings in their order, then how many there are (or `closing`)."""
    lines = [_styled(finding) for finding in findings]
    return [*lines, _as_is(_count(findings) if closing is None else closing, "bold")]


def _as_is(text: str, style: str = "") -> Text:
    """Neither wrapped nor cut: places must stay clickable, and carets below what they point at."""
    return Text(text, style, no_wrap=True, overflow="ignore")


def _styled(finding: Finding) -> Text:
    text = _as_is(str(finding))
    word = f"{finding.severity} {finding.code}"
    start = text.plain.find(word)
    text.stylize(_STYLES[finding.severity], start, start + len(word))
    if start > 0:
        text.stylize("bold", 0, start)
    for line in text.plain.splitlines():
        if line.strip() and not line.strip().strip("^"):
            position = text.plain.find(line)
            text.stylize(_STYLES[finding.severity], position, position + len(line))
    if (position := text.plain.rfind("\n  help: ")) >= 0:
        text.stylize("green", position + 3, position + 8)
    return text


def _count(findings: Sequence[Finding]) -> str:
    parts = []
    for severity in Severity:
        number = sum(finding.severity is severity for finding in findings)
        if number:
            parts.append(f"{number} {severity}{'' if number == 1 else 's'}")
    return ", ".join(parts) or "no errors"


def summary(findings: Sequence[Finding], files: int) -> str:
    """How many files were looked at, and how many findings there are."""
    noun = "specification" if files == 1 else "specifications"
    return f"{files} {noun} checked: {_count(findings)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class FindingData:
    """A finding for programs; file, line and column only where it has a place."""

    code: str
    severity: Severity
    message: str
    file: str | None = None
    line: int | None = None
    column: int | None = None
    help: str | None = None


def as_data(finding: Finding) -> FindingData:
    """A finding for programs."""
    place = finding.location
    return FindingData(
        code=finding.code,
        severity=finding.severity,
        message=finding.message,
        file=None if place is None else place.file,
        line=None if place is None else place.line,
        column=None if place is None else place.column,
        help=finding.help or None,
    )

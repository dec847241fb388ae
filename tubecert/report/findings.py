"""Findings as text for people, as a page, and as data for programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from rich.text import Text

from tubecert.findings import Finding, Location, Severity
from tubecert.records import Json
from tubecert.report.page import Page, Section, Table

Place: TypeAlias = Callable[[Location], str]
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


def page_of(name: str, findings: Sequence[Finding], files: int = 1, place: Place = str) -> Page:
    """The page of a check: every finding with its place, as `place` writes it, its words and its remedy."""
    rows = (
        (
            str(item.severity),
            "" if item.location is None else place(item.location),
            item.code,
            item.message,
            item.help,
        )
        for item in findings
    )
    table = Table.of(("", "where", "code", "what", "help"), rows)
    wrong = any(item.severity is not Severity.NOTE for item in findings)
    return Page(
        name=name,
        verdict="warning" if wrong else "checked",
        summary=summary(findings, files),
        sections=(Section(key="findings", title="Findings", blocks=(table,) if findings else ()),),
        about="check",
    )


def as_data(finding: Finding) -> Json:
    """A finding for programs; file, line and column only where it has a place."""
    place, data = finding.location, dict[str, object]()
    data |= {"code": finding.code, "severity": finding.severity.value, "message": finding.message}
    if place is not None:
        data |= {"file": place.file, "line": place.line, "column": place.column}
    return data | ({"help": finding.help} if finding.help else {})

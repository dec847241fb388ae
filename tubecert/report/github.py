"""Findings as GitHub workflow commands (annotations) and as a summary of a step.

A workflow command is one line: `::error file=f,line=1,col=2,title=T::message`. Values are escaped as GitHub's own
toolkit does it (`%`, CR, LF; in properties also `:` and `,`), so that no text of a file can be taken for a command.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

from tubecert.checking import Checked
from tubecert.findings import Finding, Severity
from tubecert.printable import visible
from tubecert.report import markdown
from tubecert.report.findings import page_of, summary

_COMMANDS = {Severity.ERROR: "error", Severity.WARNING: "warning", Severity.NOTE: "notice"}
_DATA = str.maketrans({"%": "%25", "\r": "%0D", "\n": "%0A"})
_PROPERTY = _DATA | str.maketrans({":": "%3A", ",": "%2C"})
_LARGEST_SUMMARY = 1_000_000  # GitHub refuses more than 1 MiB


def render(results: Sequence[Checked]) -> str:
    """One command per finding, then how many there are."""
    findings = [item for result in results for item in result.findings]
    lines = [annotation(item) for item in findings]
    return "\n".join([*lines, summary(findings, len(results))]) + "\n"


def annotation(finding: Finding) -> str:
    """The workflow command of a finding."""
    place = finding.location
    properties: dict[str, object] = {}
    if place is not None:
        properties = {"file": relative(place.file), "line": place.line, "endLine": place.line}
        properties |= {"col": place.column, "endColumn": place.column + place.width}
    properties["title"] = f"tubecert {finding.code}"
    message = finding.message + (f"\nhelp: {finding.help}" if finding.help else "")
    pairs = ",".join(f"{key}={escape_property(str(value))}" for key, value in properties.items())
    return f"::{_COMMANDS[finding.severity]} {pairs}::{escape_data(message)}"


def escape_data(text: str) -> str:
    """A message as it may stand after `::`."""
    return "\n".join(map(visible, text.split("\n"))).translate(_DATA)


def escape_property(text: str) -> str:
    """A value as it may stand between `=` and `,`."""
    return visible(text).translate(_PROPERTY)


def relative(file: str) -> str:
    """The path as GitHub wants it: from the root of the checkout, with forward slashes."""
    root = os.environ.get("GITHUB_WORKSPACE") or os.getcwd()
    with contextlib.suppress(OSError, ValueError):
        return Path(file).resolve().relative_to(Path(root).resolve()).as_posix()
    return Path(file).as_posix()


def step_summary(results: Sequence[Checked]) -> str:
    """The summary of a step, in Markdown, as far as GitHub takes it."""
    findings = [item for result in results for item in result.findings]
    page = page_of(
        "tubecert", findings, len(results), lambda at: f"{relative(at.file)}:{at.line}:{at.column}"
    )
    lines = markdown.render_page(page).splitlines(keepends=True)
    sizes = accumulate(len(line.encode()) for line in lines)
    kept = [line for line, size in zip(lines, sizes, strict=True) if size <= _LARGEST_SUMMARY]
    return "".join(kept) + ("\n... and more\n" if len(kept) < len(lines) else "")


def append_step_summary(results: Sequence[Checked]) -> None:
    """Adds to the file that GitHub names, if it does; that it cannot be written is no failure of the check."""
    target = os.environ.get("GITHUB_STEP_SUMMARY")
    if target:
        with contextlib.suppress(OSError), open(target, "a", encoding="utf-8", errors="replace") as file:
            file.write(step_summary(results))


def detected() -> bool:
    """Whether this runs in a workflow of GitHub."""
    return os.environ.get("GITHUB_ACTIONS") == "true"

"""A finding: what is wrong (or noteworthy), where, and what to do about it.

Codes are stable: TC1xx specification, TC2xx model, TC3xx metric, TC4xx tube and plan, TC5xx conditions. A finding is
small whatever the file is like: it keeps a part of a long line and the beginning of a long message; its words hold
nothing that does not print, whatever they quote.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from tubecert.printable import blanked, visible

MOST: Final = 100  # findings of a file that are shown; what comes after them is only counted
_EXCERPT: Final = 160
_MESSAGE: Final = 2_000


class Severity(StrEnum):
    """How much a finding matters."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True, kw_only=True)
class Location:
    """A place in a text file: line and column count from 1; `width` characters are underlined.

    `source` is the line, or the part of a long one around the column that is left when it is given here: `skipped`
    characters of the line are before it.
    """

    file: str
    line: int
    column: int
    source: str = ""
    width: int = 1
    skipped: int = 0

    def __post_init__(self) -> None:
        if len(self.source) > _EXCERPT:
            start = max(0, self.column - 1 - self.skipped - _EXCERPT // 2)
            object.__setattr__(self, "source", self.source[start : start + _EXCERPT])
            object.__setattr__(self, "skipped", self.skipped + start)

    def __str__(self) -> str:
        return f"{visible(self.file)}:{self.line}:{self.column}"

    def excerpt(self) -> str:
        """The source line with a caret line below it."""
        if not self.source.strip():
            return ""
        line = blanked(self.source)
        caret = min(max(0, self.column - 1 - self.skipped), len(line))
        width = max(1, min(self.width, len(line) - caret))
        return f"    {line}\n    {' ' * caret}{'^' * width}"


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedPlace(Location):
    """A place in the value of an option or an argument: its name stands for file, line and column."""

    def __str__(self) -> str:
        return self.file


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing to report; `help` says what to write or do instead."""

    code: str
    message: str
    severity: Severity = Severity.ERROR
    location: Location | None = None
    help: str = ""

    def __post_init__(self) -> None:
        for name in ("message", "help"):
            text = getattr(self, name)
            cut = text if len(text) <= _MESSAGE else f"{text[:_MESSAGE]}..."
            object.__setattr__(self, name, visible(cut))

    def __str__(self) -> str:
        """The finding as text: `file:line:col: error TC101: message`, excerpt, help."""
        where = f"{self.location}: " if self.location else ""
        lines = [f"{where}{self.severity} {self.code}: {self.message}"]
        if self.location and (excerpt := self.location.excerpt()):
            lines.append(excerpt)
        if self.help:
            lines.append(f"  help: {self.help}")
        return "\n".join(lines)


def capped(findings: Sequence[Finding], code: str, most: int = MOST) -> list[Finding]:
    """The first of them, and a finding with `code` that says how many more there are."""
    if len(findings) <= most:
        return list(findings)
    last, rest = findings[most - 1], findings[most:]
    severity = min((item.severity for item in rest), key=list(Severity).index)
    more = Finding(code=code, message=f"and {len(rest):,} more", severity=severity, location=last.location)
    return [*findings[:most], more]

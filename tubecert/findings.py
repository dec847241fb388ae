"""A finding: what is wrong (or noteworthy), where, and what to do about it.

Codes are stable: TC1xx specification, TC2xx model, TC3xx metric, TC4xx tube and plan, TC5xx conditions.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """How much a finding matters."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


@dataclass(frozen=True, slots=True, kw_only=True)
class Location:
    """A place in a text file: line and column count from 1; `width` characters are underlined."""

    file: str
    line: int
    column: int
    source: str = ""
    width: int = 1

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def excerpt(self, limit: int = 160) -> str:
        """The source line with a caret line below it, cut to `limit` characters around the caret."""
        if not self.source.strip():
            return ""
        start = max(0, self.column - 1 - limit // 2)
        line = self.source[start : start + limit]
        caret = min(self.column - 1 - start, len(line))
        width = max(1, min(self.width, len(line) - caret))
        return f"    {line}\n    {' ' * caret}{'^' * width}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing to report; `help` says what to write or do instead."""

    code: str
    message: str
    severity: Severity = Severity.ERROR
    location: Location | None = None
    help: str = ""

    def __str__(self) -> str:
        """The finding as text: `file:line:col: error TC101: message`, excerpt, help."""
        where = f"{self.location}: " if self.location else ""
        lines = [f"{where}{self.severity} {self.code}: {self.message}"]
        if self.location and (excerpt := self.location.excerpt()):
            lines.append(excerpt)
        if self.help:
            lines.append(f"  help: {self.help}")
        return "\n".join(lines)

"""Comma-separated files: cells with their places, and numbers read exactly from their text.

A specification may come from a stranger and name any file that its reader may read. So nothing of a file is shown
unless it is known to be what it was taken for.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Final

from tubecert.errors import TubecertError
from tubecert.expression import ExpressionError, parse_number
from tubecert.expression.scan import MAX_NUMBER_EXPONENT, MAX_NUMBER_LENGTH
from tubecert.files import read
from tubecert.findings import Finding, Location
from tubecert.spec import codes
from tubecert.spec.reader import Field, T
from tubecert.spec.source import PLAN, Mark, Source, decoded
from tubecert.spec.values import MODERATE, out_of_range

MAX_COLUMNS: Final = 200
ENOUGH: Final = 20  # findings of one file

_DECIMAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE]([+-]?\d+))?", re.ASCII)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A cell's text without its surroundings, and where it stands in its line."""

    text: str = ""
    line: int
    column: int = 0


@dataclass(slots=True, kw_only=True)
class Sheet:
    """A file being read, and what is wrong with it; its lines are `shown` once it is known to be what it should.

    `name` as written, `data` its bytes; `lines`: where the header and every row of numbers stand.
    """

    name: str
    data: bytes = field(repr=False)
    source: Source
    shown: bool = False
    findings: list[Finding] = field(default_factory=list)
    lines: list[Location] = field(default_factory=list)

    def fail(self, cell: Cell, code: str, message: str, help: str = "") -> T | None:
        """Adds a finding at a cell; None, which is read in its place."""
        mark = Mark(line=cell.line, column=cell.column)
        location = self.source.location(mark, len(cell.text))
        location = location if self.shown else replace(location, source="")
        self.findings.append(Finding(code=code, message=message, location=location, help=help))
        return None

    def note(self, cells: list[Cell]) -> None:
        """Keeps where a line stands; its text is not kept."""
        self.lines.append(Location(file=self.source.file, line=cells[0].line + 1, column=1))


def opened(entry: Field) -> Sheet | None:
    """The file that a specification names, relative to the specification's own folder."""
    name = entry.text("the name of a CSV file")
    if name is None:
        return None
    if not name.isprintable():
        return entry.fail(
            codes.NAME, "the name of the file holds a character that does not print", "rename the file"
        )
    path = Path(entry.reader.source.file).parent / name
    try:
        data = read(str(path), PLAN)
        return Sheet(name=name, data=data, source=decoded(str(path), data))
    except TubecertError as error:
        _forward(entry, error)
        return None


def _forward(entry: Field, error: TubecertError) -> None:
    """What is wrong with the file as a whole: located in it if it could be read, else where it is named."""
    for finding in error.findings:
        if finding.location is not None:
            unseen = replace(finding.location, source="")
            entry.reader.findings.append(replace(finding, location=unseen))
        else:
            entry.fail(
                finding.code, finding.message, "the name is relative to the folder of the specification"
            )


def rows(sheet: Sheet, what: str) -> Iterator[list[Cell]]:
    """The cells of every line that is not blank, up to the first line that has too many."""
    for number, line in enumerate(sheet.source.lines):
        if line.count(",") >= MAX_COLUMNS:
            message = f"the line has {line.count(',') + 1:,} cells; {what} has at most {MAX_COLUMNS} columns"
            sheet.fail(Cell(line=number), codes.LIMIT, message)
            return
        if line.strip():
            yield list(_cells(line, number))


def _cells(line: str, number: int) -> Iterator[Cell]:
    start = 0
    for part in line.split(","):
        text = part.strip()
        column = start + len(part) - len(part.lstrip())
        if len(text) >= 2 and text[0] == text[-1] == '"':
            text, column = text[1:-1].strip(), column + 1
        yield Cell(text=text, line=number, column=min(column, len(line)))
        start += len(part) + 1


def is_decimal(cell: Cell) -> bool:
    """Whether a cell looks like a number, of whatever size."""
    return _DECIMAL.fullmatch(cell.text) is not None


def number(sheet: Sheet, cell: Cell, help: str = "") -> Fraction | None:
    """The number that a cell is; what is none is a finding, with `help` and no text if the sheet may be anything."""
    if not sheet.shown and not is_decimal(cell):
        return sheet.fail(cell, codes.NUMBER, "this cell is not a decimal number", help)
    match = _DECIMAL.fullmatch(cell.text)
    if match and len(cell.text) <= MAX_NUMBER_LENGTH and abs(int(match[1] or 0)) <= MAX_NUMBER_EXPONENT:
        value = Fraction(cell.text)
        if extreme := out_of_range(value):
            return sheet.fail(cell, codes.LIMIT, f"{cell.text[:40]} is {extreme}", MODERATE)
        return value
    code, message = codes.NUMBER, f"{cell.text[:40]!r} is not a decimal number"
    try:
        parse_number(cell.text)
    except ExpressionError as error:
        code = codes.LIMIT if error.kind == "limit" else codes.NUMBER
        message, help = error.message, error.help
        if cell.text.lower() == "nan":
            help = "give the value, or leave the row out"
    return sheet.fail(cell, code, message, help)

"""A plan file (CSV): text -> exact knots, or every problem of the file as located findings.

The first line names the columns: t, every state and every input, in any order. Each further line is a knot; times
begin at 0 and increase. Numbers are read exactly from their text.

A specification may come from a stranger and name any file that its reader may read. So nothing of a file is shown that
is not a plan: names of columns if one of them is wanted, lines of numbers below a header that is complete.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Final

from tubecert.errors import TubecertError
from tubecert.expression import ExpressionError, parse_number, suggestion
from tubecert.expression.scan import MAX_NUMBER_EXPONENT, MAX_NUMBER_LENGTH
from tubecert.files import read
from tubecert.findings import Finding, Location, capped
from tubecert.spec import codes
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import MODERATE, Field, out_of_range
from tubecert.spec.source import PLAN, Mark, Source, decoded
from tubecert.spec.types import Interpolation, Knots, Table

MAX_ROWS: Final = 10_001
MAX_COLUMNS: Final = 200

_DECIMAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE]([+-]?\d+))?", re.ASCII)
_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}", re.ASCII)
_ENOUGH: Final = 20  # findings of one file


@dataclass(frozen=True, slots=True, kw_only=True)
class _Cell:
    """A cell's text without its surroundings, and where it stands in its line."""

    text: str
    line: int
    column: int


@dataclass(slots=True, kw_only=True)
class _Sheet:
    """A file being read, and what is wrong with it; its lines are `shown` once it is known to be a plan.

    `lines`: where the header and every row of numbers stand.
    """

    source: Source
    shown: bool = False
    findings: list[Finding] = field(default_factory=list)
    lines: list[Location] = field(default_factory=list)

    def fail(self, cell: _Cell, code: str, message: str, help: str = "") -> None:
        """Adds a finding at a cell."""
        mark = Mark(line=cell.line, column=cell.column)
        location = self.source.location(mark, len(cell.text))
        location = location if self.shown else replace(location, source="")
        self.findings.append(Finding(code=code, message=message, location=location, help=help))

    def note(self, cells: list[_Cell]) -> None:
        """Keeps where a line stands; its text is not kept."""
        self.lines.append(Location(file=self.source.file, line=cells[0].line + 1, column=1))


def read_table(entry: Field, names: Names, interpolation: Interpolation) -> Table | None:
    """The plan file that a specification names, relative to the specification's own folder."""
    name = entry.text("the name of a CSV file")
    if name is None:
        return None
    if not name.isprintable():
        entry.fail(
            codes.NAME, "the name of the file holds a character that does not print", "rename the file"
        )
        return None
    path = Path(entry.reader.source.file).parent / name
    try:
        data = read(str(path), PLAN)
        sheet = _Sheet(source=decoded(str(path), data))
    except TubecertError as error:
        _forward(entry, error)
        return None
    knots = _read(sheet, names, interpolation)
    entry.reader.findings.extend(capped(sheet.findings, codes.LIMIT, _ENOUGH))
    if knots is None or sheet.findings:
        return None
    header, *rows = sheet.lines
    return Table(
        file=name, sha256=hashlib.sha256(data).hexdigest(), knots=knots, header=header, rows=tuple(rows)
    )


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


def _read(sheet: _Sheet, names: Names, interpolation: Interpolation) -> Knots | None:
    rows = _rows(sheet)
    header = next(rows, None)
    if sheet.findings:
        return None
    if header is None:
        message = "the plan file is empty"
        sheet.fail(_Cell(text="", line=0, column=0), codes.PLAN_COLUMNS, message, _wanted(names))
        return None
    columns = _columns(sheet, header, names)
    if columns is None:
        return None
    sheet.note(header)
    values: list[list[Fraction]] = []
    for row in rows:
        if len(values) == MAX_ROWS:
            sheet.fail(row[0], codes.LIMIT, f"a plan has at most {MAX_ROWS:,} rows", "give every second knot")
            return None
        numbers = _numbers(sheet, row, len(header))
        if numbers is not None:
            _check_time(
                sheet, row[columns[0]], numbers[columns[0]], [line[columns[0]] for line in values[-1:]]
            )
            values.append(numbers)
            sheet.note(row)
        if len(sheet.findings) >= _ENOUGH:
            return None
    if sheet.findings:
        return None
    if len(values) < 2:
        last = header[0] if not values else _Cell(text="", line=len(sheet.source.lines) - 1, column=0)
        sheet.fail(last, codes.PLAN_TIMES, f"a plan needs 2 rows or more below its header, not {len(values)}")
        return None
    if interpolation == "hermite-simpson" and len(values) % 2 == 0:
        last = _Cell(text="", line=len(sheet.source.lines) - 1, column=0)
        message = f"hermite-simpson needs an odd number of rows, not {len(values)}"
        help = "rows are in turn a knot and the point between it and the next knot"
        sheet.fail(last, codes.PLAN_TIMES, message, help)
        return None
    n = len(names.states)
    return Knots(
        t=tuple(row[columns[0]] for row in values),
        x=tuple(tuple(row[c] for c in columns[1 : n + 1]) for row in values),
        u=tuple(tuple(row[c] for c in columns[n + 1 :]) for row in values),
        interpolation=interpolation,
    )


def _rows(sheet: _Sheet) -> Iterator[list[_Cell]]:
    """The cells of every line that is not blank, up to the first line that has too many."""
    for number, line in enumerate(sheet.source.lines):
        if line.count(",") >= MAX_COLUMNS:
            message = f"the line has {line.count(',') + 1:,} cells; a plan has at most {MAX_COLUMNS} columns"
            sheet.fail(_Cell(text="", line=number, column=0), codes.LIMIT, message)
            return
        if line.strip():
            yield list(_cells(line, number))


def _cells(line: str, number: int) -> Iterator[_Cell]:
    start = 0
    for part in line.split(","):
        text = part.strip()
        column = start + len(part) - len(part.lstrip())
        if len(text) >= 2 and text[0] == text[-1] == '"':
            text, column = text[1:-1].strip(), column + 1
        yield _Cell(text=text, line=number, column=min(column, len(line)))
        start += len(part) + 1


def _columns(sheet: _Sheet, header: list[_Cell], names: Names) -> list[int] | None:
    """Where t, the states and the inputs stand."""
    wanted = (TIME, *names.states, *names.inputs)
    if header[0].text.startswith("#"):  # as numpy.savetxt writes it
        bare = header[0].text.lstrip("# \t")
        moved = header[0].column + len(header[0].text) - len(bare)
        header[0] = _Cell(text=bare, line=header[0].line, column=moved)
    if not any(cell.text in wanted for cell in header):
        cells = "has 1 cell, which is" if len(header) == 1 else f"has {len(header)} cells, none of which is"
        message = f"the first line {cells} t, a state or an input"
        commas = len(header) == 1 and re.search(r"[;\t ]", header[0].text)
        sheet.fail(
            _Cell(text="", line=header[0].line, column=0),
            codes.PLAN_COLUMNS,
            message,
            f"separate columns by commas; {_wanted(names)}" if commas else _wanted(names),
        )
        return None
    sheet.shown = all(_COLUMN.fullmatch(cell.text) for cell in header)
    place = _placed(sheet, header, wanted)
    missing = [name for name in wanted if name not in place]
    if missing and not sheet.findings:
        message = f"the plan file lacks {'a column' if len(missing) == 1 else 'columns'} {', '.join(missing)}"
        sheet.fail(header[0], codes.PLAN_COLUMNS, message, _wanted(names))
    return None if sheet.findings else [place[name] for name in wanted]


def _placed(sheet: _Sheet, header: list[_Cell], wanted: tuple[str, ...]) -> dict[str, int]:
    """The columns by name; those that are not wanted, or occur twice, are findings."""
    place: dict[str, int] = {}
    for index, cell in enumerate(header):
        if cell.text in place:
            sheet.fail(cell, codes.PLAN_COLUMNS, f"the column {cell.text} occurs twice", "keep one")
        elif cell.text in wanted:
            place[cell.text] = index
        else:
            said = f"{cell.text!r}" if _COLUMN.fullmatch(cell.text) else f"the name of column {index + 1}"
            message = f"{said} is neither t nor a state nor an input"
            help = suggestion(cell.text, wanted, what="columns") if sheet.shown else _wanted_of(wanted)
            sheet.fail(cell, codes.PLAN_COLUMNS, message, help)
    return place


def _wanted(names: Names) -> str:
    return _wanted_of((TIME, *names.states, *names.inputs))


def _wanted_of(columns: tuple[str, ...]) -> str:
    return f"the first line names the columns: {','.join(columns)}"


def _numbers(sheet: _Sheet, row: list[_Cell], width: int) -> list[Fraction] | None:
    """The numbers of a row; another number of cells than in the header is a finding."""
    if len(row) != width:
        count = "1 cell" if len(row) == 1 else f"{len(row)} cells"
        where = row[-1] if len(row) < width else row[width]
        sheet.fail(where, codes.PLAN_COLUMNS, f"the row has {count}; the header names {width} columns")
        return None
    numbers = [_number(sheet, cell) for cell in row]
    kept = [number for number in numbers if number is not None]
    return kept if len(kept) == width else None


def _number(sheet: _Sheet, cell: _Cell) -> Fraction | None:
    match = _DECIMAL.fullmatch(cell.text)
    if match and len(cell.text) <= MAX_NUMBER_LENGTH and abs(int(match[1] or 0)) <= MAX_NUMBER_EXPONENT:
        value = Fraction(cell.text)
        if extreme := out_of_range(value):
            sheet.fail(cell, codes.LIMIT, f"{cell.text[:40]} is {extreme}", MODERATE)
            return None
        return value
    code, message, help = codes.NUMBER, f"{cell.text[:40]!r} is not a decimal number", ""
    try:
        parse_number(cell.text)
    except ExpressionError as error:
        code = codes.LIMIT if error.kind == "limit" else codes.NUMBER
        message, help = error.message, error.help
    sheet.fail(cell, code, message, help)
    return None


def _check_time(sheet: _Sheet, cell: _Cell, t: Fraction, before: list[Fraction]) -> None:
    """Times begin at 0 and increase."""
    if not before and t != 0:
        sheet.fail(cell, codes.PLAN_TIMES, f"the plan begins at t = {cell.text}, not at 0", "shift the times")
    elif before and t <= before[0]:
        message = f"t = {cell.text} does not lie after the time before it"
        sheet.fail(cell, codes.PLAN_TIMES, message, "times must increase from row to row")

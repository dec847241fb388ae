"""A plan file (CSV): text -> exact knots, or every problem of the file as located findings.

The first line names the columns: t, every state and every input, in any order. Each further line is a knot; times
begin at 0 and increase. Numbers are read exactly from their text.

A specification may come from a stranger and name any file that its reader may read. So nothing of a file is shown that
is not a plan: names of columns if one of them is wanted, lines of numbers below a header that is complete.
"""

from __future__ import annotations

import hashlib
import re
from fractions import Fraction
from typing import Final

from tubecert.expression import suggestion
from tubecert.findings import capped
from tubecert.spec import codes
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field
from tubecert.spec.sheet import ENOUGH, Cell, Sheet, number, opened, rows
from tubecert.spec.values import Interpolation, Knots, Table

MAX_ROWS: Final = 10_001
_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}", re.ASCII)


def read_table(entry: Field, names: Names, interpolation: Interpolation) -> Table | None:
    """The plan file that a specification names, relative to the specification's own folder."""
    file = opened(entry)
    if file is None:
        return None
    sheet = file.sheet
    knots = _read(sheet, names, interpolation)
    entry.reader.findings.extend(capped(sheet.findings, codes.LIMIT, ENOUGH))
    if knots is None or sheet.findings:
        return None
    header, *rows = sheet.lines
    return Table(
        file=file.name,
        sha256=hashlib.sha256(file.data).hexdigest(),
        knots=knots,
        header=header,
        rows=tuple(rows),
    )


def _read(sheet: Sheet, names: Names, interpolation: Interpolation) -> Knots | None:
    lines = rows(sheet, "a plan")
    header = next(lines, None)
    if sheet.findings:
        return None
    if header is None:
        message = "the plan file is empty"
        sheet.fail(Cell(text="", line=0, column=0), codes.PLAN_COLUMNS, message, _wanted(names))
        return None
    columns = _columns(sheet, header, names)
    if columns is None:
        return None
    sheet.note(header)
    values: list[list[Fraction]] = []
    for row in lines:
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
        if len(sheet.findings) >= ENOUGH:
            return None
    if sheet.findings:
        return None
    if len(values) < 2:
        last = header[0] if not values else Cell(text="", line=len(sheet.source.lines) - 1, column=0)
        sheet.fail(last, codes.PLAN_TIMES, f"a plan needs 2 rows or more below its header, not {len(values)}")
        return None
    if interpolation == "hermite-simpson" and len(values) % 2 == 0:
        last = Cell(text="", line=len(sheet.source.lines) - 1, column=0)
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


def _columns(sheet: Sheet, header: list[Cell], names: Names) -> list[int] | None:
    """Where t, the states and the inputs stand."""
    wanted = (TIME, *names.states, *names.inputs)
    if header[0].text.startswith("#"):  # as numpy.savetxt writes it
        bare = header[0].text.lstrip("# \t")
        moved = header[0].column + len(header[0].text) - len(bare)
        header[0] = Cell(text=bare, line=header[0].line, column=moved)
    if not any(cell.text in wanted for cell in header):
        cells = "has 1 cell, which is" if len(header) == 1 else f"has {len(header)} cells, none of which is"
        message = f"the first line {cells} t, a state or an input"
        commas = len(header) == 1 and re.search(r"[;\t ]", header[0].text)
        sheet.fail(
            Cell(text="", line=header[0].line, column=0),
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


def _placed(sheet: Sheet, header: list[Cell], wanted: tuple[str, ...]) -> dict[str, int]:
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


def _numbers(sheet: Sheet, row: list[Cell], width: int) -> list[Fraction] | None:
    """The numbers of a row; another number of cells than in the header is a finding."""
    if len(row) != width:
        count = "1 cell" if len(row) == 1 else f"{len(row)} cells"
        where = row[-1] if len(row) < width else row[width]
        sheet.fail(where, codes.PLAN_COLUMNS, f"the row has {count}; the header names {width} columns")
        return None
    numbers = [number(sheet, cell) for cell in row]
    kept = [number for number in numbers if number is not None]
    return kept if len(kept) == width else None


def _check_time(sheet: Sheet, cell: Cell, t: Fraction, before: list[Fraction]) -> None:
    """Times begin at 0 and increase."""
    if not before and t != 0:
        sheet.fail(cell, codes.PLAN_TIMES, f"the plan begins at t = {cell.text}, not at 0", "shift the times")
    elif before and t <= before[0]:
        message = f"t = {cell.text} does not lie after the time before it"
        sheet.fail(cell, codes.PLAN_TIMES, message, "times must increase from row to row")

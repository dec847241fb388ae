"""A plan file (CSV): text -> exact knots, or every problem of the file as located findings.

The first line names the columns: t, every state and every input, in any order; `columns` may give them other names and
a factor, and then others are skipped. Each further line is a knot; times increase, and the first one becomes 0. Numbers
are read exactly from their text; times a factor they are decimals of `DIGITS` digits. The last row may lack inputs, as
plans of N inputs for N + 1 states do: they stay as in the row before it.

A specification may come from a stranger and name any file that its reader may read. So nothing of a file is shown that
is not a plan: names of columns if one of them is wanted, lines of numbers below a header that is complete.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Final

from tubecert.expression.lookup import DIGITS, rounded
from tubecert.findings import capped
from tubecert.spec import codes, keys
from tubecert.spec.keys import key, section
from tubecert.spec.names import TIME, Names
from tubecert.spec.reader import Field, whole
from tubecert.spec.sheet import ENOUGH, Cell, Sheet, number, opened, rows
from tubecert.spec.values import MODERATE, Interpolation, Knots, Table, out_of_range

MAX_ROWS: Final = 10_001
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,39}", re.ASCII)
_ABSENT: Final = ("", "nan")


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """Where t, a state or an input stands in a plan file, and in which unit."""

    name: str = key(keys.Kind(lambda own, _: own.text("the name of a column"), {"type": "string"}), "")
    """Its name in the first line; by default its own."""
    scale: Fraction = key(keys.number(), Fraction(1), example="1/1000")
    """What its numbers are multiplied by: 1/1000 for ms, 1 deg for degrees."""


_COLUMN: Final = section(Column)


def _read_columns(field: Field, names: Names) -> tuple[Column, ...] | None:
    """The columns of t, the states and the inputs."""
    fields = field.mapping(optional=_variables(names)) or {}
    return whole(_read_column(name, fields.get(name), names) for name in _variables(names))


def _read_column(name: str, field: Field | None, names: Names) -> Column | None:
    if field is not None and field.node.kind == "scalar":
        return Column(name=field.node.text)
    found: Column | None = Column() if field is None else _COLUMN.read(field, names)
    if field is not None and found is not None and (not found.scale or (name == "t" and found.scale < 0)):
        return field.fail(
            codes.RANGE, f"{field.path}.scale is {found.scale}", "write 1/1000 for ms, 1 deg for degrees"
        )
    return found and replace(found, name=found.name or name)


COLUMNS: Final = keys.Kind(_read_columns, keys.by_name({"anyOf": [{"type": "string"}, {"section": _COLUMN}]}))


def read_table(
    entry: Field, columns: tuple[Column, ...] | None, names: Names, interpolation: Interpolation
) -> Table | None:
    """The plan file that a specification names, relative to the specification's own folder."""
    sheet = opened(entry)
    if sheet is None:
        return None
    found, n = _PlanFile(sheet, columns, names).rows(interpolation), len(names.states)
    entry.reader.findings.extend(capped(sheet.findings, codes.LIMIT, ENOUGH))
    if found is None or sheet.findings:
        return None
    header, *lines = sheet.lines
    return Table(
        file=sheet.name,
        sha256=hashlib.sha256(sheet.data).hexdigest(),
        knots=Knots(
            t=tuple(row[0] - found[0][0] for row in found),
            x=tuple(tuple(row[1 : n + 1]) for row in found),
            u=tuple(tuple(row[n + 1 :]) for row in found),
            interpolation=interpolation,
        ),
        begins=found[0][0],
        header=header,
        rows=tuple(lines),
    )


class _PlanFile:
    """A plan file being read: where t, the states and the inputs stand, and in which names and units."""

    def __init__(self, sheet: Sheet, columns: tuple[Column, ...] | None, names: Names) -> None:
        self.sheet, self.others = sheet, columns is not None  # whether there may be others
        self.columns = columns or tuple(Column(name=name) for name in _variables(names))
        self.wanted = tuple(column.name for column in self.columns)
        self.kept = len(self.columns) - len(names.inputs)  # t and the states, which no row may lack
        self.last = max((k for k, line in enumerate(sheet.source.lines) if line.strip()), default=0)
        self.width = 0
        self.places: list[int] = []

    def rows(self, interpolation: Interpolation) -> list[list[Fraction]] | None:
        """The rows as t, states, inputs."""
        sheet, lines = self.sheet, rows(self.sheet, "a plan")
        header = next(lines, None)
        if sheet.findings:
            return None
        if header is None:
            return sheet.fail(Cell(line=0), codes.PLAN_COLUMNS, "the plan file is empty", self._all())
        if not self._is_header(header):
            return None
        sheet.note(header)
        values: list[list[Fraction]] = []
        for row in lines:
            if len(values) == MAX_ROWS:
                message = f"a plan has at most {MAX_ROWS:,} rows"
                return sheet.fail(row[0], codes.LIMIT, message, "give every second knot")
            if len(row) == 2 * self.width:
                message = f"the row has {len(row)} cells, twice as many as the header: decimal commas?"
                return sheet.fail(row[0], codes.PLAN_COLUMNS, message, "write decimals with a point")
            numbers = self._numbers(row, values[-1] if values else None)
            if numbers is not None:
                sheet.shown = True
                values.append(numbers)
                sheet.note(row)
            if len(sheet.findings) >= ENOUGH:
                return None
        last = Cell(line=len(sheet.source.lines) - 1)
        if len(values) < 2 and not sheet.findings:
            message = f"a plan needs 2 rows or more below its header, not {len(values)}"
            sheet.fail(last if values else header[0], codes.PLAN_TIMES, message)
        elif interpolation == "hermite-simpson" and len(values) % 2 == 0 and not sheet.findings:
            message = f"hermite-simpson needs an odd number of rows, not {len(values)}"
            help = "rows are in turn a knot and the point between it and the next knot"
            sheet.fail(last, codes.PLAN_TIMES, message, help)
        return None if sheet.findings else values

    def _is_header(self, header: list[Cell]) -> bool:
        """Whether the first line names t, the states and the inputs, perhaps among others."""
        sheet = self.sheet
        if header[0].text.startswith("#"):  # as numpy.savetxt writes it
            bare = header[0].text.lstrip("# \t")
            moved = header[0].column + len(header[0].text) - len(bare)
            header[0] = Cell(text=bare, line=header[0].line, column=moved)
        if not any(cell.text in self.wanted for cell in header):
            message = "no cell of the first line is t, a state or an input"
            commas = len(header) == 1 and re.search(r"[;\t ]", header[0].text)
            apart = "separate columns by commas, and write decimals with a point; " if commas else ""
            sheet.fail(Cell(line=header[0].line), codes.PLAN_COLUMNS, message, f"{apart}{self._all()}")
            return False
        # of columns with names that a stranger chose nothing is shown before a row of numbers
        sheet.shown = not self.others and all(_NAME.fullmatch(cell.text) for cell in header)
        place = {cell.text: k for k, cell in reversed([*enumerate(header)]) if cell.text in self.wanted}
        for k, cell in enumerate(header):
            if place.get(cell.text, k) < k:
                sheet.fail(cell, codes.PLAN_COLUMNS, f"the column {cell.text} occurs twice", "keep one")
        missing = [name for name in self.wanted if name not in place]
        strange = [] if self.others else [cell for cell in header if cell.text not in self.wanted]
        if (missing or strange) and not sheet.findings:
            what = "a column" if len(missing) == 1 else "columns"
            names = ", ".join(cell.text for cell in strange)[:80] if sheet.shown else "others"
            told = [f"lacks {what} {', '.join(missing)}"] * bool(missing)
            told += [f"has {names}, neither t nor state nor input"] * bool(strange)
            own = f"{missing[0]}: {strange[0].text if sheet.shown and strange else 'NAME'}" if missing else ""
            help = f"{self._all()}; trajectory.columns gives others, and skips some: columns: {{{own}}}"
            message, where = f"the plan file {' and '.join(told)}", (strange or header)[0]
            sheet.fail(where, codes.PLAN_COLUMNS, message, help)
        self.width, self.places = len(header), [place.get(name, 0) for name in self.wanted]
        return not sheet.findings

    def _all(self) -> str:
        return f"the first line names the columns: {','.join(self.wanted)}"

    def _numbers(self, row: list[Cell], before: list[Fraction] | None) -> list[Fraction] | None:
        """The numbers of a row, whose time lies after the one `before`; in the last one inputs may be absent."""
        ends = before is not None and row[0].line == self.last
        if ends and len(row) > max(self.places[: self.kept]):
            row = row + [replace(row[-1], text="")] * (self.width - len(row))
        if len(row) != self.width:
            count = "1 cell" if len(row) == 1 else f"{len(row)} cells"
            where = row[-1] if len(row) < self.width else row[self.width]
            message = f"the row has {count}; the header names {self.width} columns"
            return self.sheet.fail(where, codes.PLAN_COLUMNS, message)
        found: list[Fraction | None] = []
        for k, (place, column) in enumerate(zip(self.places, self.columns, strict=True)):
            absent = k >= self.kept and row[place].text.lower() in _ABSENT
            own = before[k] if absent and ends and before else self._number(row[place], column, absent=absent)
            found.append(own)
        sound = whole(found)
        if sound and before and sound[0] <= before[0]:
            cell = row[self.places[0]]
            message = f"t = {cell.text[:40]} does not lie after the time before it"
            self.sheet.fail(cell, codes.PLAN_TIMES, message, "times must increase from row to row")
        return None if sound is None else list(sound)

    def _number(self, cell: Cell, column: Column, *, absent: bool) -> Fraction | None:
        if absent:
            message = "an input is missing in this row; the last row alone may lack inputs"
            help = "give the value (if it is held, that before it), or leave the row out"
            return self.sheet.fail(cell, codes.NUMBER, message, help)
        value = number(self.sheet, cell)
        if value is None or column.scale == 1:
            return value
        scaled = rounded(value * column.scale, DIGITS)
        if extreme := out_of_range(scaled):
            self.sheet.fail(cell, codes.LIMIT, f"{cell.text[:40]} in its scale is {extreme}", MODERATE)
        return scaled


def _variables(names: Names) -> tuple[str, ...]:
    return (TIME, *names.states, *names.inputs)

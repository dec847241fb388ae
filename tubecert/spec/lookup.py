"""The tables of a system, `system.tables`: from a CSV file or points in the specification to exact functions.

A row is x, y, and with `interpolation: slopes` the slope there. x increases from row to row. The first line of a file
may name the columns.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from tubecert.expression import Expression, Lookup
from tubecert.expression.lookup import Numbers, cubic_slopes, monotone_slopes
from tubecert.findings import capped
from tubecert.spec import codes
from tubecert.spec.keys import PAIR, Section, entry, form
from tubecert.spec.reader import Field
from tubecert.spec.sheet import ENOUGH, Cell, Sheet, is_decimal, number, opened, rows
from tubecert.spec.values import Vector

MOST_KNOTS: Final = 500
SLOPES: Final = "slopes"

_MADE: Final[Mapping[str, Callable[[Numbers, Numbers], Vector]]] = {
    "monotone": monotone_slopes,
    "cubic": cubic_slopes,
}
TABLE: Final = Section(
    words="A table: a file or points.",
    keys={
        "file": entry(
            form({"type": "string"}),
            words="A CSV file of two columns x, y (with interpolation: slopes of three), relative to the folder of "
            "this file; x increases. A first line may name the columns.",
        ),
        "points": entry(
            form({"type": "array", "items": {**PAIR, "maxItems": 3}, "minItems": 2, "maxItems": MOST_KNOTS}),
            words="The same, written down: [x, y], with interpolation: slopes [x, y, slope].",
        ),
        "interpolation": entry(
            form({"enum": [*_MADE, SLOPES]}),
            words="How the curve runs between points: monotone keeps rising tables rising (PCHIP), cubic is the spline "
            "with continuous curvature (not-a-knot), slopes takes those that are given.",
            said="monotone",
        ),
    },
)


def read_lookup(name: str, field: Field, parameters: Mapping[str, Expression]) -> Lookup | None:
    """One table; None if anything is wrong with it, which has been reported."""
    own = TABLE.entries(field)
    if own is None:
        return None
    kind = own["interpolation"].word((*_MADE, SLOPES)) if "interpolation" in own else "monotone"
    if ("file" in own) == ("points" in own):
        message = f"{field.path} needs {'either ' if 'file' in own else ''}a file or points"
        return field.fail(codes.MISSING_KEY, message, "write {file: NAME.csv}, or {points: [[x, y], [x, y]]}")
    if kind is None:
        return None
    width = 3 if kind == SLOPES else 2
    found = _from_file(own["file"], width) if "file" in own else _points(own["points"], width, parameters)
    if found is None:
        return None
    x, y, *slopes = zip(*found, strict=True)
    return Lookup(name, x, y, slopes[0] if slopes else _MADE[kind](x, y))


def _points(entry: Field, width: int, parameters: Mapping[str, Expression]) -> list[Numbers] | None:
    items = entry.items(None, "points", "write [[x, y], [x, y]]")
    if items is None:
        return None
    if not 2 <= len(items) <= MOST_KNOTS:
        return entry.fail(codes.TABLE, f"{entry.path} has {len(items)} points; a table has 2 to {MOST_KNOTS}")
    found: list[Numbers] = []
    for item in items:
        row = item.numbers(width, parameters)
        if row is None:
            return None
        if found and row[0] <= found[-1][0]:
            return item.fail(codes.TABLE, f"{item.path}: {_order(str(float(row[0])))}", _SORTED)
        found.append(row)
    return found


def _from_file(entry: Field, width: int) -> list[Numbers] | None:
    sheet = opened(entry)
    if sheet is None:
        return None
    found = _read(sheet, width)
    entry.reader.findings.extend(capped(sheet.findings, codes.LIMIT, ENOUGH))
    return None if sheet.findings else found


def _read(sheet: Sheet, width: int) -> list[Numbers]:
    """The rows; the lines of a file are shown once one of them is a row of a table."""
    found: list[Numbers] = []
    for place, cells in enumerate(rows(sheet, "a table")):
        if len(cells) != width:
            _wrong_width(sheet, cells, width)
            return found
        if not place and not any(is_decimal(cell) for cell in cells):
            continue  # names of the columns
        row = _numbers(sheet, cells)
        if row is not None:
            sheet.shown = True
            if found and row[0] <= found[-1][0]:
                sheet.fail(cells[0], codes.TABLE, _order(cells[0].text), _SORTED)
            found.append(row)
        if len(sheet.findings) >= ENOUGH:
            return found
        if len(found) > MOST_KNOTS:
            sheet.fail(
                cells[0], codes.LIMIT, f"a table has at most {MOST_KNOTS} rows", "give every second one"
            )
            return found
    if len(found) < 2 and not sheet.findings:
        last = Cell(line=max(len(sheet.source.lines) - 1, 0))
        sheet.fail(last, codes.TABLE, f"a table needs 2 rows of numbers or more, not {len(found)}")
    return found


def _numbers(sheet: Sheet, cells: Sequence[Cell]) -> Numbers | None:
    help = "a row is x,y in plain decimals"
    found = [value for value in (number(sheet, cell, help) for cell in cells) if value is not None]
    return found if len(found) == len(cells) else None


def _wrong_width(sheet: Sheet, cells: Sequence[Cell], width: int) -> None:
    count = "1 cell" if len(cells) == 1 else f"{len(cells)} cells"
    columns = "x,y" if width == 2 else "x,y,slope"
    help = f"columns are {columns}, separated by commas"
    more = "; slopes belong to interpolation: slopes" if len(cells) == 3 else ""
    where = cells[min(len(cells), width) - 1]
    sheet.fail(where, codes.TABLE, f"the row has {count}; a table has {width} columns", help + more)


def _order(text: str) -> str:
    return f"x = {text[:40]} does not lie above the x before it"


_SORTED: Final = "sort the rows by x, and give every x once"

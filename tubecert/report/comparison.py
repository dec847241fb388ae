"""Certificates side by side: what each says, kind by kind, and in what their specifications differ.

In: certificates with names. Out: a table as data, a page. Nothing is examined or computed again: a number is the one
that its certificate states. What a certificate does not have is shown as missing, and so is a kind.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from io import StringIO
from itertools import groupby
from pathlib import PurePath
from typing import Final

from tubecert.certificate.effective import Tree
from tubecert.digits import UNKNOWN, down, exact, percent, up
from tubecert.records import exact_json
from tubecert.report.claimed import NOT_RECHECKED
from tubecert.report.figures_comparison import comparison_figures
from tubecert.report.page import Block, Cell, Figures, Page, Section, Table
from tubecert.report.quantities import AnyCertificate, AnyResult, Quantity, Value, failed, merged, quantities
from tubecert.words.conditions import SECTIONS

MISSING: Final = "not there"
_MOST = 60  # differences shown on a page
_LONG = 60  # characters of one
_DOWN = ("clearance", "limit", "least")  # what is bounded from below
_SPECIFICATION = "specification"


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """One of the certificates, with the name that it has beside the others."""

    name: str
    certificate: AnyCertificate
    found: Mapping[str, Quantity]

    def value(self, key: str) -> Value:
        """A quantity; None where this certificate has none."""
        own = self.found.get(key)
        return None if own is None else own.value

    @property
    def result(self) -> AnyResult:
        """What was proven."""
        return self.certificate.result


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Certificates, every quantity that one of them has, and the keys of the specification that differ, by path."""

    sides: tuple[Compared, ...]
    quantities: tuple[Quantity, ...]
    differences: Mapping[str, tuple[Tree, ...]]

    @classmethod
    def of(cls, certificates: Sequence[tuple[str, AnyCertificate]]) -> Comparison:
        """The comparison of certificates in files of these names."""
        sides = tuple(
            Compared(name=name, certificate=told, found={each.key: each for each in quantities(told.result)})
            for name, (_, told) in zip(_names([path for path, _ in certificates]), certificates, strict=True)
        )
        return cls(
            sides=sides,
            quantities=tuple(merged(side.found.values() for side in sides)),
            differences=_differences([side.result for side in sides]),
        )

    @property
    def names(self) -> list[str]:
        """What the certificates are called."""
        return [side.name for side in self.sides]

    def rows(self) -> Iterator[tuple[str, list[Value]]]:
        """Every quantity by its key, with its values."""
        yield "verdict", [str(side.result.verdict) for side in self.sides]
        yield "failed", [failed(side.result) or None for side in self.sides]
        for each in self.quantities:
            yield each.key, [side.value(each.key) for side in self.sides]

    def csv(self) -> str:
        """As comma-separated values; what a certificate has not is empty."""
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["quantity", *self.names])
        for key, values in self.rows():
            shown = ("" if v is None else v if isinstance(v, str) else exact(v) for v in values)
            writer.writerow([key, *shown])
        for path, own in self.differences.items():
            shown = ("" if v is None else v if isinstance(v, str) else _bracketed(v) for v in own)
            writer.writerow([f"{_SPECIFICATION}.{path}", *shown])
        return text.getvalue()

    def json(self) -> dict[str, object]:
        """As values of JSON."""
        return {
            "certificates": [{"name": side.name, "hash": side.certificate.hash} for side in self.sides],
            "quantities": {key: [_plain(value) for value in values] for key, values in self.rows()},
            "differences": {path: list(own) for path, own in self.differences.items()},
        }


# -- as a page


def page_of_comparison(comparison: Comparison, *, all_of_it: bool = True) -> Page:
    """The page: verdicts and tubes, each kind, what differs; with margins and further numbers if `all_of_it`."""
    specifications = {side.result.spec.effective.name for side in comparison.sides}
    count = len(comparison.differences)
    differ = f", {count} key{'s' * (count > 1)} of their specifications differ" if count else ""
    return Page(
        name=", ".join(sorted(specifications)),
        verdict="",
        summary=f"{len(comparison.sides)} certificates{differ or ' of the same specification'}",
        meaning=NOT_RECHECKED,
        tiles=(),
        sections=tuple(_sections(comparison, all_of_it=all_of_it)),
        about="comparison",
    )


def _sections(comparison: Comparison, *, all_of_it: bool) -> Iterator[Section]:
    figures = comparison_figures(
        comparison.names, [side.found for side in comparison.sides], comparison.quantities
    )
    if figures and all_of_it:
        yield Section(key="figures", title="Figures", blocks=(Figures(figures=tuple(figures)),))
    verdicts = [
        _row(
            "verdict", [Cell(text=str(side.result.verdict), kind="verdict") for side in comparison.sides], ""
        )
    ]
    if any(failed(side.result) for side in comparison.sides):
        verdicts.append(_row("not proven", [Cell(text=failed(side.result)) for side in comparison.sides], ""))
    for section, members in groupby(comparison.quantities, key=lambda each: each.section):
        rows = [_quantity(comparison, each) for each in members if all_of_it or _matters(each)]
        title = SECTIONS.get(section, section) or "Verdict and tube"
        rows = rows if section else [*verdicts, *rows]
        yield Section(key=section or "tube", title=title, blocks=(_table(comparison, "", rows),))
        verdicts = [] if not section else verdicts
    yield Section(
        key="differences", title="What differs in the specification", blocks=tuple(_differing(comparison))
    )


def _matters(quantity: Quantity) -> bool:
    """Whether it is shown at a glance."""
    return (
        bool(quantity.role and not quantity.share)
        or quantity.name == "verdict"
        or quantity.name.endswith("radius")
        or not quantity.section
    )


def _quantity(comparison: Comparison, quantity: Quantity) -> tuple[Cell, ...]:
    cells = []
    for side in comparison.sides:
        value = side.value(quantity.key)
        if quantity.name == "verdict":
            text = MISSING if value is None else str(value)
            cells.append(Cell(text=text, kind="text" if value is None else "verdict"))
        else:
            cells.append(Cell(text=_told(quantity, value), kind="number"))
    own = quantity.words.removeprefix(f"{SECTIONS.get(quantity.section, quantity.section)}, ")
    return _row(own, cells, _change(comparison, quantity))


def _told(quantity: Quantity, value: Value) -> str:
    """A gain with all its digits; other numbers rounded so that they stay true."""
    if value is None or isinstance(value, str):
        return value or UNKNOWN
    if quantity.share:
        return percent(float(value))
    if isinstance(value, Fraction) and quantity.section:
        return exact(value)
    return down(value, 6) if any(word in quantity.name for word in _DOWN) else up(value, 6)


def _change(comparison: Comparison, quantity: Quantity) -> str:
    """From the first of two to the second, in per cent."""
    if len(comparison.sides) != 2 or quantity.share:
        return ""
    one, other = (side.found.get(quantity.key) for side in comparison.sides)
    first, second = (None if each is None else each.number for each in (one, other))
    if first is None or second is None or first in (0, second):
        return ""
    return f"{100 * (second - first) / abs(first):+.3g} %"


def _row(name: str, cells: Sequence[Cell], change: str) -> tuple[Cell, ...]:
    return (Cell(text=name), *cells, Cell(text=change, kind="number"))


def _table(comparison: Comparison, first: str, rows: Sequence[tuple[Cell, ...]], note: str = "") -> Table:
    """A table with a column for each certificate, and the change where there are two of them."""
    two = len(comparison.sides) == 2 and any(row[-1].text for row in rows)
    columns = (first, *comparison.names, *(("change",) if two else ()))
    return Table(columns=columns, rows=tuple(row if two else row[:-1] for row in rows), note=note)


def _differing(comparison: Comparison) -> Iterator[Block]:
    rows = [
        _row(path, [Cell(text=_compact(value), kind="code") for value in own], "")
        for path, own in list(comparison.differences.items())[:_MOST]
    ]
    left = len(comparison.differences) - len(rows)
    yield _table(comparison, "key", rows, f"{left} more keys differ" if left else "" if rows else "nothing")


# -- names and differences


def _names(paths: Sequence[str]) -> list[str]:
    """A short name for each file: its own, with its folders where two are called the same."""
    whole = [path.removesuffix(".json").removesuffix(".certificate") or path for path in paths]
    own = [PurePath(path).name or path for path in whole]
    names = [path if own.count(name) > 1 else name for path, name in zip(whole, own, strict=True)]
    return [f"{name} ({i})" if names.count(name) > 1 else name for i, name in enumerate(names, 1)]


def _differences(results: Sequence[AnyResult]) -> dict[str, tuple[Tree, ...]]:
    """The keys, by path, whose values are not the same in all; None where a specification has no such key."""
    return dict(_differing_in([result.spec.effective.data for result in results], ""))


def _differing_in(values: Sequence[Tree], path: str) -> Iterator[tuple[str, tuple[Tree, ...]]]:
    """Down to entries where all have the same shape, else the whole."""
    if all(isinstance(value, Mapping) for value in values):
        for key in sorted({key for value in values for key in value}):
            yield from _differing_in([value.get(key) for value in values], f"{path}.{key}" if path else key)
    elif all(isinstance(value, list) for value in values) and len({len(value) for value in values}) == 1:
        for index, entries in enumerate(zip(*values, strict=True)):
            yield from _differing_in(entries, f"{path}[{index}]")
    elif any(value != values[0] for value in values):
        yield path, tuple(values)


def _compact(value: Tree) -> str:
    """A value of a specification in a cell."""
    text = MISSING if value is None else value if isinstance(value, str) else _bracketed(value)
    return text if len(text) <= _LONG else f"{text[: _LONG - 1]}…"


def _bracketed(value: Tree) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_bracketed(inner)}" for key, inner in value.items()) + "}"
    return f"[{', '.join(map(_bracketed, value))}]" if isinstance(value, list) else str(value)


def _plain(value: Value) -> str | float | None:
    return exact_json(value) if isinstance(value, Fraction) else value

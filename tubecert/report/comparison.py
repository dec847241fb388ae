"""Certificates side by side: what each says, kind by kind, and in what their specifications differ.

In: certificates with names. Out: a table as data, a page. Nothing is examined or computed again: a number is the one
that its certificate states. What a certificate does not have is shown as missing, and so is a kind.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from pathlib import PurePath
from typing import Final

from tubecert.certificate.effective import Tree
from tubecert.claims.conditions import SECTIONS
from tubecert.digits import UNKNOWN, down, exact, percent, up
from tubecert.records import exact_json
from tubecert.report.claimed import NOT_RECHECKED, size
from tubecert.report.gains import gains_text
from tubecert.report.page import Block, Cell, Facts, Page, Section, Table
from tubecert.report.quantities import (
    AnyCertificate,
    AnyResult,
    Quantity,
    Value,
    failed,
    lacking,
    merged,
    quantities,
    table_text,
)
from tubecert.sampled_loop.record import Result as SampledResult
from tubecert.words.sampled_loop import NOTHING

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
        differing = (
            [f"{_SPECIFICATION}.{path}", *(None if v is None else _bracketed(v) for v in own)]
            for path, own in self.differences.items()
        )
        rows = ([key, *values] for key, values in self.rows())
        return table_text([["quantity", *self.names], *rows, *differing])

    def json(self) -> dict[str, object]:
        """As values of JSON."""
        return {
            "certificates": [{"name": side.name, "hash": side.certificate.hash} for side in self.sides],
            "quantities": {key: [_plain(value) for value in values] for key, values in self.rows()},
            "differences": {path: list(own) for path, own in self.differences.items()},
        }


# -- as a page


def page_of(comparison: Comparison) -> Page:
    """The page: verdicts, tubes and gains at a glance, every number of each kind, what differs."""
    specifications = {side.result.spec.effective.name for side in comparison.sides}
    count = len(comparison.differences)
    differ = f", {count} key{'s' * (count > 1)} of their specifications differ" if count else ""
    return Page(
        name=", ".join(sorted(specifications)),
        verdict="",
        summary=f"{len(comparison.sides)} certificates{differ or ' of the same specification'}",
        meaning=NOT_RECHECKED,
        sections=tuple(Section.each(_sections(comparison))),
        about="comparison",
    )


def _sections(comparison: Comparison) -> Iterator[tuple[str, str, list[Block]]]:
    plain = [each for each in comparison.quantities if not each.section]
    kinds = dict.fromkeys(each.section for each in comparison.quantities if each.section)
    rows = [*_verdicts(comparison), *(_kind(comparison, key) for key in kinds)]
    rows += (_quantity(comparison, each) for each in plain if _at_a_glance(each))
    differ = Facts.of([("differ", ", ".join(comparison.differences))], ("differ",))
    yield "glance", "At a glance", [_table(comparison, rows), *([differ] if comparison.differences else [])]
    more = [each for each in comparison.quantities if each.name not in ("verdict", "failed")]
    rows = [_quantity(comparison, each) for each in more if each.section or not _at_a_glance(each)]
    yield "numbers", "Further numbers", [_table(comparison, rows)] if rows else []
    yield "differences", "What differs in the specification", [_differing(comparison)]


def _at_a_glance(quantity: Quantity) -> bool:
    return quantity.name == "rho" or quantity.name.startswith(
        ("half_width", "clearance", "least", "greatest")
    )


def _verdicts(comparison: Comparison) -> Iterator[tuple[Cell, ...]]:
    found = [side.result for side in comparison.sides]
    yield _row("verdict", [Cell(text=str(own.verdict), kind="verdict") for own in found])
    if any(map(failed, found)):
        told = (lacking(own) if failed(own) else "" for own in found)
        yield _row("not proven", [Cell(text=text) for text in told])


def _kind(comparison: Comparison, key: str) -> tuple[Cell, ...]:
    """What each says of a kind, on a line: its verdict, and the gains that it is about."""
    told = []
    for side in comparison.sides:
        result = side.result
        if isinstance(result, SampledResult) or key not in result.sections:
            told.append(MISSING)
            continue
        section = result.sections[key]
        pair = section.decisive(asked=result.asked)
        gains = "" if pair is None or pair.bandwidth is None else f": {gains_text(pair)}"
        told.append(f"{section.verdict}{gains}")
    return _row(SECTIONS[key], [Cell(text=text) for text in told])


def _quantity(comparison: Comparison, quantity: Quantity) -> tuple[Cell, ...]:
    values = [side.value(quantity.key) for side in comparison.sides]
    cells = [Cell(text=_told(quantity, value), kind="number") for value in values]
    return _row(quantity.words, cells, _change(quantity, values))


def _told(quantity: Quantity, value: Value) -> str:
    """A gain with all its digits; other numbers rounded so that they stay true."""
    if value is None or isinstance(value, str):
        return value or UNKNOWN
    if quantity.share:
        return percent(float(value))
    if isinstance(value, Fraction) and quantity.section:
        return exact(value)
    if 0 < value < NOTHING:
        return size(Fraction(value))
    return down(value, 6) if any(word in quantity.name for word in _DOWN) else up(value, 6)


def _change(quantity: Quantity, values: Sequence[Value]) -> str:
    """From the first of two to the second, in per cent."""
    numbers = [float(value) for value in values if isinstance(value, (float, Fraction))]
    if len(values) != 2 or len(numbers) != 2 or quantity.share or min(map(abs, numbers)) < NOTHING:
        return ""
    first, second = numbers
    if first == second:
        return ""
    return f"{100 * (second - first) / abs(first):+.3g} %" if isfinite(first) and isfinite(second) else ""


def _row(name: str, cells: Sequence[Cell], change: str = "") -> tuple[Cell, ...]:
    return (Cell(text=name), *cells, Cell(text=change, kind="number"))


def _table(comparison: Comparison, rows: Sequence[tuple[Cell, ...]], note: str = "") -> Table:
    """A table with a column for each certificate, and the change where there are two of them."""
    two = len(comparison.sides) == 2 and any(row[-1].text for row in rows)
    columns = ("", *comparison.names, *(("change",) if two else ()))
    return Table(columns=columns, rows=tuple(row if two else row[:-1] for row in rows), note=note)


def _differing(comparison: Comparison) -> Table:
    rows = [
        _row(path, [Cell(text=_compact(value), kind="code") for value in own])
        for path, own in list(comparison.differences.items())[:_MOST]
    ]
    left = len(comparison.differences) - len(rows)
    return _table(comparison, rows, f"{left} more keys differ" if left else "" if rows else "nothing")


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
    text = MISSING if value is None else _bracketed(value)
    return text if len(text) <= _LONG else f"{text[: _LONG - 1]}…"


def _bracketed(value: Tree) -> str:
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {_bracketed(inner)}" for key, inner in value.items()) + "}"
    return f"[{', '.join(map(_bracketed, value))}]" if isinstance(value, list) else str(value)


def _plain(value: Value) -> str | float | None:
    return exact_json(value) if isinstance(value, Fraction) else value

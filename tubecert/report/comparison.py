"""Certificates side by side: what each says, kind by kind, and in what their specifications differ.

In: certificates with names. Out: a table as data, a page. Nothing is examined or computed again: a number is the one
that its certificate states. What a certificate does not have is shown as missing, and so is a kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from pathlib import PurePath
from typing import Final

from tubecert.certificate.effective import Tree
from tubecert.claims.conditions import SECTIONS
from tubecert.digits import UNKNOWN, down, exact, percent, up
from tubecert.files import stem_of
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
_GLANCE = ("half_width", "clearance", "least", "greatest")  # beside rho: how quantities begin that come first


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """Certificates by their names, in one order, and what one of them has: None where another has it not.

    `values` are those of `verdict`, `failed` and every quantity, by key; `differences` are the keys of the
    specification that differ, by path.
    """

    names: tuple[str, ...]
    certificates: tuple[AnyCertificate, ...]
    quantities: tuple[Quantity, ...]
    values: Mapping[str, tuple[Value, ...]]
    differences: Mapping[str, tuple[Tree, ...]]

    @classmethod
    def of(cls, certificates: Sequence[tuple[str, AnyCertificate]]) -> Comparison:
        """The comparison of certificates in files of these names."""
        results = [told.result for _, told in certificates]
        found = [{each.key: each for each in quantities(result)} for result in results]
        every = tuple(merged(own.values() for own in found))
        values: dict[str, tuple[Value, ...]] = {
            "verdict": tuple(str(result.verdict) for result in results),
            "failed": tuple(failed(result) or None for result in results),
        }
        for key in (each.key for each in every):
            values[key] = tuple(None if key not in own else own[key].value for own in found)
        return cls(
            names=tuple(_names([path for path, _ in certificates])),
            certificates=tuple(told for _, told in certificates),
            quantities=every,
            values=values,
            differences=dict(_differing_in([own.spec.effective.data for own in results], "")),
        )

    @property
    def results(self) -> list[AnyResult]:
        """What was proven."""
        return [each.result for each in self.certificates]

    def csv(self) -> str:
        """As comma-separated values; what a certificate has not is empty."""
        rows = ([key, *values] for key, values in self.values.items())
        differing = (
            [f"{_SPECIFICATION}.{path}", *(None if v is None else _bracketed(v) for v in own)]
            for path, own in self.differences.items()
        )
        return table_text([["quantity", *self.names], *rows, *differing])

    def json(self) -> dict[str, object]:
        """As values of JSON."""
        named = zip(self.names, self.certificates, strict=True)
        return {
            "certificates": [{"name": name, "hash": each.hash} for name, each in named],
            "quantities": {
                key: [exact_json(value) if isinstance(value, Fraction) else value for value in values]
                for key, values in self.values.items()
            },
            "differences": {path: list(own) for path, own in self.differences.items()},
        }


# -- as a page


def page_of(comparison: Comparison) -> Page:
    """The page: verdicts, tubes and gains at a glance, every number of each kind, what differs."""
    specifications = {result.spec.effective.name for result in comparison.results}
    count = len(comparison.differences)
    differ = f", {count} key{'s' * (count > 1)} of their specifications differ" if count else ""
    return Page(
        name=", ".join(sorted(specifications)),
        verdict="",
        summary=f"{len(comparison.names)} certificates{differ or ' of the same specification'}",
        meaning=NOT_RECHECKED,
        sections=tuple(Section.each(_sections(comparison))),
        about="comparison",
    )


def _sections(comparison: Comparison) -> Iterator[tuple[str, str, list[Block]]]:
    kinds = dict.fromkeys(each.section for each in comparison.quantities if each.section)
    more = [each for each in comparison.quantities if each.name not in ("verdict", "failed")]
    plain = [each for each in more if not each.section]
    glance = [each for each in plain if each.name == "rho" or each.name.startswith(_GLANCE)]
    rows = [*_verdicts(comparison), *(_kind(comparison, key) for key in kinds)]
    rows += (_quantity(comparison, each) for each in glance)
    differ = Facts.of([("differ", ", ".join(comparison.differences))], ("differ",))
    yield "glance", "At a glance", [_table(comparison, rows), *([differ] if comparison.differences else [])]
    rows = [_quantity(comparison, each) for each in more if each not in glance]
    yield "numbers", "Further numbers", [_table(comparison, rows)] if rows else []
    yield "differences", "What differs in the specification", [_differing(comparison)]


def _verdicts(comparison: Comparison) -> Iterator[tuple[Cell, ...]]:
    yield _row("verdict", (Cell(text=str(own.verdict), kind="verdict") for own in comparison.results))
    if any(comparison.values["failed"]):
        told = (lacking(own) if failed(own) else "" for own in comparison.results)
        yield _row("not proven", (Cell(text=text) for text in told))


def _kind(comparison: Comparison, key: str) -> tuple[Cell, ...]:
    """What each says of a kind, on a line: its verdict, and the gains that it is about."""
    told = []
    for result in comparison.results:
        if isinstance(result, SampledResult) or key not in result.sections:
            told.append(MISSING)
            continue
        section = result.sections[key]
        pair = section.decisive(asked=result.asked)
        gains = "" if pair is None or pair.bandwidth is None else f": {gains_text(pair)}"
        told.append(f"{section.verdict}{gains}")
    return _row(SECTIONS[key], (Cell(text=text) for text in told))


def _quantity(comparison: Comparison, quantity: Quantity) -> tuple[Cell, ...]:
    values = comparison.values[quantity.key]
    cells = (Cell(text=_told(quantity, value), kind="number") for value in values)
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


def _row(name: str, cells: Iterable[Cell], change: str = "") -> tuple[Cell, ...]:
    return (Cell(text=name), *cells, Cell(text=change, kind="number"))


def _table(comparison: Comparison, rows: Sequence[tuple[Cell, ...]], note: str = "") -> Table:
    """A table with a column for each certificate, and the change where there are two of them."""
    two = len(comparison.names) == 2 and any(row[-1].text for row in rows)
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
    whole = [stem_of(path) or path for path in paths]
    own = [PurePath(path).name or path for path in whole]
    names = [path if own.count(name) > 1 else name for path, name in zip(whole, own, strict=True)]
    return [f"{name} ({i})" if names.count(name) > 1 else name for i, name in enumerate(names, 1)]


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

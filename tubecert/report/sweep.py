"""A sweep as a table and as a page: a row for every point, from what is kept of it; nothing is computed again."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from tubecert.digits import up
from tubecert.report.claimed import size
from tubecert.report.figures_axes import Chart
from tubecert.report.gains import deciding
from tubecert.report.page import Figures, Page, Section, Table, Words
from tubecert.report.quantities import Quantity, Value, failed, lacking, merged, quantities, table_text
from tubecert.sampled_loop.record import Certificate as SampledCertificate
from tubecert.sweep.grid import Axis
from tubecert.sweep.point import Failed, Kept, Point
from tubecert.verdict import Verdict

if TYPE_CHECKING:
    from tubecert.certificate.result import Certificate

ERROR: Final = "error"
_MOST: Final = 500  # rows on a page
_NONE_DRAWN: Final = "Figures are drawn for one or two keys whose values are numbers in order."


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A point: the values of its keys, the verdict (or `error`), the ids of what is not proven, and its quantities."""

    point: Point
    verdict: str
    failed: str
    why: str
    found: Mapping[str, Quantity]
    gains: str = ""
    broken: bool = False  # by a defect of tubecert
    sampled: bool = False  # a sampled loop, which has no gains

    @classmethod
    def of(cls, point: Point, outcome: Kept) -> Row:
        """The row of what is kept."""
        if isinstance(outcome, Failed):
            codes = " ".join(dict.fromkeys(item.code or "internal" for item in outcome.problems))
            why = "; ".join(item.message for item in outcome.problems)
            return cls(point=point, verdict=ERROR, failed=codes, why=why, found={}, broken=outcome.broken)
        result = outcome.result
        return cls(
            point=point,
            verdict=str(result.verdict),
            failed=failed(result),
            why=lacking(result),
            found={each.key: each for each in quantities(result)},
            gains=_found(outcome),
            sampled=isinstance(outcome, SampledCertificate),
        )

    @property
    def file(self) -> str:
        """The file that is kept, in the folder of the sweep."""
        return f"points/{self.point.name}.{'error' if self.verdict == ERROR else 'certificate'}.json"

    def value(self, key: str) -> Value:
        """A quantity; None where this point has none."""
        found = self.found.get(key)
        return None if found is None else found.value


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepTable:
    """All rows, in the order of the points, and the quantities that any of them has."""

    name: str
    axes: tuple[Axis, ...]
    rows: tuple[Row, ...]
    columns: tuple[Quantity, ...]

    @classmethod
    def of(cls, name: str, axes: Sequence[Axis], outcomes: Iterable[tuple[Point, Kept]]) -> SweepTable:
        """The table of what is kept."""
        rows = tuple(Row.of(point, outcome) for point, outcome in outcomes)
        columns = tuple(merged(row.found.values() for row in rows))
        return cls(name=name, axes=tuple(axes), rows=rows, columns=columns)

    @property
    def header(self) -> list[str]:
        """The names of the columns."""
        keys = [axis.path for axis in self.axes]
        return [*keys, "verdict", "failed", *(each.key for each in self.columns), "certificate"]

    def cells(self) -> Iterable[list[Value]]:
        """The values of every row, in the order of the columns."""
        for row in self.rows:
            keys = [each.text for each in row.point.settings]
            yield [*keys, row.verdict, row.failed, *(row.value(each.key) for each in self.columns), row.file]

    @property
    def headings(self) -> tuple[str, ...]:
        """What a person sees of a row beside its keys."""
        if any(row.sampled for row in self.rows):
            return "verdict", "half-widths, or what lacks"
        return "verdict", "rho", "gains, or what failed"

    def texts(self, row: Row) -> list[str]:
        """The keys of a row, and what stands below the headings."""
        rho, said = row.value("rho"), row.why or row.failed if row.failed else row.gains
        shown = {"verdict": row.verdict, "rho": "" if rho is None or isinstance(rho, str) else up(rho)}
        return [
            *(each.text for each in row.point.settings),
            *(shown.get(head, said) for head in self.headings),
        ]

    def count(self, verdict: str) -> int:
        """How many points have a verdict."""
        return sum(row.verdict == verdict for row in self.rows)

    def csv(self) -> str:
        """As comma-separated values; what a point has not is empty."""
        return table_text([self.header, *self.cells()])


def _found(outcome: Certificate | SampledCertificate) -> str:
    """The gains that decide; of a sampled loop, whose controller has none, the half-widths."""
    if isinstance(outcome, SampledCertificate):
        proven = outcome.result.half_widths
        later = [stage.half_widths for stage in outcome.result.tube[1:][-1:] if proven]
        told = (", ".join(f"{name} {size(width)}" for name, width in own.items()) for own in (proven, *later))
        return "; in the long run ".join(told)
    return "; ".join(row.text() for row in deciding(outcome.result))


def page_of(table: SweepTable, drawn: Sequence[Chart] | None = None) -> Page:
    """The page, with the figures that `figures_sweep` has drawn, if any was asked; the whole table is beside it."""
    keys = ", ".join(f"{axis.path} ({len(axis.texts)} values)" for axis in table.axes)
    figures = Figures(figures=tuple(drawn)) if drawn else Words(text=_NONE_DRAWN)
    parts = ("points", "Points", [_points(table)]), ("figures", "Figures", [] if drawn is None else [figures])
    return Page(
        name=table.name,
        verdict="",
        summary=_summary(table),
        meaning=f"Each point is a certification of its own. The keys that were changed: {keys}.",
        sections=tuple(Section.each(parts)),
        about="sweep",
    )


def _summary(table: SweepTable) -> str:
    """How many points came to what."""
    counts = {str(verdict): table.count(str(verdict)) for verdict in Verdict}
    counts["invalid or broken"] = table.count(ERROR)
    said = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    return f"{len(table.rows)} points, {said}"


def _points(table: SweepTable) -> Table:
    marks = {"rho": ">", "verdict": "!"}
    heads = (*(f">{axis.path}" for axis in table.axes), *(marks.get(h, "") + h for h in table.headings))
    left = len(table.rows) - _MOST
    note = f"{left} more are in table.csv" if left > 0 else ""
    return Table.of(heads, map(table.texts, table.rows[:_MOST]), note)

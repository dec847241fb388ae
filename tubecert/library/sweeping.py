"""Many values of some keys, from code and for the command: `tubecert sweep`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeAlias

from tubecert import asking, certificate
from tubecert.asking import Number
from tubecert.errors import ExitCode, SpecError
from tubecert.executor import chosen
from tubecert.findings import Finding
from tubecert.library.certifying import BUDGET, DECIDING, METRIC_NAME, SCHEDULER
from tubecert.library.reading import read
from tubecert.library.shown import Known, Shown
from tubecert.library.specification import (
    NAME,
    File,
    Specifiable,
    require_once,
    settings_in,
    settings_of,
    source_of,
)
from tubecert.library.workers import cluster_at
from tubecert.printable import json_text
from tubecert.progress import Progress
from tubecert.records import exact_json
from tubecert.report.html import render_page
from tubecert.report.page import Page
from tubecert.report.progress import timed
from tubecert.report.text import Rows
from tubecert.spec import Setting
from tubecert.sweep.grid import Axis

if TYPE_CHECKING:
    from tubecert.enclosure.interval import Array
    from tubecert.library.certification import Certification
    from tubecert.library.plain import Data
    from tubecert.library.sampled import SampledCertification
    from tubecert.report.quantities import Value
    from tubecert.report.sweep import Row, SweepTable
    from tubecert.sweep.run import Sweep

REMEDY: Final = "the folder of a sweep must stay there while it runs"
_PAGE: Final = "sweep.html"
Range: TypeAlias = str | Iterable[Number]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweptPoint:
    """One point: the texts of the swept keys, the verdict (or `error`), and every number that it has."""

    row: Row = field(repr=False)
    folder: Path = field(repr=False)

    @property
    def settings(self) -> Mapping[str, str]:
        """The swept keys with their values here, as `settings` of `tc.load` takes them."""
        return MappingProxyType({each.path: each.text for each in self.row.point.settings})

    @property
    def verdict(self) -> str:
        """`certified`, `refuted`, `undecided`, or `error` where the specification is not valid."""
        return self.row.verdict

    @property
    def quantities(self) -> Mapping[str, Value]:
        """Every number by its key, as the columns of the table are called."""
        return MappingProxyType({key: each.value for key, each in self.row.found.items()})

    @property
    def file(self) -> Path:
        """Where the certificate is, or why there is none."""
        return self.folder / self.row.file

    def certification(self) -> Certification | SampledCertification:
        """The certificate; raises `TargetError` where there is none."""
        return read(self.file)


@dataclass(frozen=True, kw_only=True, repr=False)
class Swept(Shown):
    """A sweep: a certificate for every point, in a folder, with a table and figures.

    `points` are in the order of the ranges, the last of which changes first.
    """

    table: SweepTable = field(repr=False)
    folder: Path
    files: tuple[str, ...] = field(repr=False)

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys that were swept."""
        return tuple(axis.path for axis in self.table.axes)

    @cached_property
    def points(self) -> tuple[SweptPoint, ...]:
        """Every point."""
        return tuple(SweptPoint(row=row, folder=self.folder) for row in self.table.rows)

    def column(self, key: str) -> Array:
        """The values of a swept key, or of a quantity (`rho`, `half_width.px`), at the points; NaN where there is none.

        An array (N,). Raises `KeyError` for what no point has.
        """
        from tubecert.library.stated import array

        rows = self.table.rows
        numbers = {
            each.key: [None if (own := row.found.get(each.key)) is None else own.number for row in rows]
            for each in self.table.columns
        }
        for axis in self.table.axes:
            values = dict(zip(axis.texts, axis.numbers or (), strict=False))
            numbers[axis.path] = [values.get(each.settings[axis.path]) for each in self.points]
        return array([float("nan") if number is None else number for number in Known(numbers)[key]])

    @property
    def csv(self) -> str:
        """The table as comma-separated values."""
        return self.table.csv()

    def _page(self) -> Page:
        from tubecert.report.sweep import page_of

        return page_of(self.table)

    def _closing(self) -> Rows:
        drawn = [name for name in self.files if name.startswith("figures/")]
        others = sorted({*self.files} - {*drawn})
        rows = [("page" if name == _PAGE else "table", str(self.folder / name)) for name in others]
        figures = ("figures", f"{self.folder / 'figures'}: {len(drawn)} drawings (SVG)")
        return [*rows, figures] if drawn else rows

    def _json(self) -> str:
        rows = [[exact_json(v) if isinstance(v, Fraction) else v for v in row] for row in self.table.cells()]
        return json_text([dict(zip(self.table.header, row, strict=True)) for row in rows])

    @property
    def _exit_code(self) -> ExitCode:
        broken = any(row.broken for row in self.table.rows)  # tubecert has a defect there
        return ExitCode.INTERNAL if broken else ExitCode.CERTIFIED


@asking.question({
    "spec": asking.SPEC,
    "over": asking.Kind("A key and its values; may be repeated.", "KEY=RANGE", many=True),
    "settings": asking.SETTINGS,
    "metric": METRIC_NAME,
    "conditions": asking.Choice(
        "Which certificate decides the verdict; all are always computed.  [conditions.decides, or A]",
        words=DECIDING, of=asking.METRIC,
    ),
    "gap": asking.Exact("As for certify.", below=1, of=asking.METRIC),
    "budget": BUDGET,
    "jobs": asking.Exact("Points certified at a time.", whole=True),
    "scheduler": asking.Text(SCHEDULER.help, SCHEDULER.metavar),
    "deadline": asking.ENDING,
    "folder": asking.Text(
        "Points, table, figures.  [SPEC's stem.sweep]", "FOLDER", called="--output", short="-o", ending=".sweep"
    ),
})  # fmt: skip
def sweep(
    spec: Specifiable,
    over: Mapping[str, Range] | Iterable[str] = (),
    *,
    folder: File,
    settings: Data | Sequence[Setting] = (),
    metric: File | None = None,
    conditions: str | None = None,
    gap: Number = "1/100",
    budget: int | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> Swept:
    """Certify every point of a grid of keys of a specification; a table, curves, heat maps.

    `over`: by key a range as the command takes it (`".1:.6:6"`, `"100:2000:log5"`), or values. What is in `folder` from
    an interrupted sweep that is the same is used. `settings` are as those of `load`. `metric` is a file. Points are
    shared by `jobs` processes (then the caller's own code stands below `if __name__ == "__main__":`) or the workers of
    the Dask cluster at `scheduler`.

    Raises `SpecError` where no point has a specification that can be read, `TargetError` for a folder of another sweep.
    """
    from tubecert.pipeline import Options
    from tubecert.report.sweep import SweepTable
    from tubecert.sweep.point import Task
    from tubecert.sweep.run import Sweep

    axes = _axes(over)
    source, own = source_of(spec)
    fixed = (*settings_in(own), *settings_of(settings))
    require_once(fixed)
    cluster = None if scheduler is None else cluster_at(scheduler)
    place, usual = Path(folder), Options()
    task = Task(
        path=source.file,
        text=source.text,
        fixed=fixed,
        options=Options(
            metric=None if metric is None else Path(metric),
            conditions=conditions,
            gap=asking.exact(gap) or usual.gap,
            budget=budget or usual.budget,
        ),
        folder=place if cluster is None else place.resolve(),
    )
    whole = Sweep.of(task, axes)
    if whole.first().hardware is not None:
        asking.require_nothing_of_a_metric()
    if cluster is not None:
        _require_paths(whole)
    whole.run(cluster or chosen(jobs, len(whole.points)), timed(progress))
    name = whole.first().name if task.path == NAME else Path(task.path).stem
    table = SweepTable.of(name, axes, whole.outcomes())
    return Swept(table=table, folder=task.folder, files=_written(task.folder, table))


def _axes(over: Mapping[str, Range] | Iterable[str]) -> list[Axis]:
    """The ranges; raises `SpecError` with everything that is wrong with them."""
    if not over:
        own = asking.named("over")
        help = f"for example {own} tube.epsilon=.1:.6:6"
        asking.refuse(own, "", f"{own} says which keys have which values", help)
    words: Iterable[str] = over
    if isinstance(over, Mapping):
        words = (f"{key}={_range(key, values)}" for key, values in over.items())
    return asking.each_of(words, Axis.of)


def _range(key: str, values: Range) -> str:
    if isinstance(values, str):
        return values
    if not isinstance(values, Iterable):
        form = "give values, or a text such as .1:.6:6"
        asking.refuse(key, "", f"{asking.shown(values)} is no range", form, code="TC106")
    return ",".join(asking.text_of_number(each, key) for each in values)


def _written(folder: Path, table: SweepTable) -> tuple[str, ...]:
    """Write table, page and figures; their names. Raises `TargetError`."""
    from tubecert.report.figures_file import svg_file
    from tubecert.report.figures_sweep import sweep_figures
    from tubecert.report.sweep import page_of

    texts = {"table.csv": table.csv()}
    drawn = sweep_figures(table)
    texts[_PAGE] = render_page(page_of(table, drawn))
    for figure in drawn:
        texts[f"figures/{figure.key.removeprefix('sweep-')}.svg"] = svg_file(figure)
    for name, text in texts.items():
        certificate.write_text(str(folder / name), text, REMEDY)
    return tuple(texts)


def _require_paths(sweep: Sweep) -> None:
    """Raises `SpecError` where workers, whose folder is another, would look for files that are not there."""
    metric, table = sweep.task.options.metric, sweep.first().trajectory.table
    files = [Path(sweep.task.path)] if table is not None else []
    if not all(file.is_absolute() for file in (*files, *([] if metric is None else [metric]))):
        message = "workers of a cluster read the plan file or the metric file in folders of their own"
        help = "give the specification, and --metric, by paths from the root that are the same everywhere"
        raise SpecError([Finding(code="TC122", message=message, help=help)])

"""Many values of some keys, from code and for the command: `tubecert sweep`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from tubecert import certificate
from tubecert.errors import SpecError
from tubecert.executor import Executor, chosen
from tubecert.files import replace
from tubecert.findings import Finding
from tubecert.library.asked import Named, effort_numbers, jobs_of, require_nothing_of_a_metric
from tubecert.library.plain import Number, number_text, number_texts
from tubecert.library.reading import read
from tubecert.library.specification import NAME, File, Specifiable, spec_of
from tubecert.library.workers import cluster_at
from tubecert.progress import Progress
from tubecert.report import sweep as told
from tubecert.report.progress import timed
from tubecert.report.sweep import Row, SweepTable
from tubecert.spec import Setting
from tubecert.stages.options import Options
from tubecert.sweep.grid import Axis
from tubecert.sweep.point import Task
from tubecert.sweep.run import Sweep

if TYPE_CHECKING:
    from tubecert.enclosure.interval import Array
    from tubecert.library.certification import Certification
    from tubecert.library.sampled import SampledCertification
    from tubecert.report.quantities import Value

REMEDY: Final = "the folder of a sweep must stay there while it runs"
Range: TypeAlias = str | Iterable[Number]


@dataclass(frozen=True, slots=True, kw_only=True)
class SweptPoint:
    """One point: the texts of the swept keys, the verdict (or `error`), what failed, and every number that it has."""

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
    def failed(self) -> str:
        """The ids of what is not proven, or the codes of an error."""
        return self.row.failed

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


@dataclass(frozen=True, kw_only=True)
class Swept:
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
        if key in self.keys:
            axis = self.table.axes[self.keys.index(key)]
            values = dict(zip(axis.texts, axis.numbers or (), strict=False))
            found = [values.get(each.settings[key], np.nan) for each in self.points]
        elif any(each.key == key for each in self.table.columns):
            quantities = [row.found.get(key) for row in self.table.rows]
            numbers = [None if each is None else each.number for each in quantities]
            found = [np.nan if number is None else number for number in numbers]
        else:
            raise KeyError(key)
        column = np.array(found, dtype=float)
        column.flags.writeable = False
        return column

    @property
    def broken(self) -> bool:
        """Whether tubecert has a defect at a point."""
        return any(row.broken for row in self.table.rows)

    @property
    def csv(self) -> str:
        """The table as comma-separated values."""
        return self.table.csv()

    def __str__(self) -> str:
        page = told.page_of(self.table)
        return f"{page.name}: {page.summary}"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(told.page_of(self.table))


def sweep(
    spec: Specifiable,
    over: Mapping[str, Range],
    *,
    folder: File,
    metric: File | None = None,
    conditions: str | None = None,
    gap: Number | None = None,
    budget: int | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    parquet: bool = False,
    progress: Progress | None = None,
) -> Swept:
    """Certify a specification with every combination of values of some keys: `tubecert sweep`.

    `over`: by key a range as the command takes it (`".1:.6:6"`, `"100:2000:log5"`), or values. What is in `folder` from
    an interrupted sweep that is the same is used. `metric` is a file. Points are shared by `jobs` processes (then the
    caller's own code stands below `if __name__ == "__main__":`) or the workers of the Dask cluster at `scheduler`.

    Raises `SpecError` where no point has a specification that can be read, `TargetError` for a folder of another sweep.
    """
    numbers = effort_numbers(number_texts(gap=gap, budget=budget))
    file = None if metric is None else Path(metric)
    axes = axes_of(f"{key}={_range_text(values, key)}" for key, values in over.items())
    whole = spec_of(spec)
    task = Task(
        path=whole.path,
        text=whole.source,
        fixed=tuple(Setting(path=path, text=text) for path, text in whole.settings),
        options=numbers.options(conditions=conditions, metric=file),
        folder=Path(os.fspath(folder)).resolve(),
    )
    cluster = None if scheduler is None else cluster_at(scheduler, "scheduler")
    return swept(task, axes, cluster, jobs_of("jobs", str(jobs)) or 1, timed(progress), parquet=parquet)


def swept(
    task: Task,
    axes: Sequence[Axis],
    cluster: Executor | None,
    jobs: int,
    progress: Progress | None,
    *,
    parquet: bool,
    named: Named = str,
) -> Swept:
    """Certify what is missing, then write the table of all. Raises as `sweep` does."""
    if parquet and not told.can_write_parquet():
        message, help = "a table in Parquet needs pyarrow", "pip install pyarrow, or read table.csv"
        raise SpecError([Finding(code="TC122", message=message, help=help)])
    whole = Sweep.of(task, axes)
    if whole.first().hardware is not None:
        usual, asked = Options(), task.options
        given = {name: getattr(asked, name) for name in ("metric", "conditions", "gap", "budget")}
        require_nothing_of_a_metric(
            {name: own for name, own in given.items() if own != getattr(usual, name)}, named
        )
    if cluster is not None:
        _require_paths(whole)
    whole.run(cluster or chosen(jobs, len(whole.points)), progress)
    name = whole.first().name if task.path == NAME else Path(task.path).stem
    table = SweepTable.of(name, axes, whole.outcomes())
    return Swept(table=table, folder=task.folder, files=_written(task.folder, table, parquet=parquet))


def axes_of(words: Iterable[str]) -> list[Axis]:
    """The ranges; raises `SpecError` with everything that is wrong with them."""
    axes: list[Axis] = []
    findings: list[Finding] = []
    for each in words:
        try:
            axes.append(Axis.of(each))
        except SpecError as error:
            findings += error.findings
    if findings:
        raise SpecError(findings)
    return axes


def _range_text(values: Range, key: str) -> str:
    return values if isinstance(values, str) else ",".join(number_text(value, key) for value in values)


def _written(folder: Path, table: SweepTable, *, parquet: bool) -> tuple[str, ...]:
    """Write table, page and figures; their names. Raises `TargetError`."""
    from tubecert.report.figures_file import svg_file
    from tubecert.report.figures_sweep import sweep_figures, with_figures
    from tubecert.report.html import render_page

    texts = {"table.csv": table.csv()}
    if parquet:
        replace(folder / "table.parquet", table.parquet())
    drawn = sweep_figures(table)
    texts |= {"sweep.html": render_page(with_figures(told.page_of(table), drawn))}
    texts |= {f"figures/{figure.key.removeprefix('sweep-')}.svg": svg_file(figure) for figure in drawn}
    for name, text in texts.items():
        certificate.write_text(str(folder / name), text, REMEDY)
    return (*texts, *(["table.parquet"] if parquet else []))


def _require_paths(sweep: Sweep) -> None:
    """Raises `SpecError` where workers, whose folder is another, would look for files that are not there."""
    read = sweep.first().trajectory.table is not None
    metric = sweep.task.options.metric
    if (read and not Path(sweep.task.path).is_absolute()) or (
        metric is not None and not metric.is_absolute()
    ):
        message = "workers of a cluster read the plan file or the metric file in folders of their own"
        help = "give the specification, and --metric, by paths from the root that are the same everywhere"
        raise SpecError([Finding(code="TC122", message=message, help=help)])

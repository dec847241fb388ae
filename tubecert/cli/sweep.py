"""`sweep`: a specification and ranges of keys in; a folder with certificates, a table and figures out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from tubecert import certificate, pipeline
from tubecert.cli.options import Output
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.errors import ExitCode, SpecError
from tubecert.executor import chosen
from tubecert.files import replace
from tubecert.findings import Finding
from tubecert.library.numbers import Numbers
from tubecert.library.workers import cluster_at
from tubecert.printable import printable_json, visible
from tubecert.records import exact_json
from tubecert.report import progress
from tubecert.report import sweep as told
from tubecert.report.terminal import Terminal
from tubecert.spec.source import read_source
from tubecert.sweep.grid import Axis
from tubecert.sweep.point import Task
from tubecert.sweep.run import Sweep

if TYPE_CHECKING:
    from tubecert.report.quantities import Value
    from tubecert.report.sweep import SweepTable

_REMEDY = "the folder of a sweep must stay there while it runs"


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says, as texts."""

    spec: str
    over: Sequence[str]
    settings: Sequence[str]
    metric: Path | None
    conditions: str | None
    gap: str
    budget: str | None
    jobs: str
    scheduler: str | None
    parquet: bool
    folder: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Certify what is missing, then make the table of all."""
    numbers = Numbers()
    jobs = numbers.count("--jobs", given.jobs)
    options = _options(given, numbers)
    numbers.check()
    fixed = settings_of(given.settings, metric=given.metric)
    axes = _axes(given.over)
    if given.parquet and not told.can_write_parquet():
        message, help = "--parquet needs pyarrow", "pip install pyarrow, or read table.csv"
        raise SpecError([Finding(code="TC122", message=message, help=help)])
    source = read_source(given.spec)
    folder = Path(given.folder or f"{Path(given.spec).stem}.sweep")
    cluster = None if given.scheduler is None else cluster_at(given.scheduler)
    folder = folder if cluster is None else folder.resolve()
    task = Task(path=source.file, text=source.text, fixed=fixed, options=options, folder=folder)
    sweep = Sweep.of(task, axes)
    if cluster is not None:
        _require_paths(sweep)
    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        sweep.run(cluster or chosen(jobs or 1, len(sweep.points)), report)
    table = told.SweepTable.of(Path(source.file).stem, axes, sweep.outcomes())
    files = write(folder, table, parquet=given.parquet)
    data = printable_json(json.dumps(_rows(table), indent=1, ensure_ascii=False)) + "\n"
    present(output, told.summary(table), lambda: told.report(table, files), data if output.json else None)
    return ExitCode.INTERNAL if any(row.broken for row in table.rows) else ExitCode.CERTIFIED


def write(folder: Path, table: SweepTable, *, parquet: bool) -> list[str]:
    """Write table, page and figures; their names. Raises `TargetError`."""
    from tubecert.report.figures_file import svg_file
    from tubecert.report.figures_sweep import sweep_figures
    from tubecert.report.html import render_page
    from tubecert.report.sweep_page import page_of_sweep

    texts = {"table.csv": table.csv(), "sweep.html": render_page(page_of_sweep(table))}
    texts |= {
        f"figures/{figure.key.removeprefix('sweep-')}.svg": svg_file(figure)
        for figure in sweep_figures(table)
    }
    for name, text in texts.items():
        certificate.write_text(str(folder / name), text, _REMEDY)
    if parquet:
        replace(folder / "table.parquet", table.parquet())
    shown = ["table.csv", *(["table.parquet"] if parquet else []), "sweep.html"]
    drawn = len(texts) - 2
    return [
        f"table {visible(str(folder / shown[0]))}",
        *(f"table {visible(str(folder / name))}" for name in shown[1:-1]),
        f"page {visible(str(folder / shown[-1]))}"
        + (f", and {drawn} figures (SVG) in figures/" if drawn else ""),
    ]


def _options(given: Given, numbers: Numbers) -> pipeline.Options:
    default = pipeline.Options()
    gap = numbers.positive("--gap", given.gap, below=1)
    budget = numbers.count("--budget", given.budget)
    return pipeline.Options(
        metric=given.metric,
        conditions=given.conditions,
        gap=gap or default.gap,
        budget=budget or default.budget,
    )


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


def _axes(words: Sequence[str]) -> list[Axis]:
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


def _rows(table: SweepTable) -> list[dict[str, float | str | None]]:
    """The rows as JSON."""
    return [dict(zip(table.header, map(_json, cells), strict=True)) for cells in table.cells()]


def _json(value: Value) -> float | str | None:
    return exact_json(value) if isinstance(value, Fraction) else value

"""`sweep`: a specification and ranges of keys in; a folder with certificates, a table and figures out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert import pipeline
from tubecert.cli import telling
from tubecert.cli.options import Output, flag
from tubecert.cli.presenting import present
from tubecert.cli.settings import settings_of
from tubecert.errors import ExitCode
from tubecert.library.numbers import Numbers
from tubecert.library.sweeping import Swept, axes_of, swept
from tubecert.library.workers import cluster_at
from tubecert.printable import printable_json
from tubecert.records import exact_json
from tubecert.report import sweep as told
from tubecert.report.terminal import Terminal
from tubecert.spec.source import read_source
from tubecert.sweep.point import Task

if TYPE_CHECKING:
    from tubecert.report.quantities import Value
    from tubecert.report.sweep import SweepTable

_PAGE: Final = "sweep.html"


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
    axes = axes_of(given.over)
    source = read_source(given.spec)
    folder = Path(given.folder or f"{Path(given.spec).stem}.sweep")
    cluster = None if given.scheduler is None else cluster_at(given.scheduler)
    folder = folder if cluster is None else folder.resolve()
    task = Task(path=source.file, text=source.text, fixed=fixed, options=options, folder=folder)
    terminal = Terminal.stderr(color=output.color)
    with telling.shown(terminal, output) as report:
        found = swept(task, axes, cluster, jobs or 1, report, parquet=given.parquet, named=flag)
    table = found.table
    data = printable_json(json.dumps(_rows(table), indent=1, ensure_ascii=False)) + "\n"
    present(output, told.page_of(table), _files(found), data if output.json else None)
    return ExitCode.INTERNAL if found.broken else ExitCode.CERTIFIED


def _files(found: Swept) -> list[tuple[str, str]]:
    """What was written."""
    names = [name for name in found.files if not name.startswith("figures/")]
    drawn = len(found.files) - len(names)
    rows = [("page" if name == _PAGE else "table", str(found.folder / name)) for name in sorted(names)]
    return rows + ([("figures", f"{found.folder / 'figures'}: {drawn} drawings (SVG)")] if drawn else [])


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


def _rows(table: SweepTable) -> list[dict[str, float | str | None]]:
    """The rows as JSON."""
    return [dict(zip(table.header, map(_json, cells), strict=True)) for cells in table.cells()]


def _json(value: Value) -> float | str | None:
    return exact_json(value) if isinstance(value, Fraction) else value

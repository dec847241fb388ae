"""`check`: what is wrong with specifications, for people and for continuous integration."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from tubecert.cli import keeper, telling
from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.cli.settings import settings_of
from tubecert.cli.targets import refused
from tubecert.errors import ExitCode
from tubecert.findings import Finding, Severity
from tubecert.library.numbers import Numbers
from tubecert.printable import printable_json
from tubecert.progress import Phase
from tubecert.records import to_json
from tubecert.report.findings import as_data, render, summary
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.checking import Checked, CheckOptions
    from tubecert.executor import Executor

_SUFFIXES = {".yaml", ".yml"}
_OF_SPECIFICATIONS = rb"""(?m)^\s*\{?\s*["']?(tubecert|safe_set)["']?\s*:"""
_SHOWN = 5
_WORST = (ExitCode.CERTIFIED, ExitCode.UNDECIDED, ExitCode.NOT_CERTIFIED, ExitCode.INVALID)


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """What the command line says; numbers as texts."""

    paths: Sequence[str]
    format: str | None
    certify: bool
    family: str | None
    strict: bool
    skip_others: bool
    settings: Sequence[str]
    jobs: str
    scheduler: str | None
    no_cache: bool
    gap: str
    budget: str | None


def run(given: Given, output: Output) -> ExitCode:
    """Check every file, or against a family of plans; findings are the result and go to stdout."""
    format_ = _format(given, output)
    jobs, options = _options(given)
    paths = given.paths
    if given.family is None:
        files, others = _sorted_out(list(_expand(paths)), {*paths} - {*_folders(paths)}, given.skip_others)
        executor = _executor(given.scheduler, jobs, len(files))
        # on a cluster files are known by their places in the file system, not by where the command runs
        files = files if given.scheduler is None else [str(Path(file).resolve()) for file in files]
        results = _checked(files, options, executor, output) if files else []
        results = [*results, *_skipped(others)] or _nothing(paths)
    elif given.settings:
        raise refused("--set is not for plans of a family", "leave --family or --set out")
    else:
        results = _of_family(paths, given.family)
    write_stdout(FORMATS[format_](results, Terminal.stdout(color=output.color), quiet=output.quiet))
    keeper.tell({"said": True})
    if format_ == "github":
        from tubecert.report import github

        github.append_step_summary(results)
    return max((result.code for result in results), key=_WORST.index)


def _of_family(paths: Sequence[str], family: str) -> list[Checked]:
    """The results for plans: whether they belong to a family."""
    from tubecert.cli.members import members

    return members(paths, family)


def _format(given: Given, output: Output) -> str:
    """The format asked for; in a workflow of GitHub, without being asked, the one that it understands."""
    if given.format is not None:
        return given.format
    from tubecert.report import github

    if output.json:
        return "json"
    return "github" if github.detected() else "text"


def _options(given: Given) -> tuple[int, CheckOptions]:
    """The number of jobs and what a check has to know; raises `SpecError` with everything that is wrong."""
    from tubecert.checking import CheckOptions

    numbers = Numbers()
    jobs = numbers.count("--jobs", given.jobs)
    gap = numbers.positive("--gap", given.gap, below=1)
    budget = numbers.count("--budget", given.budget)
    numbers.check()
    options = CheckOptions(
        certify=given.certify,
        strict=given.strict,
        cached=not given.no_cache,
        settings=settings_of(given.settings),
    )
    options = replace(options, gap=gap or options.gap, budget=budget or options.budget)
    return jobs or 1, options


def _folders(paths: Sequence[str]) -> list[str]:
    return [path for path in paths if Path(path).is_dir()]


def _sorted_out(files: list[str], named: set[str], skip_others: bool) -> tuple[list[str], list[str]]:
    """Files to be checked, and those that are no specifications; of files that were named only if that is asked for."""
    others = [file for file in files if (skip_others or file not in named) and not _is_specification(file)]
    left_out = {*others}
    return [file for file in files if file not in left_out], others


def _is_specification(file: str) -> bool:
    """Whether a YAML file has a key that every specification has; what cannot be read is left to the check to tell."""
    from tubecert.errors import TubecertError
    from tubecert.files import read
    from tubecert.spec.source import SPECIFICATION

    try:
        return re.search(_OF_SPECIFICATIONS, read(file, SPECIFICATION)) is not None
    except TubecertError:
        return True


def _skipped(others: Sequence[str]) -> list[Checked]:
    """What was left alone is said, once."""
    from tubecert.checking import Checked

    if not others:
        return []
    what = "1 file is no specification" if len(others) == 1 else f"{len(others)} files are no specifications"
    shown = ", ".join(others[:_SHOWN]) + (", ..." if len(others) > _SHOWN else "")
    finding = Finding(
        code="TC123",
        severity=Severity.NOTE,
        message=f"{what} and was left alone: {shown}"
        if len(others) == 1
        else f"{what} and were left alone: {shown}",
        help="a specification has the keys tubecert, system and safe_set",
    )
    return [Checked(path=others[0], findings=(finding,), code=ExitCode.CERTIFIED)]


def _nothing(paths: Sequence[str]) -> list[Checked]:
    """What there is to say where there is nothing to check."""
    from tubecert.checking import Checked

    finding = Finding(
        code="TC100",
        message=f"no specification in {', '.join(paths)}",
        help="give files, or folders that contain files *.yaml",
    )
    return [Checked(path=paths[0], findings=(finding,), code=ExitCode.INVALID)]


def _executor(scheduler: str | None, jobs: int, files: int) -> Executor:
    """The cluster, where there is one, or as many processes as are wanted."""
    from tubecert.executor import chosen
    from tubecert.library.workers import cluster_at

    return chosen(jobs, files) if scheduler is None else cluster_at(scheduler)


def _checked(
    files: Sequence[str], options: CheckOptions, executor: Executor, output: Output
) -> list[Checked]:
    """The results in the order of the files, whichever is ready first."""
    from functools import partial

    from tubecert.checking import check
    from tubecert.executor import Serial
    from tubecert.report import progress

    terminal = Terminal.stderr(color=output.color)
    with telling.shown(terminal, output) as report:
        told = None if report is None else progress.Pieces(report, Phase.CHECK, len(files))

        def ready(place: int, checked: Checked) -> None:
            telling.found(
                f"{checked.path}: {'; '.join(each.message for each in checked.findings) or 'no findings'}"
            )
            if told is not None:
                told.ready(place, checked)

        inner = told if isinstance(executor, Serial) else None  # other processes do not tell
        return executor.map(partial(check, options=options, progress=inner), files, ready)


def _as_text(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    findings = [item for result in results for item in result.findings]
    return terminal.text(render(() if quiet else findings, closing=summary(findings, len(results))))


def _as_json(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    data = [to_json(as_data(item)) for result in results for item in result.findings]
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _as_github(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    from tubecert.report import github

    return github.render(results)


def _as_junit(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    from tubecert.report import junit

    return junit.render(results)


def _as_sarif(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    from tubecert.report import sarif

    return sarif.render(results)


FORMATS: Final = {
    "text": _as_text,
    "json": _as_json,
    "github": _as_github,
    "junit": _as_junit,
    "sarif": _as_sarif,
}


def _expand(paths: Sequence[str]) -> Iterator[str]:
    """The files themselves, and those below folders, each once, in a fixed order."""
    seen = set()
    for path in paths:
        found = _below(Path(path)) if Path(path).is_dir() else [path]
        for file in found:
            if file not in seen:
                seen.add(file)
                yield file


def _below(folder: Path) -> list[str]:
    """Specifications in a folder and its subfolders; hidden ones, and links that lead out of it, are left alone."""
    root = folder.resolve()
    return sorted(
        str(file)
        for file in folder.rglob("*")
        if file.suffix in _SUFFIXES
        and file.is_file()
        and file.resolve().is_relative_to(root)
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
    )

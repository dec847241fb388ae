"""`check`: what is wrong with specifications, for people and for continuous integration."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Numbers, Output
from tubecert.errors import ExitCode
from tubecert.findings import Finding
from tubecert.printable import printable_json
from tubecert.report.findings import as_data, render, summary
from tubecert.report.terminal import Terminal

if TYPE_CHECKING:
    from tubecert.checking import Checked, CheckOptions

_SUFFIXES = {".yaml", ".yml"}
_WORST = (ExitCode.CERTIFIED, ExitCode.UNDECIDED, ExitCode.NOT_CERTIFIED, ExitCode.INVALID)


def run(paths: Sequence[str], given: Mapping[str, Any], output: Output) -> ExitCode:
    """Check every file; findings are the result and go to stdout."""
    format_ = _format(given, output)
    jobs, options = _options(given)
    files = list(_expand(paths))
    results = _nothing(paths) if not files else _checked(files, options, jobs, output)
    write_stdout(FORMATS[format_](results, Terminal.stdout(color=output.color), quiet=output.quiet))
    if format_ == "github":
        from tubecert.report import github

        github.append_step_summary(results)
    return max((result.code for result in results), key=_WORST.index)


def _format(given: Mapping[str, Any], output: Output) -> str:
    """The format asked for; in a workflow of GitHub, without being asked, the one that it understands."""
    if given["format_"] is not None:
        return str(given["format_"])
    from tubecert.report import github

    if output.json:
        return "json"
    return "github" if github.detected() else "text"


def _options(given: Mapping[str, Any]) -> tuple[int, CheckOptions]:
    """The number of jobs and what a check has to know; raises `SpecError` with everything that is wrong."""
    from tubecert.checking import CheckOptions

    numbers = Numbers()
    jobs = numbers.count("--jobs", given["jobs"])
    gap = numbers.positive("--gap", given["gap"], below=1)
    budget = numbers.count("--budget", given["budget"])
    numbers.check()
    options = CheckOptions(certify=given["certify"], strict=given["strict"], cached=not given["no_cache"])
    options = replace(options, gap=gap or options.gap, budget=budget or options.budget)
    return jobs or 1, options


def _nothing(paths: Sequence[str]) -> list[Checked]:
    """What there is to say where there is nothing to check."""
    from tubecert.checking import Checked

    finding = Finding(
        code="TC100",
        message=f"no specification in {', '.join(paths)}",
        help="give files, or folders that contain files *.yaml",
    )
    return [Checked(path=paths[0], findings=(finding,), code=ExitCode.INVALID)]


def _checked(files: Sequence[str], options: CheckOptions, jobs: int, output: Output) -> list[Checked]:
    """The results in the order of the files, whichever is ready first."""
    from functools import partial

    from tubecert.checking import check
    from tubecert.executor import Serial, chosen

    executor = chosen(jobs, len(files))
    if not isinstance(executor, Serial):
        return executor.map(partial(check, options=options), files)
    from tubecert.report import progress

    terminal = Terminal.stderr(color=output.color)
    with progress.shown(terminal, wanted=not (output.no_progress or output.quiet)) as report:
        return executor.map(partial(check, options=options, progress=report), files)


def _as_text(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    findings = [item for result in results for item in result.findings]
    return terminal.text(render(() if quiet else findings, closing=summary(findings, len(results))))


def _as_json(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    data = [as_data(item) for result in results for item in result.findings]
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

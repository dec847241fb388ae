"""`check`: what is wrong with specifications, for people and for continuous integration."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import Choice, Exact, Flag, Text, refuse
from tubecert.cli import keeper
from tubecert.cli.adapter import ENDING, SET, Output, command
from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.library.certifying import SCHEDULER

if TYPE_CHECKING:
    from tubecert.checking import Checked, CheckOptions
    from tubecert.executor import Executor
    from tubecert.report.terminal import Terminal
    from tubecert.spec import Setting, Spec

_SUFFIXES = {".yaml", ".yml"}
_OF_SPECIFICATIONS = rb"""(?m)^\s*\{?\s*["']?(tubecert|safe_set)["']?\s*:"""
_SHOWN = 5
_WORST = (ExitCode.CERTIFIED, ExitCode.UNDECIDED, ExitCode.NOT_CERTIFIED, ExitCode.INVALID)
_FORMATS: Final = ("text", "json", "github", "junit", "sarif")
_WORDS: Final = {
    "specs": Text("Specifications, or folders with some.", "SPEC", place=True, many=True),
    "format_": Choice("What to write.  [text; github in its workflows]", words=_FORMATS),
    "certify": Flag("Certify, too, and compare with the file's expect."),
    "family": Text("Whether plans (CSV, or specifications) are of this family.", "FILE"),
    "strict": Flag("Warnings are errors."),
    "skip_others": Flag("Leave YAML files that are no specifications alone."),
    "set_": SET,
    "jobs": Exact("Files checked at a time.", whole=True),
    "scheduler": SCHEDULER,
    "no_cache": Flag("Do not use what earlier checks have found."),
    "gap": Exact("As for certify; with --certify.", below=1),
    "deadline": ENDING,
    "budget": Exact("As for certify; with --certify.", whole=True),
}


@command(_WORDS)
def check(
    how: Output,
    specs: Sequence[str],
    *,
    format_: str | None = None,
    certify: bool = False,
    family: str | None = None,
    strict: bool = False,
    skip_others: bool = False,
    set_: Sequence[Setting] = (),
    jobs: int = 1,
    scheduler: str | None = None,
    no_cache: bool = False,
    gap: Any = "1/100",
    budget: int | None = None,
) -> ExitCode:
    """Check specifications: format, mathematics, what is odd; with --certify also the locked results.

    Nothing is written but the findings; what files are found to be is remembered, so that a file that has not
    changed costs nothing.
    """
    if how.json and format_ not in (None, "json"):
        refuse("--format", "", "--json and --format exclude each other")
    if family is not None and set_:
        refuse("--set", "", "--set is not for plans of a family", "leave --family or --set out")
    from tubecert.checking import CheckOptions
    from tubecert.cli.guard import write_stdout
    from tubecert.report import github
    from tubecert.report.terminal import Terminal

    if family is not None:
        results = _members(specs, family)
    else:
        files, others = _sorted_out(list(_expand(specs)), {*specs} - {*_folders(specs)}, skip_others)
        # on a cluster files are known by their places in the file system, not by where the command runs
        files = files if scheduler is None else [str(Path(file).resolve()) for file in files]
        options = CheckOptions(
            certify=certify, strict=strict, cached=not no_cache, settings=tuple(set_), gap=gap
        )
        options = options if budget is None else replace(options, budget=budget)
        executor = _executor(scheduler, jobs, len(files))
        results = _checked(files, options, executor, how) if files else []
        results = [*results, *_skipped(others)] or _nothing(specs)
    chosen = format_ or ("json" if how.json else "github" if github.detected() else "text")
    write_stdout(FORMATS[chosen](results, Terminal.stdout(color=how.color), quiet=how.quiet))
    keeper.tell({"said": True})
    if chosen == "github":
        github.append_step_summary(results)
    return max((result.code for result in results), key=_WORST.index)


def _folders(paths: Sequence[str]) -> list[str]:
    return [path for path in paths if Path(path).is_dir()]


def _sorted_out(files: list[str], named: set[str], skip_others: bool) -> tuple[list[str], list[str]]:
    """Files to be checked, and those that are no specifications; of files that were named only if that is asked for."""
    others = [file for file in files if (skip_others or file not in named) and not _is_specification(file)]
    left_out = {*others}
    return [file for file in files if file not in left_out], others


def _is_specification(file: str) -> bool:
    """Whether a YAML file has a key that every specification has; what cannot be read is left to the check to tell."""
    from tubecert.files import read
    from tubecert.spec.source import SPECIFICATION

    try:
        return re.search(_OF_SPECIFICATIONS, read(file, SPECIFICATION)) is not None
    except TubecertError:
        return True


def _skipped(others: Sequence[str]) -> list[Checked]:
    """What was left alone is said, once."""
    from tubecert.checking import Checked
    from tubecert.findings import Finding, Severity

    if not others:
        return []
    what = "1 file is no specification" if len(others) == 1 else f"{len(others)} files are no specifications"
    shown = ", ".join(others[:_SHOWN]) + (", ..." if len(others) > _SHOWN else "")
    finding = Finding(
        code="TC123",
        severity=Severity.NOTE,
        message=f"{what} and {'was' if len(others) == 1 else 'were'} left alone: {shown}",
        help="a specification has the keys tubecert, system and safe_set",
    )
    return [Checked(path=others[0], findings=(finding,), code=ExitCode.CERTIFIED)]


def _nothing(paths: Sequence[str]) -> list[Checked]:
    """What there is to say where there is nothing to check."""
    from tubecert.checking import Checked
    from tubecert.findings import Finding

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


def _checked(files: Sequence[str], options: CheckOptions, executor: Executor, how: Output) -> list[Checked]:
    """The results in the order of the files, whichever is ready first."""
    from functools import partial

    from tubecert.checking import check
    from tubecert.cli import telling
    from tubecert.executor import Serial
    from tubecert.progress import Phase
    from tubecert.report import progress

    with telling.shown(how) as report:
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
    from tubecert.report.findings import render, summary

    findings = [item for result in results for item in result.findings]
    return terminal.text(render(() if quiet else findings, closing=summary(findings, len(results))))


def _as_json(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
    from tubecert.printable import printable_json
    from tubecert.records import to_json
    from tubecert.report.findings import as_data

    data = [to_json(as_data(item)) for result in results for item in result.findings]
    return printable_json(json.dumps(data, indent=1, ensure_ascii=False)) + "\n"


def _as_report(name: str) -> Any:
    """What the module of that name in `report` makes of results."""

    def rendered(results: Sequence[Checked], terminal: Terminal, *, quiet: bool) -> str:
        from importlib import import_module

        text: str = import_module(f"tubecert.report.{name}").render(results)
        return text

    return rendered


FORMATS: Final = {"text": _as_text, "json": _as_json, **{name: _as_report(name) for name in _FORMATS[2:]}}


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


def _members(paths: Sequence[str], family: str) -> list[Checked]:
    """What there is to say of each plan: a CSV file, or a specification whose trajectory it is."""
    from tubecert.findings import Finding
    from tubecert.library.reading import read
    from tubecert.printable import visible
    from tubecert.spec import load, load_text

    certified = Path(family).suffix.lower() == ".json"
    spec = load_text(read(family).effective.text, family) if certified else load(family)
    if spec.trajectory.bundle is None:
        message = f"{visible(family)} is about one plan, not about a family"
        help = "a family has trajectory: {kind: any, x: {...}, u: {...}}"
        raise SpecError([Finding(code="TC411", message=message, help=help)])
    return [_member(path, spec) for path in paths]


def _member(path: str, family: Spec) -> Checked:
    from tubecert.checking import Checked
    from tubecert.findings import Severity
    from tubecert.pipeline.membership import NO_MEMBER, UNDECIDED, member_spec, membership
    from tubecert.printable import visible

    try:
        findings = membership(member_spec(path, family), family, visible(path))
    except TubecertError as error:
        return Checked(path=path, findings=error.findings, code=error.exit_code)
    codes = {item.code for item in findings if item.severity is Severity.ERROR}
    code = ExitCode.CERTIFIED
    if codes:
        code = ExitCode.NOT_CERTIFIED if NO_MEMBER in codes else ExitCode.UNDECIDED
    assert codes <= {NO_MEMBER, UNDECIDED}
    return Checked(path=path, findings=tuple(findings), code=code)

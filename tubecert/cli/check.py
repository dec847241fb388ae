"""`check`: what is wrong with specifications, for people and for continuous integration."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from tubecert.asking import ENDING, SETTINGS, Choice, Exact, Flag, Text, refuse
from tubecert.cli import keeper, telling
from tubecert.cli.adapter import Output, command
from tubecert.cli.guard import write_stdout
from tubecert.errors import ExitCode, SpecError, TubecertError
from tubecert.executor import Serial, chosen
from tubecert.files import read as read_file
from tubecert.findings import Finding, Severity
from tubecert.library.certifying import SCHEDULER
from tubecert.library.reading import read
from tubecert.library.workers import cluster_at
from tubecert.printable import json_text, visible
from tubecert.progress import Phase
from tubecert.report import findings
from tubecert.report.progress import Pieces
from tubecert.report.terminal import Terminal
from tubecert.spec import Setting, Spec, load, load_text
from tubecert.spec.source import SPECIFICATION

if TYPE_CHECKING:
    from tubecert.checking import Checked, CheckOptions

_SUFFIXES = {".yaml", ".yml"}
_OF_SPECIFICATIONS = rb"""(?m)^\s*\{?\s*["']?(tubecert|safe_set)["']?\s*:"""
_SHOWN = 5
_WORST = (ExitCode.CERTIFIED, ExitCode.UNDECIDED, ExitCode.NOT_CERTIFIED, ExitCode.INVALID)
FORMATS: Final = ("text", "json", "github", "junit", "sarif")
_WORDS: Final = {
    "specs": Text("Specifications, or folders with some.", "SPEC", place=True, many=True),
    "format_": Choice("What to write.  [text; github in its workflows]", words=FORMATS),
    "certify": Flag("Certify, too, and compare with the file's expect."),
    "family": Text("Whether plans (CSV, or specifications) are of this family.", "FILE"),
    "strict": Flag("Warnings are errors."),
    "skip_others": Flag("Leave YAML files that are no specifications alone."),
    "settings": SETTINGS,
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
    settings: Sequence[Setting] = (),
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
    if family is not None and settings:
        refuse("--set", "", "--set is not for plans of a family", "leave --family or --set out")
    from tubecert.checking import CheckOptions
    from tubecert.report import github

    if family is not None:
        results = _members(specs, family)
    else:
        files = list(dict.fromkeys(file for path in specs for file in _below(path)))
        named = set() if skip_others else {*specs}
        others = dict.fromkeys(file for file in files if file not in named and not _is_specification(file))
        files = [file for file in files if file not in others]
        options = CheckOptions(
            certify=certify, strict=strict, cached=not no_cache, settings=tuple(settings), gap=gap
        )
        options = options if budget is None else replace(options, budget=budget)
        results = _checked(files, options, how, scheduler, jobs) if files else []
        results = [*results, *_skipped([*others])] or _nothing(specs)
    form = format_ or ("json" if how.json else "github" if github.detected() else "text")
    write_stdout(written(form, results, Terminal.stdout(color=how.color), quiet=how.quiet))
    keeper.tell({"said": True})
    if form == "github":
        github.append_step_summary(results)
    return max((result.code for result in results), key=_WORST.index)


def _below(path: str) -> list[str]:
    """A file, or the specifications below a folder; hidden ones, and links that lead out of it, are left alone."""
    folder = Path(path)
    if not folder.is_dir():
        return [path]
    root = folder.resolve()
    return sorted(
        str(file)
        for file in folder.rglob("*")
        if file.suffix in _SUFFIXES
        and file.is_file()
        and file.resolve().is_relative_to(root)
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
    )


def _is_specification(file: str) -> bool:
    """Whether a YAML file has a key that every specification has; what cannot be read is left to the check to tell."""
    try:
        return re.search(_OF_SPECIFICATIONS, read_file(file, SPECIFICATION)) is not None
    except TubecertError:
        return True


def _skipped(others: Sequence[str]) -> list[Checked]:
    """What was left alone is said, once."""
    if not others:
        return []
    what = "1 file is no specification" if len(others) == 1 else f"{len(others)} files are no specifications"
    shown = ", ".join(others[:_SHOWN]) + (", ..." if len(others) > _SHOWN else "")
    message = f"{what} and {'was' if len(others) == 1 else 'were'} left alone: {shown}"
    help = "a specification has the keys tubecert, system and safe_set"
    return _said(others[0], "TC123", message, help, severity=Severity.NOTE)


def _nothing(paths: Sequence[str]) -> list[Checked]:
    """What there is to say where there is nothing to check."""
    help = "give files, or folders that contain files *.yaml"
    return _said(paths[0], "TC100", f"no specification in {', '.join(paths)}", help, ExitCode.INVALID)


def _said(
    path: str, code: str, message: str, help: str, end: ExitCode = ExitCode.CERTIFIED, **more: Any
) -> list[Checked]:
    from tubecert.checking import Checked

    finding = Finding(code=code, message=message, help=help, **more)
    return [Checked(path=path, findings=(finding,), code=end)]


def _checked(
    files: Sequence[str], options: CheckOptions, how: Output, scheduler: str | None, jobs: int
) -> list[Checked]:
    """The results in the order of the files, whichever is ready first."""
    from tubecert.checking import check

    if scheduler is not None:  # there files are known by their places, not by where the command runs
        files = [str(Path(file).resolve()) for file in files]
    executor = chosen(jobs, len(files)) if scheduler is None else cluster_at(scheduler)
    with telling.shown(how) as report:
        told = Pieces(report, Phase.CHECK, len(files))

        def ready(place: int, checked: Checked) -> None:
            said = "; ".join(each.message for each in checked.findings) or "no findings"
            telling.found(f"{checked.path}: {said}")
            told.ready(place, checked)

        inner = told if isinstance(executor, Serial) else None  # other processes do not tell
        return executor.map(partial(check, options=options, progress=inner), files, ready)


def written(form: str, results: Sequence[Checked], terminal: Terminal, *, quiet: bool = False) -> str:
    """Results as one of the `FORMATS`."""
    found = [item for result in results for item in result.findings]
    if form == "text":
        closing = findings.summary(found, len(results))
        return terminal.text(findings.render(() if quiet else found, closing=closing))
    if form == "json":
        return json_text([*map(findings.as_data, found)])
    text: str = import_module(f"tubecert.report.{form}").render(results)
    return text


def _members(paths: Sequence[str], family: str) -> list[Checked]:
    """What there is to say of each plan: a CSV file, or a specification whose trajectory it is."""
    certified = Path(family).suffix.lower() == ".json"
    spec = load_text(read(family).effective.text, family) if certified else load(family)
    if spec.trajectory.bundle is None:
        message = f"{visible(family)} is about one plan, not about a family"
        help = "a family has trajectory: {kind: any, x: {...}, u: {...}}"
        raise SpecError([Finding(code="TC411", message=message, help=help)])
    return [_member(path, spec) for path in paths]


def _member(path: str, family: Spec) -> Checked:
    from tubecert.checking import Checked
    from tubecert.pipeline.membership import NO_MEMBER, UNDECIDED, member_spec, membership

    try:
        found = membership(member_spec(path, family), family, visible(path))
    except TubecertError as error:
        return Checked(path=path, findings=error.findings, code=error.exit_code)
    codes = {item.code for item in found if item.severity is Severity.ERROR}
    code = ExitCode.CERTIFIED
    if codes:
        code = ExitCode.NOT_CERTIFIED if NO_MEMBER in codes else ExitCode.UNDECIDED
    assert codes <= {NO_MEMBER, UNDECIDED}
    return Checked(path=path, findings=tuple(found), code=code)

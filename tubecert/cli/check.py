"""`check`: what is wrong with specifications, without certifying them."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.errors import ExitCode, TubecertError
from tubecert.findings import Finding, Severity
from tubecert.report.findings import as_data, render, summary
from tubecert.report.terminal import Terminal

_SUFFIXES = {".yaml", ".yml"}


def run(paths: Sequence[str], output: Output) -> ExitCode:
    """Check every file; findings are the result and go to stdout."""
    findings: list[Finding] = []
    worst, files = ExitCode.CERTIFIED, 0
    for path in _expand(paths):
        found, code = _check(path)
        findings += found
        worst = _worse(worst, code)
        files += 1
    if not files:
        finding = Finding(
            code="TC100",
            message=f"no specification in {', '.join(paths)}",
            help="give files, or folders that contain files *.yaml",
        )
        findings, worst = [finding], ExitCode.INVALID
    write_stdout(_text(findings, files, output))
    return worst


def _text(findings: Sequence[Finding], files: int, output: Output) -> str:
    if output.json:
        return json.dumps([as_data(finding) for finding in findings], indent=1, ensure_ascii=False) + "\n"
    shown = () if output.quiet else findings
    return Terminal.stdout(color=output.color).text(render(shown, closing=summary(findings, files)))


def _check(path: str) -> tuple[list[Finding], ExitCode]:
    """The findings of one file, and the exit code they deserve."""
    from tubecert.spec import load

    try:
        spec = load(path)
        from tubecert.pipeline import inspect

        findings = inspect(spec)
    except TubecertError as error:
        return list(error.findings), error.exit_code
    wrong = any(finding.severity is Severity.ERROR for finding in findings)
    return findings, ExitCode.NOT_CERTIFIED if wrong else ExitCode.CERTIFIED


def _worse(one: ExitCode, other: ExitCode) -> ExitCode:
    """An invalid file weighs more than a refuted one."""
    return max(one, other)


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
    """Specifications in a folder and its subfolders; hidden ones are left alone."""
    return sorted(
        str(file)
        for file in folder.rglob("*")
        if file.suffix in _SUFFIXES
        and file.is_file()
        and not any(part.startswith(".") for part in file.relative_to(folder).parts)
    )

"""`export`: a certificate in; a folder with its controller out."""

from __future__ import annotations

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.errors import ExitCode
from tubecert.export.words import brief
from tubecert.library.exporting import Language, Precision, export
from tubecert.printable import visible


def run(name: str, folder: str | None, language: Language, precision: Precision, output: Output) -> ExitCode:
    """Export the controller of a certificate into a folder."""
    target = folder or f"{name.removesuffix('.json').removesuffix('.certificate')}.controller"
    found = export(name, target, language=language, precision=precision)
    if not output.quiet:
        write_stdout(f"{visible(target)}: {', '.join(sorted(found.files))}\n")
        write_stdout(f"{brief(found.controller)} (README.md)\n")
    return ExitCode.CERTIFIED

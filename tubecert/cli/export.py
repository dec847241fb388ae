"""`export`: a certificate in; a folder with its controller out."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.cli.guard import write_stdout
from tubecert.cli.options import Output
from tubecert.errors import ExitCode
from tubecert.export.words import brief
from tubecert.library.exporting import Language, Platform, Precision, export
from tubecert.printable import visible


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is asked for: in what, and for which machine."""

    language: Language
    precision: Precision
    platform: Platform | None


def run(name: str, folder: str | None, wanted: Wanted, output: Output) -> ExitCode:
    """Export the controller of a certificate into a folder."""
    target = folder or f"{name.removesuffix('.json').removesuffix('.certificate')}.controller"
    found = export(
        name, target, language=wanted.language, precision=wanted.precision, platform=wanted.platform
    )
    if not output.quiet:
        write_stdout(f"{visible(target)}: {', '.join(sorted(found.files))}\n")
        write_stdout(f"{brief(found.controller)} (README.md)\n")
    return ExitCode.CERTIFIED

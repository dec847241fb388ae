"""The command `export`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Output, with_output

_AFTER = """\b
Examples:
  tubecert export plant.certificate.json -o controller
  tubecert export plant.certificate.json -o controller --precision single
  tubecert export plant.certificate.json -o controller --language python

\b
Exit codes: 0 written; 2 no certificate, one whose certificate H is not certified or cannot be exported (the
message says why), or a folder that cannot be written.
"""


class Languages(StrEnum):
    """What the controller is written in."""

    C = "c"
    PYTHON = "python"


class Precisions(StrEnum):
    """What it computes in."""

    DOUBLE = "double"
    SINGLE = "single"


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Write the controller of a certificate as code.")(export)


@with_output
def export(
    context: typer.Context,
    certificate: Annotated[
        str,
        typer.Argument(
            metavar="CERT", help="A certificate (JSON) whose certificate H holds.", show_default=False
        ),
    ],
    *,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where to.  [CERT's stem.controller]"),
    ] = None,
    language: Annotated[Languages, typer.Option(help="C99, or Python with numpy.")] = Languages.C,
    precision: Annotated[
        Precisions, typer.Option(help="Of C: double, or single (float).")
    ] = Precisions.DOUBLE,
    how: Output,
) -> None:
    """Write the controller that a certificate H is about: C99 without dependencies, or Python."""
    if language is Languages.PYTHON and precision is Precisions.SINGLE:
        raise typer.BadParameter("Python computes in double", ctx=context)
    with guarded(how):
        from tubecert.cli.export import run

        code = run(certificate, output, language.value, precision.value, how)
    raise typer.Exit(code)

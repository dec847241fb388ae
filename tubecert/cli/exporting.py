"""The command `export`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Output, with_output

if TYPE_CHECKING:
    from tubecert.library.exporting import Platform

_AFTER = """\b
Examples:
  tubecert export plant.certificate.json -o controller
  tubecert export plant.certificate.json -o controller --precision single
  tubecert export plant.certificate.json -o controller --precision single --for arduino
  tubecert export plant.certificate.json -o controller --language python

\b
Exit codes: 0 written; 2 no certificate, one whose certificates H and C are not certified or cannot be exported (the
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


class Platforms(StrEnum):
    """What a skeleton is written for."""

    ARDUINO = "arduino"
    ROS2 = "ros2"
    PX4 = "px4"


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Write the controller of a certificate as code.")(export)


@with_output
def export(
    context: typer.Context,
    certificate: Annotated[
        str,
        typer.Argument(
            metavar="CERT", help="A certificate (JSON) whose certificate H or C holds.", show_default=False
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
    platform: Annotated[
        Platforms | None,
        typer.Option("--for", help="Also a program around it, to be completed.", show_default=False),
    ] = None,
    how: Output,
) -> None:
    """Write the controller that a certificate H or C is about: C99 without dependencies, or Python."""
    if language is Languages.PYTHON and precision is Precisions.SINGLE:
        raise typer.BadParameter("Python computes in double", ctx=context)
    with guarded(how):
        from tubecert.cli.export import Wanted, run

        machine: Platform | None = None
        if platform is not None:
            machine = platform.value
        wanted = Wanted(
            language=language.value,
            precision=precision.value,
            platform=machine,
        )
        code = run(certificate, output, wanted, how)
    raise typer.Exit(code)

"""The command `export`: a certificate in; a folder with its controller out. `register` adds it to the app."""

from __future__ import annotations

from typing import Annotated

import typer

from tubecert.cli.guard import guarded, write_stdout
from tubecert.cli.options import Output, with_output

_AFTER = """\b
Examples:
  tubecert export plant.certificate.json -o controller
  cd controller && cc -std=c99 -O2 controller.c selftest.c -o selftest -lm && ./selftest
  tubecert recheck plant.certificate.json --controller controller

\b
Exit codes: 0 written; 2 no certificate of a sampled loop, no controller in it, or a folder with files that tubecert
did not write or that were changed; 1 the certificate says refuted, 4 it says undecided: nothing is written.
"""


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Write the controller of a certificate in C.")(export)


@with_output
def export(
    context: typer.Context,
    certificate: Annotated[
        str,
        typer.Argument(metavar="CERT", help="A certificate (JSON) of a sampled loop.", show_default=False),
    ],
    *,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where to.  [CERT's stem.controller]"),
    ] = None,
    how: Output,
) -> None:
    """Write the controller that a certificate of a sampled loop is about: C99, with its data and a self-test."""
    with guarded(how):
        from tubecert.library.exporting import export as exported
        from tubecert.printable import visible

        stem = certificate.removesuffix(".json").removesuffix(".certificate")
        found = exported(certificate, output or f"{stem}.controller")
        if not how.quiet:
            write_stdout(f"{visible(found.folder)}: {', '.join(found.files)}\n")
            write_stdout(
                f"  {found.work} multiply-adds a sample; README.txt says how to compile and what is covered\n"
            )
    raise typer.Exit(0)

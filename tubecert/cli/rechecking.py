"""The command `recheck`: its options. `register` adds it to the app."""

from __future__ import annotations

from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Output, with_output

_AFTER = """\b
Examples:
  tubecert recheck plant.certificate.json
  tubecert recheck plant.certificate.json --spec plant.yaml
  tubecert recheck plant.certificate.json --controller plant.controller
  tubecert recheck plant.certificate.json --json | jq .first_failing

\b
Exit codes: 0 certified, and every claim confirmed; 1 a claim is contradicted, or it says refuted; 2 no
certificate, or one of another specification; 4 a claim could not be decided, or it says undecided.
"""


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Verify a certificate in a second arithmetic.")(recheck)


@with_output
def recheck(
    context: typer.Context,
    certificate: Annotated[
        str,
        typer.Argument(metavar="CERT", help="A certificate (JSON); - is stdin.", show_default=False),
    ],
    *,
    spec: Annotated[
        str | None,
        typer.Option(metavar="SPEC", help="Also: that the certificate is of this specification."),
    ] = None,
    budget: Annotated[
        str | None,
        typer.Option(metavar="NUMBER", help="Boxes examined per claim before giving up.  [200000]"),
    ] = None,
    deadline: Annotated[
        str | None,
        typer.Option(metavar="NUMBER", help="Seconds after which what is not proven is undecided."),
    ] = None,
    controller: Annotated[
        str | None,
        typer.Option(metavar="FOLDER", help="Also: that what export wrote there is of the certificate."),
    ] = None,
    how: Output,
) -> None:
    """Verify every claim of a certificate again: in ball arithmetic, with derivatives of its own, without a solver."""
    with guarded(how):
        from tubecert.cli.recheck import Given, run

        given = Given(
            certificate=certificate, spec=spec, budget=budget, deadline=deadline, controller=controller
        )
        code = run(given, how)
    raise typer.Exit(code)

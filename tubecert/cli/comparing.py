"""The command `compare`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Output, with_output

_AFTER = """\b
Examples:
  tubecert compare before.certificate.json after.certificate.json
  tubecert compare old.json new.json --format markdown > comment.md
  tubecert compare study.sweep/points/*.certificate.json --format csv
  tubecert compare a.json b.json c.json -o page.html

\b
Exit codes: 0 the certificates were compared, whatever they say; 2 one of them cannot be read.
"""


class Shape(StrEnum):
    """What a comparison is written as."""

    TEXT = "text"
    MARKDOWN = "markdown"
    CSV = "csv"
    JSON = "json"


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Put certificates side by side.")(compare)


@with_output
def compare(
    context: typer.Context,
    certificates: Annotated[
        list[str],
        typer.Argument(metavar="CERT...", help="Certificates, two or more.", show_default=False),
    ],
    *,
    format_: Annotated[
        Shape, typer.Option("--format", help="What to write on stdout; markdown is for pull requests.")
    ] = Shape.TEXT,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="A page or a table: FILE.html (with figures), FILE.md, FILE.csv or FILE.json; may be repeated.",
        ),
    ] = None,
    how: Output,
) -> None:
    """Put gains, tubes and margins of certificates side by side, and name what differs in their specifications."""
    if len(certificates) < 2:
        raise typer.BadParameter("two certificates or more are compared", ctx=context)
    if how.json and format_ not in (Shape.TEXT, Shape.JSON):
        raise typer.BadParameter("--json and --format exclude each other", ctx=context)
    with guarded(how):
        from tubecert.cli.compare import run

        run(certificates, "json" if how.json else str(format_), output or (), how)
    raise typer.Exit(0)

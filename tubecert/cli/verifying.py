"""The command `verify`: its options. `register` adds it to the app."""

from __future__ import annotations

from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Budget, Ending, Output, Settings, number_option, with_output

_AFTER = """\b
Examples:
  tubecert verify plant.yaml
  tubecert verify plant.yaml metric.json other.mat
  tubecert verify published/*.yaml --json
  tubecert verify configs/published/*.yaml --expect
  tubecert verify plant.yaml coefficients.npz --rate 0.8 -o metric.json

\b
A file of a specification may lack all but tubecert, name, system, safe_set and metric. Metrics that follow
it (.json, .csv, .npz, .mat) are decided for its system in place of its own. docs/verify.md has the formats.

\b
Exit codes: 0 C1-C3 hold for all of them; 1 one is refuted; 2 invalid input; 4 one could not be decided.
"""


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Decide metrics alone: C1-C3, largest rate.")(verify)


@with_output
def verify(
    context: typer.Context,
    files: Annotated[
        list[str],
        typer.Argument(
            metavar="SPEC|METRIC...", help="Specifications, and metrics after them.", show_default=False
        ),
    ],
    *,
    set_: Settings = None,
    rate: Annotated[
        str | None, number_option("--rate", "Decide at this rate, in 1/s, in place of the metric's own.")
    ] = None,
    gap: Annotated[
        str, number_option("--gap", "Relative width to which the largest rate is enclosed.")
    ] = "1/1000",
    budget: Budget = None,
    deadline: Ending = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Write a metric file, if there is one metric and it holds."
        ),
    ] = None,
    expect: Annotated[
        bool,
        typer.Option(
            "--expect", help="Compare each with the section `expect` of its specification; 0 if all agree."
        ),
    ] = False,
    how: Output,
) -> None:
    """Decide C1, C2, C3 of metrics on their safe sets, without plan, uncertainty or tube."""
    with guarded(how, deadline):
        from tubecert.cli.verify import Given, run

        given = Given(
            files=files,
            settings=set_ or (),
            rate=rate,
            gap=gap,
            budget=budget,
            target=output,
            expect=expect,
        )
        code = run(given, how)
    raise typer.Exit(code)

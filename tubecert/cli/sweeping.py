"""The command `sweep`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from tubecert.cli.clusters import Scheduler
from tubecert.cli.guard import guarded
from tubecert.cli.options import Budget, Ending, Output, Settings, SpecFile, number_option, with_output
from tubecert.letters import ALL, words_of

_AFTER = """\b
Examples:
  tubecert sweep plant.yaml --over tube.epsilon=.1:.6:6
  tubecert sweep plant.yaml --over tube.epsilon=.1:.6:6 --over metric.rate=.5:2:log5 --jobs 4
  tubecert sweep plant.yaml --over conditions.decides=0,A,B --set tube.rho_a=0.2 -o study

\b
A range is FIRST:LAST:COUNT (equal steps), FIRST:LAST:logCOUNT (equal factors), or VALUE,VALUE,...; several
make a grid. Every point is certified as tubecert certify --set ... does it, and kept in a file of its own:
the same command goes on with a sweep that was interrupted. docs/sweep.md says what the folder holds.

\b
Exit codes: 0 every point has its row, whatever its verdict; 2 invalid input, or no point has a valid
specification; 3 an internal error at a point (its row says so); 130 interrupted.
"""

Deciding = StrEnum("Deciding", [(word, word) for word in (*words_of(), ALL)])  # type: ignore[misc]


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Certify a grid of keys: table, curves, heat maps.")(sweep)


@with_output
def sweep(
    context: typer.Context,
    spec: SpecFile,
    *,
    over: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=RANGE", help="A key and its values; may be repeated.", show_default=False),
    ] = None,
    set_: Settings = None,
    metric: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Metric file (JSON) in place of the specification's.")
    ] = None,
    conditions: Annotated[
        Deciding | None,
        typer.Option(
            help="Which certificate decides the verdict; all are always computed.  [conditions.decides, or A]",
            show_default=False,
        ),
    ] = None,
    gap: Annotated[str, number_option("--gap", "As for certify.")] = "1/100",
    budget: Budget = None,
    deadline: Ending = None,
    jobs: Annotated[str, typer.Option(metavar="NUMBER", help="Points certified at a time.")] = "1",
    scheduler: Scheduler = None,
    parquet: Annotated[
        bool,
        typer.Option(
            "--parquet", help="The table as Parquet, too; needs pyarrow, which is no part of tubecert."
        ),
    ] = False,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Points, table, figures.  [SPEC's stem.sweep]"),
    ] = None,
    how: Output,
) -> None:
    """Certify every point of a grid of keys of a specification; a table, curves, heat maps."""
    if not over:
        raise typer.BadParameter("--over says which keys have which values", ctx=context)
    with guarded(how, deadline):
        from tubecert.cli.sweep import Given, run

        given = Given(
            spec=spec,
            over=over,
            settings=set_ or (),
            metric=metric,
            conditions=None if conditions is None else str(conditions),
            gap=gap,
            budget=budget,
            jobs=jobs,
            scheduler=scheduler,
            parquet=parquet,
            folder=output,
        )
        code = run(given, how)
    raise typer.Exit(code)

"""The command `synth`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import Budget, Deadline, Output, Settings, SpecFile, number_option, with_output

_AFTER = """\b
Examples:
  tubecert synth plant.yaml
  tubecert synth plant.yaml --rate 0.8 -o metric.json
  tubecert synth plant.yaml --objective adaptation --plot rates.svg
  tubecert synth plant.yaml --rate 0.8 --solver cvxpy:MOSEK
  tubecert certify plant.yaml --metric metric.json

\b
A file without uncertainty or trajectory will do where a rate is asked for: nothing is certified with it then.

\b
Exit codes: 0 a metric was proven and written; 1 no metric has the rate (the report says why); 2 invalid
input; 4 none was found, or none certifies (the report says what was tried and what would help).
"""


class Objective(StrEnum):
    """What makes a metric the best."""

    CONDITION = "condition"
    MARGIN = "margin"
    RATE = "rate"
    ADAPTATION = "adaptation"
    TUBE = "tube"


class Route(StrEnum):
    """How metrics are found."""

    AUTO = "auto"
    SOS = "sos"
    CEGIS = "cegis"


class Scaling(StrEnum):
    """In what coordinates condition numbers are meant."""

    AUTO = "auto"
    IDENTITY = "identity"


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Find a metric and prove it.")(synth)


@with_output
def synth(
    context: typer.Context,
    spec: SpecFile,
    *,
    rate: Annotated[str | None, number_option("--rate", "Contraction rate, in 1/s.")] = None,
    objective: Annotated[
        Objective | None,
        typer.Option(
            help="What is best. At a rate: the least condition number, the greatest margin. Else the rate that "
            "gives the least adaptation rate or the smallest tube, or the greatest rate.",
            show_default=False,
        ),
    ] = None,
    degree: Annotated[
        int | None, typer.Option(min=0, max=8, help="Degree of W(x).  [raised until it works]")
    ] = None,
    variables: Annotated[
        str | None, typer.Option(metavar="NAMES", help="States that W depends on, e.g. x1,x3.  [chosen]")
    ] = None,
    condition_number: Annotated[
        str | None, number_option("--condition-number", "Not to be exceeded on the safe set.")
    ] = None,
    coordinates: Annotated[
        Scaling | None,
        typer.Option(help="In which the condition number counts; auto: half-widths of the safe set.  [auto]"),
    ] = None,
    route: Annotated[Route | None, typer.Option(help="How metrics are found.  [auto]")] = None,
    solver: Annotated[
        str | None,
        typer.Option(
            metavar="<clarabel|scs|cvxpy:NAME>",
            help="Which solver proposes; NAME: one that cvxpy knows.  [clarabel]",
        ),
    ] = None,
    table: Annotated[bool, typer.Option("--table", help="Compare metrics over a range of rates.")] = False,
    plot: Annotated[
        str | None, typer.Option(metavar="FILE", help="Draw the comparison (SVG); implies --table.")
    ] = None,
    set_: Settings = None,
    rho_a: Annotated[str | None, number_option("--rho-a", "Overrides tube.rho_a.")] = None,
    epsilon: Annotated[str | None, number_option("--epsilon", "Overrides tube.epsilon.")] = None,
    budget: Budget = None,
    deadline: Deadline = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The metric file; - is stdout.  [SPEC's stem.metric.json]"
        ),
    ] = None,
    how: Output,
) -> None:
    """Find a dual metric, round it, and write it only if C1-C3 are proven on the whole safe set."""
    with guarded(how):
        from tubecert.cli.synth import Given, run

        given = Given(
            spec=spec,
            settings=set_ or (),
            objective=None if objective is None else str(objective),
            degree=degree,
            variables=variables,
            coordinates=None if coordinates is None else str(coordinates),
            route=None if route is None else str(route),
            solver=solver,
            numbers={
                "rate": rate,
                "condition_number": condition_number,
                "rho_a": rho_a,
                "epsilon": epsilon,
                "budget": budget,
                "deadline": deadline,
            },
            table=table,
            plot=plot,
            target=output,
        )
        code = run(given, how)
    raise typer.Exit(code)

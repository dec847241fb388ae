"""The command `design`: its options. `register` adds it to the app."""

from __future__ import annotations

from typing import Annotated

import typer

from tubecert.cli.guard import guarded
from tubecert.cli.options import (
    Budget,
    DesignDeadline,
    Output,
    Settings,
    SpecFile,
    number_option,
    with_output,
)

_AFTER = """\b
Examples:
  tubecert design configs/hardware_orbit.yaml
  tubecert design plant.yaml --minimise px,pz --set hardware.rate=250
  tubecert design plant.yaml --metric search
  tubecert design plant.yaml --corridor px=0.2,pz=0.2
  tubecert design plant.yaml --pareto tube,hardware.rate

\b
The tube of the specification is scaled up and down; every attempt is a full certification of the kind that
decides (conditions.decides, normally H: the machine), and the narrowest one that is certified is written.
With --corridor the tube is given: what is written is the lowest rate, the largest delay, noise and wind, each alone.

\b
A deadline, Ctrl-C and SIGTERM end the search after its first size: the best that is certified by then is written.

\b
Exit codes: 0 a tube was found; 1 none, and a claim is refuted; 2 invalid input; 4 none; 130 interrupted.
"""


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="The narrowest tube that the machine keeps.")(design)


@with_output
def design(
    context: typer.Context,
    spec: SpecFile,
    *,
    minimise: Annotated[
        str | None,
        typer.Option(
            metavar="STATES",
            help="States and outputs whose half-widths count, by commas.  [those of tube.half_widths, or the radius]",
            show_default=False,
        ),
    ] = None,
    corridor: Annotated[
        str | None,
        typer.Option(
            metavar="R|STATE=WIDTH,...",
            help="The cheapest machine for this tube, in place of the narrowest tube.",
            show_default=False,
        ),
    ] = None,
    pareto: Annotated[
        str | None,
        typer.Option(
            metavar="tube,KEY",
            help="The tube against hardware.rate, .delay, .noise or disturbance.bound, as a front of certificates.",
            show_default=False,
        ),
    ] = None,
    sensitivities: Annotated[
        bool,
        typer.Option(
            "--sensitivities",
            help="What the tube becomes with each number of the machine halved, and taken away.",
        ),
    ] = False,
    set_: Settings = None,
    metric: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|search",
            help="Metric file (JSON) in place of the specification's; or one is looked for, for this machine.",
        ),
    ] = None,
    gap: Annotated[str, number_option("--gap", "As for certify.")] = "1/100",
    budget: Budget = None,
    deadline: DesignDeadline = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FILE", help="The certificate.  [SPEC's stem.design.json]"),
    ] = None,
    how: Output,
) -> None:
    """Find the narrowest certified tube for the machine of a specification."""
    del context
    with guarded(how):
        from tubecert.cli.design import Given, run

        given = Given(
            spec=spec,
            minimise=minimise,
            corridor=corridor,
            pareto=pareto,
            sensitivities=sensitivities,
            settings=set_ or (),
            metric=metric,
            gap=gap,
            budget=budget,
            deadline=deadline,
            target=output,
        )
        code = run(given, how)
    raise typer.Exit(code)

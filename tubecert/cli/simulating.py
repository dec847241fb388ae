"""The command `simulate`: its options. `register` adds it to the app."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from tubecert.cli.clusters import Scheduler
from tubecert.cli.guard import guarded
from tubecert.cli.options import Ending, Output, Settings, SpecFile, number_option, with_output
from tubecert.letters import ADAPTIVE, words_of

_AFTER = """\b
Examples:
  tubecert simulate plant.yaml
  tubecert simulate plant.yaml --certificate plant.certificate.json --runs 1000 -o plant.runs
  tubecert simulate plant.yaml --controllers ccm,reference,l1
  tubecert simulate plant.yaml --bandwidth 20 --adaptation-rate 1e5
  tubecert simulate family.yaml --certificate family.certificate.json --members 1000 --runs 4000

\b
Exit codes: 0 nothing was falsified (which proves nothing); 1 a promise is broken, or a loop that adapts
left the tube; 2 invalid input; 4 no result, or no tube to leave; 130 interrupted, what was finished is kept.
"""


# whose gains: each kind that has any, by its letter or its word
Source = StrEnum("Source", [(word, word) for word in words_of(ADAPTIVE)])  # type: ignore[misc]


def register(app: typer.Typer) -> None:
    """Adds the command to the app."""
    app.command(epilog=_AFTER, short_help="Integrate the closed loops, try to break the certificate.")(
        simulate
    )


@with_output
def simulate(
    context: typer.Context,
    spec: SpecFile,
    *,
    certificate: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Its certificate; without one, simulate certifies first."),
    ] = None,
    controllers: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            help="Loops, separated by commas: nominal, ccm, reference, l1.  [ccm,l1]",
        ),
    ] = None,
    gains: Annotated[
        Source | None,
        typer.Option(help="The certificate whose gains are taken.  [distance]", show_default=False),
    ] = None,
    runs: Annotated[
        str | None,
        number_option("--runs", "Random runs against each loop that adapts; 0: no attacks.  [100]"),
    ] = None,
    jobs: Annotated[str, typer.Option(metavar="NUMBER", help="Vectors of 128 runs at a time.")] = "1",
    scheduler: Scheduler = None,
    seed: Annotated[
        str | None, number_option("--seed", "Seed of the random runs and of the adversary.  [0]")
    ] = None,
    replay: Annotated[
        str | None, number_option("--replay", "Draw this random run in place of the specification's h.")
    ] = None,
    members: Annotated[
        str | None,
        number_option("--members", "Of a family without hardware: random plans that share the runs.  [20]"),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="... this plan (CSV or specification), if it is one."),
    ] = None,
    duration: Annotated[
        str | None, number_option("--duration", "How long, in s.  [the horizon, else 10/rate]")
    ] = None,
    bandwidth: Annotated[
        str | None, number_option("--bandwidth", "Choose the filter bandwidth, in rad/s.")
    ] = None,
    adaptation_rate: Annotated[
        str | None, number_option("--adaptation-rate", "Choose the adaptation rate of l1.")
    ] = None,
    metric: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A metric file, as for certify (without --certificate)."),
    ] = None,
    set_: Settings = None,
    epsilon: Annotated[
        str | None, number_option("--epsilon", "Overrides tube.epsilon (without --certificate).")
    ] = None,
    rho_a: Annotated[
        str | None, number_option("--rho-a", "Overrides tube.rho_a (without --certificate).")
    ] = None,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Data and figures.  [SPEC's stem.simulation]"),
    ] = None,
    deadline: Ending = None,
    how: Output,
) -> None:
    """Integrate the closed loops, attack the tube, draw figures. It can falsify a certificate, never support one."""
    if certificate is not None and (epsilon is not None or rho_a is not None):
        raise typer.BadParameter("a certificate has its own epsilon and rho_a", ctx=context)
    if certificate is not None and metric is not None:
        raise typer.BadParameter("a certificate has its own metric", ctx=context)
    if certificate is not None and set_:
        raise typer.BadParameter(
            "a certificate has its own specification: --set goes without it", ctx=context
        )
    if plan is not None and members is not None:
        raise typer.BadParameter("a plan of your own, or random ones: --plan, or --members", ctx=context)
    with guarded(how, deadline):
        from tubecert.cli.simulate import Given, run

        given = Given(
            spec=spec,
            settings=set_ or (),
            certificate=certificate,
            metric=metric,
            controllers=controllers,
            gains=None if gains is None else str(gains),
            plan=plan,
            numbers={
                "epsilon": epsilon,
                "rho_a": rho_a,
                "duration": duration,
                "bandwidth": bandwidth,
                "adaptation_rate": adaptation_rate,
                "runs": runs,
                "seed": seed,
                "replay": replay,
                "members": members,
            },
            folder=output,
            jobs=jobs,
            scheduler=scheduler,
        )
        code = run(given, how)
    raise typer.Exit(code)

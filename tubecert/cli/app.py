"""The commands and their options. What a command does is imported when it runs."""

from __future__ import annotations

import sys
import warnings
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from tubecert.cli import (
    comparing,
    everyday,
    exporting,
    rechecking,
    simulating,
    sweeping,
    synthesising,
    verifying,
)
from tubecert.cli.clusters import Scheduler
from tubecert.cli.guard import flush_stdout, guarded, refuse_usage, stdout_failed
from tubecert.cli.options import Budget, Deadline, Output, Settings, SpecFile, number_option, with_output
from tubecert.errors import ExitCode
from tubecert.letters import ALL, words_of

# ClickException: typer has a click of its own, or uses click's
_USAGE: type[Exception] = typer.BadParameter.__mro__[2]
_ABOUT = """Proven tracking tubes for contraction-metric control with L1 adaptation.

From a YAML file that describes a control-affine system with matched uncertainty, tubecert proves: with this
metric, this filter bandwidth and this adaptation rate, every state stays within its half-width of the plan.
"""

_AFTER = """\b
Example, in this order, for a robot of your own:
  tubecert init robot.yaml
  tubecert check robot.yaml
  tubecert synth robot.yaml
  tubecert certify robot.yaml --metric robot.metric.json
  tubecert report robot.certificate.json

\b
Exit codes:
  0  certified, or nothing to complain about
  1  not certified: refuted (the report says which claim), or a check found errors
  2  the command line or an input file is invalid
  3  internal error
  4  undecided: a budget or the time ran out (what was found until then is said)
  130  interrupted (SIGTERM: 143)
"""

_CERTIFY_AFTER = """\b
Examples:
  tubecert certify plant.yaml
  tubecert certify plant.yaml --rho-a 0.05 --conditions all -o plant.json
  tubecert certify plant.yaml --set tube.epsilon=0.3 --set system.parameters.m=0.5
  tubecert certify plant.yaml --bandwidth 50 --adaptation-rate 2e7
  tubecert certify plant.yaml --report plant.html
  tubecert certify plant.yaml -q -o - | jq .result.tube
"""

_REPORT_AFTER = """\b
Examples:
  tubecert report plant.certificate.json
  tubecert report plant.certificate.json -o plant.html -o plant.md
  tubecert report plant.certificate.json --simulation plant.simulation
"""

app = typer.Typer(
    name="tubecert",
    help=_ABOUT,
    epilog=_AFTER,
    add_completion=True,
    rich_markup_mode=None,  # rich would double the time of --help
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


# which certificates must hold: each kind by its letter or its word
Conditions = StrEnum("Conditions", [(word, word) for word in (*words_of(), ALL)])  # type: ignore[misc]


@app.callback(invoke_without_command=True)
@with_output
def _main(context: typer.Context, *, how: Output) -> None:
    context.obj = how
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@app.command(epilog=_CERTIFY_AFTER, short_help="Prove the tube, find the smallest gains.")
@with_output
def certify(
    context: typer.Context,
    spec: SpecFile,
    *,
    set_: Settings = None,
    rho_a: Annotated[
        str | None,
        number_option(
            "--rho-a", "Radius left to the adaptation, a length over all states (overrides tube.rho_a)."
        ),
    ] = None,
    epsilon: Annotated[
        str | None,
        number_option(
            "--epsilon", "Radius beyond the initial offset (overrides tube.epsilon; not beside half_widths)."
        ),
    ] = None,
    metric: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Metric file (JSON) in place of the specification's.")
    ] = None,
    conditions: Annotated[
        Conditions | None,
        typer.Option(
            help="Which certificate decides the verdict: 0 (none: no adaptation), A (26: the paper's), B (distance), "
            "or all of them; all are always computed.  [conditions.decides, or A]",
            show_default=False,
            case_sensitive=False,
        ),
    ] = None,
    bandwidth: Annotated[
        str | None, number_option("--bandwidth", "Judge this filter bandwidth, in rad/s.")
    ] = None,
    adaptation_rate: Annotated[
        str | None, number_option("--adaptation-rate", "... with this adaptation rate.")
    ] = None,
    gap: Annotated[
        str | None,
        typer.Option(
            "--gap",
            metavar="NUMBER|auto",
            help="Relative width at which a constant is sharp enough; auto: of each by its effect on the gains.  "
            "[tube.gap; else auto for half-widths of four or more states or along a plan that moves, 1/100 elsewhere]",
            show_default=False,
        ),
    ] = None,
    budget: Budget = None,
    deadline: Deadline = None,
    jobs: Annotated[
        str, typer.Option(metavar="NUMBER", help="Processes that share the boxes of a long search.")
    ] = "1",
    scheduler: Scheduler = None,
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The certificate; - is stdout.  [SPEC's stem.certificate.json]",
        ),
    ] = None,
    report: Annotated[
        list[str] | None,
        typer.Option(metavar="FILE", help="A page about it, too: FILE.html or FILE.md; may be repeated."),
    ] = None,
    how: Output,
) -> None:
    """Prove the tube around the plan and find the smallest gains; always write the certificate."""
    if (bandwidth is None) != (adaptation_rate is None):
        raise typer.BadParameter("--bandwidth and --adaptation-rate are given together", ctx=context)
    with guarded(how):
        from tubecert.cli.certify import Given, run

        given = Given(
            spec=spec,
            settings=set_ or (),
            metric=metric,
            conditions=None if conditions is None else str(conditions),
            numbers={
                "rho_a": rho_a,
                "epsilon": epsilon,
                "bandwidth": bandwidth,
                "adaptation_rate": adaptation_rate,
                "gap": gap,
                "budget": budget,
                "deadline": deadline,
            },
            jobs=jobs,
            scheduler=scheduler,
            target=output,
            pages=report or (),
        )
        code = run(given, how)
    raise typer.Exit(code)


@app.command("report", epilog=_REPORT_AFTER, short_help="Make a page from a certificate.")
@with_output
def make_report(
    context: typer.Context,
    certificate: Annotated[
        str, typer.Argument(metavar="CERT", help="A certificate (JSON).", show_default=False)
    ],
    *,
    output: Annotated[
        list[str] | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The page: FILE.html or FILE.md; may be repeated.  [CERT's stem.html]",
        ),
    ] = None,
    simulation: Annotated[
        str | None,
        typer.Option("--simulation", metavar="FOLDER", help="Show the figures that simulate drew for it."),
    ] = None,
    how: Output,
) -> None:
    """Make a page from a certificate, without certifying anything again."""
    with guarded(how):
        from tubecert.cli.report import run

        run(certificate, output, simulation, how)
    raise typer.Exit(0)


synthesising.register(app)
sweeping.register(app)
comparing.register(app)
verifying.register(app)
simulating.register(app)
rechecking.register(app)
exporting.register(app)
everyday.register(app)


def start() -> int:
    """Runs a command; its exit code. Never a traceback, whatever stdout is connected to."""
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # a library's deprecations are no message to users
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    try:
        code = app(prog_name="tubecert", standalone_mode=False)
    except _USAGE as error:
        code = refuse_usage(error)
    except typer.Abort:
        code = ExitCode.INTERRUPTED
    except OSError as error:  # from --help, which writes by itself
        code = stdout_failed(error)
    except SystemExit as end:  # typer's own: the reader of --help has gone, or completion is done
        fine = end.code in (None, 0) or isinstance(end.__context__, BrokenPipeError)
        code = ExitCode.CERTIFIED if fine else ExitCode.INTERNAL
    return flush_stdout() or (code if isinstance(code, int) else 0)

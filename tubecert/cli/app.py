"""The commands and their options. What a command does is imported when it runs."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Mapping
from typing import Any, Final

import typer

from tubecert.cli import (
    certify,
    check,
    compare,
    explain,
    export,
    init,
    recheck,
    report,
    schema,
    simulate,
    sweep,
    synth,
    verify,
)
from tubecert.cli.adapter import OUTPUT, Command, Output, with_options
from tubecert.cli.guard import flush_stdout, refuse_usage, stdout_failed
from tubecert.errors import ExitCode

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

app = typer.Typer(
    name="tubecert",
    help=_ABOUT,
    epilog=_AFTER,
    add_completion=True,
    rich_markup_mode=None,  # rich would double the time of --help
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _main(context: typer.Context, **given: Any) -> None:
    context.obj = Output.of(context, given)
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


app.callback(invoke_without_command=True)(with_options(_main, OUTPUT, version=True))
_COMMANDS: Final[Mapping[str, Command]] = {
    "certify": certify.certify,
    "report": report.report,
    "synth": synth.synth,
    "sweep": sweep.sweep,
    "compare": compare.compare,
    "verify": verify.verify,
    "simulate": simulate.simulate,
    "recheck": recheck.recheck,
    "export": export.export,
    "check": check.check,
    "init": init.init,
    "schema": schema.schema,
    "explain": explain.explain,
    "version": schema.version,
}
"""Every command, in the order of help."""
for _name, _command in _COMMANDS.items():
    _command.add(app, _name)


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

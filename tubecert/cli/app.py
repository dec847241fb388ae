"""The commands and their options."""

from __future__ import annotations

import sys
import warnings
from typing import Any

import typer
import typer.core

from tubecert.cli.adapter import OUTPUT, Output, command_of, said, with_options
from tubecert.cli.guard import flush_stdout, guarded, refuse_usage, stdout_failed
from tubecert.errors import ExitCode

# ClickException: typer has a click of its own, or uses click's
_USAGE: type[Exception] = typer.BadParameter.__mro__[2]


class Commands(typer.core.TyperGroup):
    """The commands. A module of one is imported when that is called, with all that stands at its top."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, and what it is called with."""
        if args and args[0] in self.commands:
            alone = typer.Typer(rich_markup_mode=None, add_completion=False)
            with guarded(Output()):
                command_of(args[0]).add(alone, args[0])
            self.commands[args[0]] = typer.main.get_command(alone)
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=Commands,
    name="tubecert",
    help=said().tubecert["about"],
    epilog=said().tubecert["after"],
    add_completion=True,
    rich_markup_mode=None,  # rich would double the time of --help
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
)


def _main(context: typer.Context, **given: Any) -> None:
    context.obj = Output.of(context, Output(**given))
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


app.callback(invoke_without_command=True)(with_options(_main, OUTPUT, version=True))
for _name, _own in said().commands.items():  # what help shows
    app.command(_name, short_help=_own["short"])(lambda: None)


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

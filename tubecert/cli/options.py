"""What every command shares: how to report, and the options that hold numbers."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import Annotated, Any, get_type_hints

import typer


class Color(StrEnum):
    """When to colour."""

    AUTO = "auto"
    ALWAYS = "always"
    NEVER = "never"


def _version(wanted: bool) -> None:
    if wanted:
        from tubecert.release import __version__

        typer.echo(f"tubecert {__version__}")
        raise typer.Exit


_Version = Annotated[
    bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
]
SpecFile = Annotated[
    str, typer.Argument(metavar="SPEC", help="The specification (YAML).", show_default=False)
]
Debug = Annotated[bool, typer.Option("--debug", help="Show the traceback of an internal error.")]


def flag(name: str) -> str:
    """The option of a parameter."""
    return f"--{name.replace('_', '-')}"


def number_option(flag: str, help: str) -> object:
    """An option whose text is read as an exact number (see `library.numbers`)."""
    return typer.Option(flag, metavar="NUMBER", help=help)


Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Set a key of the specification, e.g. tube.epsilon=0.3; may be repeated.",
    ),
]

Budget = Annotated[str | None, number_option("--budget", "Boxes examined per claim before giving up.")]

Ending = Annotated[
    str | None,
    number_option("--deadline", "Seconds after which the command ends, with what it found until then."),
]

Deadline = Annotated[
    str | None,
    number_option(
        "--deadline",
        "Seconds after which the command ends, with the best metric that was found so far.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """How to report: the options that commands share (see `with_output`)."""

    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also show the constants and all assumptions.")
    ] = False
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only the verdict.")] = False
    json: Annotated[bool, typer.Option("--json", help="JSON on stdout instead of the report.")] = False
    color: Annotated[Color | None, typer.Option("--color", help="When to colour (NO_COLOR is honoured).")] = (
        None
    )
    no_progress: Annotated[bool, typer.Option("--no-progress", help="No progress on stderr.")] = False
    debug: Debug = False

    @classmethod
    def of(cls, context: typer.Context, own: Output) -> Output:
        """The options given after the command (`own`) together with those given before it.

        Raises a usage error for `-q` with `-v`.
        """
        before = context.obj if isinstance(context.obj, cls) else cls()
        both = cls(
            **{item.name: getattr(own, item.name) or getattr(before, item.name) for item in fields(cls)}
        )
        if both.quiet and both.verbose:
            raise typer.BadParameter("--quiet and --verbose exclude each other", ctx=context)
        return both


def with_output(command: Callable[..., None]) -> Callable[..., None]:
    """The command with the options of `Output`, which it takes together as `how`, and with --version."""
    own = inspect.signature(command, eval_str=True)
    hints = get_type_hints(Output, include_extras=True)
    shared = {item.name: (hints[item.name], item.default) for item in fields(Output)}

    @functools.wraps(command)
    def whole(context: typer.Context, version: bool, **values: Any) -> None:
        how = Output.of(context, Output(**{name: values.pop(name) for name in shared}))
        command(context, **values, how=how)

    parameters = [parameter for name, parameter in own.parameters.items() if name != "how"]
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)
        for name, (annotation, default) in {**shared, "version": (_Version, False)}.items()
    ]
    whole.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    return whole

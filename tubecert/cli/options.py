"""What every command shares: how to report, and how a number on the command line is read."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any, Final, get_type_hints

import typer

from tubecert.errors import SpecError

if TYPE_CHECKING:
    from fractions import Fraction

    from tubecert.findings import Finding


class Color(StrEnum):
    """When to colour."""

    AUTO = "auto"
    ALWAYS = "always"
    NEVER = "never"


def _version(wanted: bool) -> None:
    if wanted:
        from tubecert import __version__

        typer.echo(f"tubecert {__version__}")
        raise typer.Exit


_MODERATE: Final = 60  # powers of ten: the conditions hold products of gains, and floats end at 1e308
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
    """An option whose text is read as an exact number (see `Numbers`)."""
    return typer.Option(flag, metavar="NUMBER", help=help)


Budget = Annotated[str | None, number_option("--budget", "Boxes examined per claim before giving up.")]

Deadline = Annotated[
    str | None,
    number_option("--deadline", "Seconds after which the best metric found so far is taken."),
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
    def of(cls, context: typer.Context, values: Mapping[str, Any]) -> Output:
        """The options given after the command (`values`) together with those given before it.

        Raises a usage error for `-q` with `-v`.
        """
        own = cls(**values)
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
        how = Output.of(context, {name: values.pop(name) for name in shared})
        command(context, **values, how=how)

    parameters = [parameter for name, parameter in own.parameters.items() if name != "how"]
    parameters += [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)
        for name, (annotation, default) in {**shared, "version": (_Version, False)}.items()
    ]
    whole.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    return whole


class Numbers:
    """Reads numbers as the specification's are read, and keeps what is wrong with them."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def positive(
        self,
        option: str,
        text: str | None,
        *,
        below: int | None = None,
        wanted: str = "positive",
        remedy: str = "> 0",
    ) -> Fraction | None:
        """The exact number, > 0 (and < `below`); None if the option is absent or wrong."""
        if text is None:
            return None
        from tubecert.expression import ExpressionError, parse_number

        try:
            value = parse_number(text)
        except ExpressionError as error:
            place = {"offset": error.offset, "width": error.width}
            self._fail("TC108", option, text, message=error.message, help=error.help, **place)
            return None
        if value <= 0:
            self._range(option, text, wanted, remedy)
        elif below is not None and value >= below:
            self._range(option, text, f"below {below}", f"< {below}")
        else:
            return value
        return None

    def gain(self, option: str, text: str | None) -> Fraction | None:
        """A positive number that is so moderate that what follows from it can be computed."""
        value = self.positive(option, text)
        if value is None or text is None or 10**-_MODERATE < value < 10**_MODERATE:
            return value
        self._range(
            option, text, "a gain that anything can have", f"between 1e-{_MODERATE} and 1e{_MODERATE}"
        )
        return None

    def count(
        self, option: str, text: str | None, *, wanted: str = "positive", remedy: str = "> 0"
    ) -> int | None:
        """A positive whole number; None if the option is absent or wrong (then `wanted` tells what is right)."""
        value = self.positive(option, text, wanted=wanted, remedy=remedy)
        if value is None or text is None:
            return None
        if value.denominator != 1:
            self._range(option, text, "a whole number", "without a fraction")
            return None
        return int(value)

    def whole(self, option: str, text: str | None) -> int | None:
        """A whole number, 0 or more; None if the option is absent or wrong."""
        if text is not None and text.strip() == "0":
            return 0
        return self.count(option, text, wanted="0 or more", remedy="that is 0 or more")

    def check(self) -> None:
        """Raises `SpecError` with every problem met so far."""
        if self.findings:
            raise SpecError(self.findings)

    def _range(self, option: str, text: str, wanted: str, remedy: str) -> None:
        shown = text if len(text) <= 40 else f"{text[:40]}..."
        self._fail("TC112", option, text, message=f"{shown} is not {wanted}", help=f"write a number {remedy}")

    def _fail(self, code: str, option: str, text: str, **what: Any) -> None:
        from tubecert.cli.places import OptionPlace
        from tubecert.findings import Finding

        column, width = what.pop("offset", 0) + 1, what.pop("width", len(text))
        place = OptionPlace(file=option, line=1, column=column, source=text, width=width)
        self.findings.append(Finding(code=code, location=place, **what))

"""Questions as commands: the signature of a function and its dictionary of words become options of typer.

A command is a function `f(how, **asked)` below `@command(words, ...)`: what is asked of the library has its words there
(`asking.words_of`), what the command writes has its own beside. Its numbers are exact, and all that is wrong is told.
"""

from __future__ import annotations

import inspect
import shlex
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Final, NamedTuple, TypeAlias

import typer

from tubecert.asking import Choice, Exact, Flag, Kind, Text, Words, asked_by, exact, flag, read
from tubecert.cli import keeper
from tubecert.cli.guard import guarded
from tubecert.errors import ExitCode, SpecError
from tubecert.printable import visible

Run: TypeAlias = Callable[..., ExitCode | None]


class Settings(Text):
    """Keys of the specification that are set."""

    def read(self, name: str, value: Any) -> Any:
        """The settings, exact; raises `SpecError` with everything that is wrong with them."""
        from tubecert.findings import Finding
        from tubecert.spec import Setting

        found, findings = list[Setting](), list[Finding]()
        for each in value:
            try:
                found.append(Setting.of(each))
            except SpecError as error:
                findings += error.findings
        if findings:
            raise SpecError(findings)
        return found


class Ending(Exact):
    """The seconds of a command that does not look at the time itself."""


SPEC: Final = Text("The specification (YAML).", "SPEC", place=True)
CERTIFICATE: Final = Text("A certificate (JSON).", "CERT", place=True)
SET: Final = Settings(
    "Set a key of the specification, e.g. tube.epsilon=0.3; may be repeated.", "KEY=VALUE", many=True
)
ENDING: Final = Ending("Seconds after which the command ends, with what it found until then.")
OUTPUT: Final[Words] = {
    "verbose": Flag("Also show the constants and all assumptions.", short="-v"),
    "quiet": Flag("Only the verdict.", short="-q"),
    "json": Flag("JSON on stdout instead of the report."),
    "color": Choice("When to colour (NO_COLOR is honoured).", words=("auto", "always", "never")),
    "no_progress": Flag("No progress on stderr."),
    "debug": Flag("Show the traceback of an internal error."),
}


class Said(NamedTuple):
    """What help says of the whole and of commands, and hints to words and options that mean something else."""

    tubecert: Mapping[str, str]
    commands: Mapping[str, Mapping[str, str]]
    gone: Mapping[str, str]
    options: Mapping[str, str]


@cache
def said() -> Said:
    """What help says beside the words of options."""
    return Said(**tomllib.loads((files("tubecert") / "pages" / "commands.toml").read_text(encoding="utf-8")))


def _version(wanted: bool) -> None:
    if wanted:
        from tubecert.release import __version__

        typer.echo(f"tubecert {__version__}")
        raise typer.Exit


_VERSION: Final = Annotated[
    bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """How to report: the options that commands share."""

    verbose: bool = False
    quiet: bool = False
    json: bool = False
    color: str | None = None
    no_progress: bool = False
    debug: bool = False

    @classmethod
    def of(cls, context: typer.Context, own: Output) -> Output:
        """The options given after the command (`own`) together with those given before it.

        Raises a usage error for `-q` with `-v`.
        """
        before = context.obj if isinstance(context.obj, cls) else cls()
        both = cls(**{name: getattr(own, name) or getattr(before, name) for name in OUTPUT})
        if both.quiet and both.verbose:
            raise typer.BadParameter("--quiet and --verbose exclude each other", ctx=context)
        return both


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command: what it does, its words, which of them are given together; `shared`: of `Output`."""

    run: Run
    words: Words
    pairs: tuple[tuple[str, str], ...]
    shared: Words

    def add(self, app: typer.Typer) -> None:
        """Makes it a command of the app, by its name."""
        name = self.run.__name__
        own = said().commands[name]
        made = with_options(self._ask, {**self.words, **self.shared}, version="quiet" in self.shared)
        made.__doc__ = self.run.__doc__
        app.command(name, epilog=own["after"], short_help=own["short"])(made)

    def _ask(self, context: typer.Context, **texts: Any) -> None:
        how = Output.of(context, Output(**{name: texts.pop(name) for name in self.shared}))
        words = shlex.join(["tubecert", *sys.argv[1:]])
        with guarded(how), asked_by(options=True, command=visible(words)):
            asked = read(self.words, texts, self.pairs)
            ending = next((name for name, kind in self.words.items() if isinstance(kind, Ending)), "")
            if seconds := exact(asked.pop(ending, None)):
                keeper.left_of(float(seconds), interrupted=True)
            with asked_by(words=self.words, given=asked):
                code = self.run(how, **asked)
        raise typer.Exit(code or ExitCode.CERTIFIED)


def command(
    words: Words, *pairs: tuple[str, str], shared: Sequence[str] = tuple(OUTPUT)
) -> Callable[[Run], Command]:
    """A function `run(how, **asked)` as a command; what its signature does not name has a default in its word."""

    def made(run: Run) -> Command:
        own = inspect.signature(run).parameters
        kinds = {
            name: replace(kind, default=own[name].default)
            if name in own and own[name].default is not inspect.Parameter.empty
            else kind
            for name, kind in words.items()
        }
        options = {name: OUTPUT[name] for name in shared}
        return Command(run=run, words=kinds, pairs=pairs, shared=options)

    return made


def with_options(run: Callable[..., None], words: Words, *, version: bool) -> Callable[..., None]:
    """A function that typer makes a command of: each word an option, or an argument; also `--version`."""

    def whole(context: typer.Context, **texts: Any) -> None:
        texts.pop("version", None)
        run(context, **texts)

    kind = inspect.Parameter.KEYWORD_ONLY
    parameters = [inspect.Parameter("context", kind, annotation=typer.Context)]
    parameters += [_parameter(name, word) for name, word in words.items()]
    if version:
        parameters += [inspect.Parameter("version", kind, annotation=_VERSION, default=False)]
    whole.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    whole.__annotations__ = {each.name: each.annotation for each in parameters}
    return whole


def _parameter(name: str, kind: Kind) -> inspect.Parameter:
    default, value = _typed(name, kind)
    metavar = f"<{'|'.join(kind.words)}>" if isinstance(kind, Choice) and not kind.place else kind.metavar
    names = filter(None, (flag(name), kind.short))
    option: Any = (
        typer.Argument(metavar=metavar, help=kind.help, show_default=False)
        if kind.place
        else typer.Option(*names, metavar=metavar, help=kind.help, case_sensitive=False)
    )
    required = kind.place and not kind.optional
    return inspect.Parameter(
        name,
        inspect.Parameter.KEYWORD_ONLY,
        annotation=Annotated[value if required or default is not None else value | None, option],
        default=inspect.Parameter.empty if required else default,
    )


def _typed(name: str, kind: Kind) -> tuple[Any, Any]:
    """The default and the type of an option: texts, but for flags and choices."""
    if isinstance(kind, Flag):
        return kind.default, bool
    if isinstance(kind, Choice):
        words: Any = StrEnum("Words", [(word, word) for word in kind.words])  # type: ignore[misc]
        return None if kind.default is None else words(kind.default), words
    if kind.many:
        return None, list[str]
    return None if kind.default is None else str(kind.default), str

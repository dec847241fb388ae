"""Questions as commands: the signature of a function and its dictionary of words become options of typer.

A command is the function of the library that has its name: what it gives is shown, by its page. One that does more is a
function `f(how, **asked)` below `@command(words, ...)` in a module of its own: what is asked of the library has its
words there (`asking.words_of`), what the command writes has its own beside. Numbers are exact, and all that is wrong is
told.
"""

from __future__ import annotations

import inspect
import shlex
import sys
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from importlib import import_module
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple, TypeAlias

import typer

from tubecert.asking import (
    Choice,
    Flag,
    Kind,
    Seconds,
    Words,
    asked_by,
    exact,
    flag,
    read,
    with_defaults,
    words_of,
)
from tubecert.cli import keeper
from tubecert.cli.guard import guarded
from tubecert.errors import ExitCode
from tubecert.printable import visible

Run: TypeAlias = Callable[..., ExitCode | None]
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
    pairs: Sequence[tuple[str, str]] = ()
    shared: Sequence[str] = tuple(OUTPUT)

    def add(self, app: typer.Typer, name: str) -> None:
        """Makes it a command of the app."""
        own, shared = said().commands[name], {each: OUTPUT[each] for each in self.shared}
        made = with_options(self._ask, {**self.words, **shared}, version="quiet" in shared)
        made.__doc__ = self.run.__doc__
        app.command(name, epilog=own["after"], short_help=own["short"])(made)

    def _ask(self, context: typer.Context, **texts: Any) -> None:
        how = Output.of(context, Output(**{name: texts.pop(name) for name in self.shared}))
        line = shlex.join(["tubecert", *sys.argv[1:]])
        with guarded(how), asked_by(options=True, command=visible(line)):
            asked = read(self.words, texts, self.pairs)
            for name, kind in self.words.items():
                if isinstance(kind, Seconds) and (seconds := exact(asked.pop(name, None))):
                    left = keeper.left_of(float(seconds), interrupted=kind.ends)
                    asked |= {} if kind.untold else {name: left}
                if kind.ending:
                    about = next(str(own) for key, own in asked.items() if self.words[key].place)
                    asked.setdefault(name, f"{Path(about).stem}{kind.ending}")
            with asked_by(words=self.words, given=asked):
                code = self.run(how, **asked)
        raise typer.Exit(code or ExitCode.CERTIFIED)


def command(
    words: Words, *pairs: tuple[str, str], shared: Sequence[str] = tuple(OUTPUT)
) -> Callable[[Run], Command]:
    """A function `run(how, **asked)` as a command; what its signature does not name has a default in its word."""

    def made(run: Run) -> Command:
        kinds = with_defaults(words, inspect.signature(run))
        return Command(run=run, words=kinds, pairs=pairs, shared=shared)

    return made


def command_of(name: str) -> Command:
    """The command of a name: of its module, else what the library gives, shown."""
    module = f"tubecert.cli.{said().commands[name].get('module', name)}"
    if find_spec(module) is not None:
        found: Command = getattr(import_module(module), name)
        return found
    function = getattr(import_module("tubecert"), name)

    def run(how: Output, **asked: Any) -> ExitCode:
        from tubecert.cli.telling import answered

        return answered(how, function, asked)

    run.__doc__ = str(inspect.getdoc(function)).partition("\n\n")[0]
    return Command(run=run, words=words_of(function), pairs=function.pairs)


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
    default, value = _typed(kind)
    metavar = f"<{'|'.join(kind.words)}>" if isinstance(kind, Choice) and not kind.place else kind.metavar
    names = filter(None, (kind.called or flag(name), kind.short))
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


def _typed(kind: Kind) -> tuple[Any, Any]:
    """The default and the type of an option: texts, but for flags and choices."""
    if isinstance(kind, Flag):
        return kind.default, bool
    if isinstance(kind, Choice):
        words: Any = StrEnum("Words", [(word, word) for word in kind.words])  # type: ignore[misc]
        return None if kind.default is None else words(kind.default), words
    if kind.many:
        return None, list[str]
    return None if kind.default is None else str(kind.default), str

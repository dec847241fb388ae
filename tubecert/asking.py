"""What is asked of a function of the library, or of the command of its name: one signature, one dictionary of words.

In: values of Python, or the texts of a command line. Out: exact numbers, known words, texts; every problem is told at
once, and is located at `rho_a`, or at `--rho-a` where a command asks. A kind says what an argument is: its words for
the command line (`cli.adapter` makes options of them), and what is read. Trusted: no.
"""

from __future__ import annotations

import functools
import importlib.util
import inspect
import numbers
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import KW_ONLY, dataclass, field, replace
from decimal import Decimal
from fractions import Fraction
from math import isnan
from typing import Any, Final, NoReturn, ParamSpec, SupportsFloat, TypeAlias, TypeVar

from tubecert.errors import SpecError
from tubecert.findings import Finding, NamedPlace

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
Number: TypeAlias = str | SupportsFloat
"""A text, an int, a Fraction, a Decimal, a number of numpy or sympy: exact; a float is its shortest decimal."""
METRIC: Final = "a certificate with a metric"
SEARCH: Final = "a long search"
_MODERATE: Final = 60  # powers of ten: the conditions hold products of gains, and floats end at 1e308
_LARGEST: Final = 10**4000  # what has more digits is refused by Python, and by the reader
_SHOWN: Final = 40


@dataclass(frozen=True)
class Kind:
    """What an argument is, here anything: its `help` and how its value is written (`metavar`), for the command line.

    `sets`: the key of the specification that it says. `of`: what it is about, if it means nothing where a specification
    has `hardware`. `called`: its option, if that is not its name, and `short`: of one letter. `many`: it may be given
    several times. `place`: it is no option, but known by its place, and may be `optional` there. `ending`: of a name
    that a command makes of what it is about, if none is given.
    """

    help: str
    metavar: str | None = None
    _: KW_ONLY
    sets: str = ""
    of: str = ""
    called: str = ""
    short: str = ""
    many: bool = False
    place: bool = False
    optional: bool = False
    ending: str = ""
    default: Any = None

    def read(self, name: str, value: Any) -> Any:
        """The value as it is used, of an argument that is called `name`; raises `SpecError`."""
        return value


@dataclass(frozen=True)
class Exact(Kind):
    """A positive number as a `Fraction`, or a whole one as an int.

    `least`: 0 where nought is a number, too; `most`: it is not exceeded; `below`: it is not reached. `moderate`: what
    follows from it can be computed. `word` may stand for it.
    """

    metavar: str | None = "NUMBER"
    _: KW_ONLY
    whole: bool = False
    least: int | None = None
    most: int | None = None
    below: int | None = None
    moderate: bool = False
    word: str = ""

    def read(self, name: str, value: Any) -> Fraction | int | str:
        """The number, or the word."""
        from tubecert.expression import ExpressionError, parse_number

        text = text_of_number(value, name)
        if self.word and text == self.word:
            return text
        try:
            number = parse_number(text)
        except ExpressionError as error:
            help = f"{error.help}, or {self.word}" if self.word else error.help
            found = _finding(name, text, error.message, help, code="TC108", at=(error.offset, error.width))
            raise SpecError([found]) from None
        for wrong, message, help in self._limits(number):
            if wrong:
                cut = text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
                refuse(name, text, f"{cut} is not {message}", f"write a number {help}")
        return int(number) if self.whole else number

    def _limits(self, number: Fraction) -> Iterator[tuple[bool, str, str]]:
        """What it must be: whether it is not, in words, and what to write."""
        if self.least is None:
            yield number <= 0, "positive", "> 0"
        else:
            yield number < self.least, f"{self.least} or more", f"that is {self.least} or more"
        if self.most is not None:
            yield number > self.most, f"at most {self.most}", f"<= {self.most}"
        if self.below is not None:
            yield number >= self.below, f"below {self.below}", f"< {self.below}"
        if self.whole:
            yield number.denominator != 1, "a whole number", "without a fraction"
        if self.moderate:
            limit = 10**_MODERATE
            within = f"between 1e-{_MODERATE} and 1e{_MODERATE}"
            yield not 1 / Fraction(limit) < number < limit, "a gain that anything can have", within


@dataclass(frozen=True)
class Seconds(Exact):
    """How long a command may take, of which a function is told what is left.

    `ends`: the command is ended then, whatever it does; `untold`: the function does not know.
    """

    _: KW_ONLY
    ends: bool = False
    untold: bool = False


@dataclass(frozen=True)
class Choice(Kind):
    """One of the `words`; a command shows them."""

    _: KW_ONLY
    words: tuple[str, ...] = ()

    def read(self, name: str, value: Any) -> str:
        """The word."""
        from tubecert.expression import suggestion

        word = next((own for own in self.words if own.lower() == str(value).lower()), str(value))
        if word not in self.words:
            known = suggestion(word, self.words, what="choices")
            refuse(name, word, f"{name} is {word[:60]!r}; {known}")
        return word


@dataclass(frozen=True)
class Text(Kind):
    """A text, or the name of a file or a folder."""

    def read(self, name: str, value: Any) -> str | list[str]:
        """The text; several as a list."""
        return [text_of(name, each) for each in value] if self.many else text_of(name, value)


@dataclass(frozen=True)
class Settings(Kind):
    """Keys of the specification that are set, as texts, as settings, or as a mapping."""

    def read(self, name: str, value: Any) -> Any:
        """The settings, exact; raises `SpecError` with everything that is wrong with them."""
        from tubecert.spec import Setting

        if isinstance(value, Mapping):
            return value
        items = value if isinstance(value, Iterable) and not isinstance(value, str) else [value]
        place = self.called if asker().options else name
        return each_of(items, lambda x: x if isinstance(x, Setting) else Setting.of(text_of(name, x), place))


@dataclass(frozen=True)
class Names(Kind):
    """Words that are separated by commas, or a sequence of them; if `words` are known, each of a kind (`what`)."""

    _: KW_ONLY
    words: tuple[str, ...] = ()
    what: str = ""

    def read(self, name: str, value: Any) -> tuple[str, ...]:
        """The words, each once, in their order."""
        from tubecert.expression import suggestion

        if not isinstance(value, (str, Iterable)):
            refuse(name, str(value), f"{shown(value)} is no list of names")
        parts = value.split(",") if isinstance(value, str) else map(str, value)
        found = tuple(dict.fromkeys(word.strip() for word in parts if word.strip()))
        for word in found if self.words else ():
            if word not in self.words:
                help = suggestion(word, self.words, what=f"{self.what}s")
                refuse(name, ",".join(found), f"{word[:40]!r} is no {self.what}", help)
        return found


@dataclass(frozen=True)
class Flag(Kind):
    """Whether something is wanted."""

    default: bool = False

    def read(self, name: str, value: Any) -> bool:
        """True or False."""
        return bool(value)


Words: TypeAlias = Mapping[str, Kind]
SPEC: Final = Kind("The specification (YAML).", "SPEC", place=True)
CERTIFICATE: Final = Kind("A certificate (JSON).", "CERT", place=True)
SETTINGS: Final = Settings(
    "Set a key of the specification, e.g. tube.epsilon=0.3; may be repeated.",
    "KEY=VALUE",
    called="--set",
    many=True,
)
ENDING: Final = Seconds(
    "Seconds after which the command ends, with what it found until then.", ends=True, untold=True
)


@dataclass(frozen=True, kw_only=True)
class Asker:
    """Who asks: whether by options of a command, and which one (as it is noted in certificates).

    `words` and `given` are the kinds of what is asked, and the values.
    """

    options: bool = False
    command: str = ""
    words: Words = field(default_factory=dict)
    given: Mapping[str, object] = field(default_factory=dict)


def hears(progress: object, of: str) -> Callable[[Any], None] | None:
    """What a callback of progress hears of beside steps, if it does.

    `found`: a line about what is found on the way; `kept`: all that a search has so far; `judged`: its verdict, before
    advice is looked for.
    """
    heard: Callable[[Any], None] | None = getattr(progress, of, None)
    return heard


_CODE: Final = Asker()
_ASKER: Final[ContextVar[Asker]] = ContextVar("asker")


def asker() -> Asker:
    """Who asks."""
    return _ASKER.get(_CODE)


@contextmanager
def asked_by(**who: Any) -> Iterator[None]:
    """Within the block that is who asks, or what else is known of who asks anyway."""
    token = _ASKER.set(replace(asker(), **who))
    try:
        yield
    finally:
        _ASKER.reset(token)


def flag(name: str) -> str:
    """The option of an argument."""
    return f"--{name.rstrip('_').replace('_', '-')}"


def named(name: str) -> str:
    """What who asks calls an argument."""
    return flag(name) if asker().options else name


def question(words: Words, *pairs: tuple[str, str]) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A function whose arguments are read by their kinds before it is called; `pairs` are given together or not at all.

    What it is called with raises `SpecError` with everything that is wrong.
    """

    def asks(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)
        kinds = with_defaults(words, signature)

        @functools.wraps(function)
        def ask(*values: P.args, **options: P.kwargs) -> R:
            try:
                bound = signature.bind(*values, **options)
            except TypeError as error:
                known = ", ".join(signature.parameters)
                raise TypeError(f"{function.__name__}() {error}; it takes {known}") from None
            bound.apply_defaults()
            bound.arguments |= read(kinds, bound.arguments, pairs)
            progress = bound.arguments.get("progress")
            if progress is not None and not callable(progress):
                refuse("progress", "", f"{shown(progress)} cannot be called with steps", code="TC106")
            with asked_by(words=kinds, given=bound.arguments):
                return function(*bound.args, **bound.kwargs)

        ask.words, ask.pairs = kinds, pairs  # type: ignore[attr-defined]
        return ask

    return asks


def with_defaults(words: Words, signature: inspect.Signature) -> dict[str, Kind]:
    """The kinds with the defaults of a signature; what it does not name keeps its own."""
    given = {name: own.default for name, own in signature.parameters.items() if own.default is not own.empty}
    return {name: replace(kind, default=given.get(name, kind.default)) for name, kind in words.items()}


def words_of(function: Callable[..., Any]) -> dict[str, Kind]:
    """The kinds of the arguments of a question."""
    found: dict[str, Kind] = function.words  # type: ignore[attr-defined]
    return found


def read(
    words: Words, given: Mapping[str, object], pairs: Iterable[tuple[str, str]] = ()
) -> dict[str, object]:
    """The values of those that are given; raises `SpecError` with everything that is wrong with them."""
    found: dict[str, object] = {}
    findings: list[Finding] = []
    for name, kind in words.items():
        try:
            if given.get(name) is not None:
                found[name] = kind.read(named(name), given[name])
        except SpecError as error:
            findings += error.findings
    for pair in pairs:
        missing = [name for name in pair if given.get(name) is None]
        if len(missing) == 1:
            (there,) = {*pair} - {*missing}
            message = f"{named(*missing)} is missing beside {named(there)}"
            findings.append(_finding(named(there), str(given[there]), message, "give both, or neither"))
    if findings:
        raise SpecError(findings)
    return found


def each_of(items: Iterable[T], read_one: Callable[[T], R]) -> list[R]:
    """What is read of every item; raises `SpecError` with everything that is wrong with them."""
    found, findings = list[R](), list[Finding]()
    for item in items:
        try:
            found.append(read_one(item))
        except SpecError as error:
            findings += error.findings
    if findings:
        raise SpecError(findings)
    return found


def exact(value: object) -> Fraction | None:
    """A number that was read by its kind."""
    assert value is None or isinstance(value, Fraction)
    return value


def require_nothing_of_a_metric() -> None:
    """Raises `SpecError` for everything asked that means nothing where a specification has `hardware`."""
    findings = [
        _finding(
            named(name),
            "",
            f"{named(name)} is about {kind.of}; the sampled loop is proven without",
            f"leave {named(name)} out, or leave hardware out of the specification",
        )
        for name, kind in asker().words.items()
        if kind.of and str(asker().given.get(name)) not in ("None", str(kind.default))
    ]
    if findings:
        raise SpecError(findings)


def require_installed(library: str, extra: str, what: str) -> None:
    """Raises `SpecError` without a library that only an extra of tubecert brings, and that something needs."""
    if importlib.util.find_spec(library) is None:
        help = f"install tubecert with its extra: pip install 'tubecert[{extra}]'"
        raise SpecError([Finding(code="TC122", message=f"{what} {library}", help=help)])


def refuse(name: str, text: str, message: str, help: str = "", *, code: str = "TC112") -> NoReturn:
    """Raises the `SpecError` about the value of an argument."""
    raise SpecError([_finding(name, text, message, help, code=code)])


def _finding(
    name: str, text: str, message: str, help: str, *, code: str = "TC112", at: Sequence[int] = ()
) -> Finding:
    offset, width = at or (0, len(text))
    place = NamedPlace(file=name, line=1, column=offset + 1, source=text, width=width)
    return Finding(code=code, message=message, location=place, help=help)


def text_of(name: str, value: Any) -> str:
    """A text, or a path as one; raises `SpecError` for what is none."""
    if not isinstance(value, (str, os.PathLike)):
        refuse(name, "", f"{shown(value)} is no text and no path", code="TC106")
    return os.fspath(value)


def text_of_number(value: Any, name: str) -> str:
    """A number as it is written; raises `SpecError` for what is none."""
    text = value if isinstance(value, str) else plain_number(value)
    if text is None:
        help = "give an int, a float, a Fraction, a Decimal or a text"
        refuse(name, "", f"{shown(value)} is no number", help, code="TC106")
    return text


def plain_number(value: object) -> str | None:
    """Its exact text, of whatever library it is; a float's is the shortest that is read as the same float."""
    if isinstance(value, Decimal):
        return str(value)
    if isinstance(value, numbers.Rational) and not isinstance(value, bool):
        ratio = Fraction(int(value.numerator), int(value.denominator))
        return str(ratio) if max(abs(ratio.numerator), ratio.denominator) < _LARGEST else None
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        near = float(value)
        return repr(near) if near == value or isnan(near) else None
    return None


def shown(value: object) -> str:
    """A value that has no place where it stands, in a sentence."""
    try:
        text = repr(value)[:60]
    except ValueError:  # more digits than Python writes
        text = "a number"
    return f"{text} ({type(value).__name__})"

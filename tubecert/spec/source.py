"""The text of a specification, read within limits and addressed by line and column."""

from __future__ import annotations

import re
from bisect import bisect_right
from dataclasses import dataclass, field
from typing import Final, NoReturn

from tubecert.errors import SpecError, TargetError
from tubecert.files import Kind, read
from tubecert.findings import Finding, Location
from tubecert.printable import blanked
from tubecert.spec import codes

MAX_BYTES: Final = 1_000_000

_CODES = {"unreadable": codes.UNREADABLE, "too_large": codes.LIMIT}
SPECIFICATION: Final = Kind(most=MAX_BYTES, **_CODES, help="give the path of a specification (a YAML file)")
METRIC: Final = Kind(
    most=MAX_BYTES, **_CODES, help="give the path of a metric file (tubecert synth writes them)"
)
PLAN: Final = Kind(most=10_000_000, **_CODES)

_BREAK = re.compile(r"\r\n|\r|\n")
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ud800-\udfff\ufeff\ufffe\uffff]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """A place in a text; line and column count from 0."""

    line: int
    column: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """A file's name and text; `lines` are for display (nothing in them steers a terminal), `place` names them."""

    file: str
    text: str
    lines: tuple[str, ...] = field(repr=False)
    starts: tuple[int, ...] = field(repr=False)
    place: type[Location] = Location

    @classmethod
    def of(cls, file: str, text: str, place: type[Location] = Location) -> Source:
        """The source with its lines found."""
        starts = (0, *(match.end() for match in _BREAK.finditer(text)))
        lines = tuple(blanked(line) for line in _BREAK.split(text))
        return cls(file=file, text=text, lines=lines, starts=starts, place=place)

    def location(self, mark: Mark, width: int = 1) -> Location:
        """The place as a finding names it."""
        number = min(mark.line, len(self.lines) - 1)  # the end of a text may be called its next line
        line = self.lines[number]
        column = min(mark.column, len(line)) if number == mark.line else len(line)
        return self.place(
            file=self.file, line=number + 1, column=column + 1, source=line, width=max(1, width)
        )

    def index(self, mark: Mark) -> int:
        """Position of the mark in the text."""
        if mark.line >= len(self.starts):
            return len(self.text)
        return min(self.starts[mark.line] + mark.column, len(self.text))

    def mark(self, index: int) -> Mark:
        """The mark of a position in the text."""
        line = bisect_right(self.starts, index) - 1
        return Mark(line=line, column=index - self.starts[line])


def read_source(path: str, kind: Kind = SPECIFICATION) -> Source:
    """The file's text; raises `TargetError` if it cannot be read or is too large, `SpecError` if it is no text."""
    if path == "-":
        finding = Finding(
            code=codes.UNREADABLE,
            message="- is no file: nothing is read from stdin",
            help="write it to a file first; its name is part of the reports",
        )
        raise TargetError([finding])
    return decoded(path, read(path, kind))


def decoded(path: str, data: bytes) -> Source:
    """The bytes as text."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = Source.of(path, data[: error.start].decode("utf-8", "replace"))
        _refuse(before, len(before.text), codes.UNREADABLE, "the file is not UTF-8", "save it as UTF-8")
    return Source.of(path, text)


def check_limits(source: Source) -> None:
    """Raises `SpecError` for what no YAML parser should see: size and control characters."""
    if len(source.text) > MAX_BYTES:
        _refuse(source, 0, codes.LIMIT, f"the text is larger than {MAX_BYTES:,} bytes")
    if match := _CONTROL.search(source.text):
        name = f"U+{ord(match.group()):04X}"
        _refuse(source, match.start(), codes.YAML_SYNTAX, f"the character {name} is not allowed", "remove it")


def _refuse(source: Source, index: int, code: str, message: str, help: str = "") -> NoReturn:
    location = source.location(source.mark(index))
    raise SpecError([Finding(code=code, message=message, location=location, help=help)])

"""What shows itself: in a line, and as a card in notebooks; and what it must not be written over."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Final, TypeVar

from tubecert.asking import asker, text_of
from tubecert.certificate.file import KIND, STDOUT, same_file, write_text
from tubecert.errors import ExitCode, SpecError, TargetError, TubecertError
from tubecert.expression import suggestion
from tubecert.files import read
from tubecert.findings import Finding
from tubecert.printable import visible
from tubecert.report import html, markdown
from tubecert.report.page import Page
from tubecert.report.text import Rows, headline

T = TypeVar("T")

# of what is written: how its text begins, else the keys that it has as JSON
_BEGINS: Final = {"html": "<!DOCTYPE html>", "markdown": "#", "csv": "quantity,"}
_KEYS: Final = {
    "certificate": {"format", "hash", "result"},
    "metric file": {"format", "solver", "verified_on"},
    "json": {"certificates", "quantities", "differences"},
}


class UnknownNameError(SpecError, KeyError):
    """A name that there is not: an error of tubecert, and that of a mapping."""

    __str__ = Exception.__str__


class Known(dict[str, T]):
    """Values by name, which tells the names where there is no such one."""

    def __missing__(self, name: str) -> T:
        help = suggestion(str(name), self, what="there are") if self else "there is none"
        message = f"there is nothing called {visible(str(name))[:60]!r}"
        raise UnknownNameError([Finding(code="TC112", message=message, help=help)])


def refused(message: str, help: str = "choose another file with -o FILE") -> TargetError:
    """The error about a file that is not written."""
    return TargetError([Finding(code="TC120", message=message, help=help)])


def spare(
    target: str,
    what: str = "",
    inputs: Mapping[str, str | Path | None] = {},
    help: str = "",
) -> None:
    """Raise `TargetError` for a target that would take the place of an input, or of what is no `what` of tubecert.

    `inputs` are named by what they are. An older file of the same form is replaced.
    """
    if target == STDOUT:
        return
    help = help or ("choose another file with -o FILE" if asker().options else "choose another file")
    for name, source in inputs.items():
        if source is not None and (
            os.path.abspath(source) == os.path.abspath(target) or same_file(target, source)
        ):
            raise refused(f"{visible(target)} is the {name} itself and would be overwritten", help)
    if what and Path(target).is_file() and not _written_as(what, target):
        raise refused(f"{visible(target)} is no {what} that tubecert wrote, and would be overwritten", help)


def _written_as(what: str, path: str) -> bool:
    """Whether tubecert writes files like this one, which may be empty, as a `what`."""
    try:
        text = read(path, KIND).decode().lstrip()
        if what in _BEGINS or not text:
            return not text or text.startswith(_BEGINS[what])
        content = json.loads(text)
    except (TubecertError, ValueError, RecursionError):
        return False
    return isinstance(content, dict) and _KEYS[what] <= content.keys()


class Shown:
    """What shows itself by its page: in a line, as a card in notebooks, and as the answer of a command.

    `alone`: its JSON says the verdict itself, and stands without its line.
    """

    __slots__ = ()
    alone: ClassVar[bool] = False

    @property
    def _exit_code(self) -> ExitCode:
        return ExitCode.CERTIFIED

    def _page(self) -> Page:
        raise NotImplementedError

    def _closing(self) -> Rows:
        """What was written, and the commands that come next: each with its heading."""
        return ()

    def _json(self) -> str:
        raise NotImplementedError

    def __str__(self) -> str:
        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())


class Paged(Shown):
    """What is kept as a page.

    `forms`: by the ending of a file's name what it holds; `known`: these in words, and `remedy`: what to do instead.
    """

    __slots__ = ()
    forms: ClassVar[Mapping[str, str]] = {
        ".html": "html", ".htm": "html", ".md": "markdown", ".markdown": "markdown",
    }  # fmt: skip
    known: ClassVar[str] = "a page is HTML or Markdown"
    remedy: ClassVar[str] = "give a file FILE.html or FILE.md in a folder that exists"

    @property
    def html(self) -> str:
        """The page as one HTML file that needs nothing else."""
        return html.render_page(self._page())

    @property
    def markdown(self) -> str:
        """The same words and tables as Markdown, without figures: for a pull request."""
        return markdown.render_page(self._page())

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write it, by the ending of the name. Raises `TargetError`."""
        target = text_of("path", path)
        form = self.form_of(target)
        spare(target, form)
        write_text(target, getattr(self, form), self.remedy)

    @classmethod
    def form_of(cls, target: str) -> str:
        """What a file of this name holds; raises `TargetError` for a name by which it cannot be written."""
        ending = os.path.splitext(target)[1].lower()
        if ending not in cls.forms:
            raise refused(f"cannot write {target}: {cls.known}", cls.remedy)
        return cls.forms[ending]

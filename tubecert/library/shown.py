"""What shows itself: in a line, and as a card in notebooks."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import ClassVar, TypeVar

from tubecert.asking import text_of
from tubecert.certificate.file import OTHER, refused, spare, write_text
from tubecert.errors import ExitCode, SpecError
from tubecert.expression import suggestion
from tubecert.findings import Finding
from tubecert.printable import visible
from tubecert.report import html, markdown
from tubecert.report.page import Page
from tubecert.report.text import Rows, headline

T = TypeVar("T")


class UnknownNameError(SpecError, KeyError):
    """A name that there is not: an error of tubecert, and that of a mapping."""

    __str__ = Exception.__str__  # that of KeyError shows the quoted text


class Known(dict[str, T]):
    """Values by name; for a name that is none it raises an error that tells those that there are."""

    def __missing__(self, name: str) -> T:
        help = suggestion(str(name), self, what="there are") if self else "there is none"
        message = f"there is nothing called {visible(str(name))[:60]!r}"
        raise UnknownNameError([Finding(code="TC112", message=message, help=help)])


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
        spare(target, form, help=OTHER)
        write_text(target, getattr(self, form), self.remedy)

    @classmethod
    def form_of(cls, target: str) -> str:
        """What a file of this name holds; raises `TargetError` for a name by which it cannot be written."""
        ending = os.path.splitext(target)[1].lower()
        if ending not in cls.forms:
            raise refused(f"cannot write {target}: {cls.known}", cls.remedy)
        return cls.forms[ending]

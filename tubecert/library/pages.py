"""A certificate as a page, from code and for the command: HTML with figures, or Markdown."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from html import escape
from typing import Final

from tubecert.certificate.file import write_text
from tubecert.certificate.result import Certificate
from tubecert.errors import TargetError
from tubecert.findings import Finding
from tubecert.library.certification import Certification, read
from tubecert.library.specification import File

HTML, MARKDOWN = (".html", ".htm"), (".md", ".markdown")
REMEDY: Final = "give a file FILE.html or FILE.md in a folder that exists"


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """The page of a certificate; the same for the same certificate."""

    certificate: Certificate = field(repr=False)

    @property
    def html(self) -> str:
        """The page as one HTML file that needs nothing else."""
        from tubecert.report import html

        return html.render(self.certificate)

    @property
    def markdown(self) -> str:
        """The same words and tables as Markdown, without figures."""
        from tubecert.report import markdown

        return markdown.render(self.certificate)

    def save(self, path: File) -> None:
        """Write the page: FILE.html or FILE.md. Raises `TargetError`."""
        target = os.fspath(path)
        require_page(target)
        text = self.markdown if _suffix(target) in MARKDOWN else self.html
        write_text(target, text, REMEDY)

    def _repr_html_(self) -> str:
        """The page in a frame of its own: its style touches nothing around it."""
        style = "width: 100%; height: 45em; border: 1px solid #8884"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}" title="tubecert certificate"></iframe>'


def report(result: Certification | File) -> Report:
    """The page of a certificate, or of the file of one: `tubecert report`. Raises `TargetError`."""
    found = result if isinstance(result, Certification) else read(result)
    return Report(certificate=found.certificate)


def require_page(target: str) -> None:
    """Raises `TargetError` for a name that is none of a page."""
    if _suffix(target) not in (*HTML, *MARKDOWN):
        message = f"cannot write {target}: a page is HTML or Markdown"
        raise TargetError([Finding(code="TC120", message=message, help=REMEDY)])


def _suffix(target: str) -> str:
    return os.path.splitext(target)[1].lower()

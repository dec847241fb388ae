"""A page as Markdown: the tables and the words, for reviews and wikis; figures are left to the HTML page."""

from __future__ import annotations

import re
from collections.abc import Iterable

from tubecert.printable import visible
from tubecert.report.html import environment
from tubecert.report.page import Page, typeset

_SPECIAL = re.compile(r"[\\`*_\[\]<>|~&$]|(?<=\w):(?=//)|(?<=www)\.")
# of a heading, a list, the line below a heading
_AT_START = re.compile(r"(?:#{1,6}|[-+]|\d{1,9}[.)])(?=\s|$)|[-=]+$")


def render_page(page: Page) -> str:
    """The text of a page; nothing of a section that has figures only."""
    told = environment().get_template("page.md").render(page=page, md=escape, fenced=_fenced, joined=_joined)
    return told.rstrip() + "\n"


def escape(text: str) -> str:
    """A text that Markdown shows as it is, on one line."""
    flat = _SPECIAL.sub(r"\\\g<0>", visible(" ".join(typeset(text).split())))
    start = _AT_START.match(flat)
    return flat if start is None else f"{flat[: start.end() - 1]}\\{flat[start.end() - 1 :]}"


def _joined(cells: Iterable[str]) -> str:
    return " | ".join(map(escape, cells))


def _fenced(text: str) -> str:
    """Preformatted lines, between fences that none of them can end."""
    longest = max((len(ticks) for ticks in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    return "\n".join((fence, *map(visible, text.split("\n")), fence))

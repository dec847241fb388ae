"""A page as Markdown: the tables and the words, for reviews and wikis; figures are left to the HTML page."""

from __future__ import annotations

import re
from collections.abc import Iterator

from tubecert.printable import visible
from tubecert.report.page import (
    Block,
    Cell,
    Facts,
    Items,
    Listing,
    Page,
    Reason,
    Section,
    Table,
    Words,
    typeset,
)

_SPECIAL = re.compile(r"[\\`*_\[\]<>|~&$]|(?<=\w):(?=//)|(?<=www)\.")
_AT_START = re.compile(
    r"(?:#{1,6}|[-+]|\d{1,9}[.)])(?=\s|$)|[-=]+$"
)  # of a heading, a list, the line below a heading


def render_page(page: Page) -> str:
    """The text of a page."""
    return "\n".join(_lines(page)).rstrip() + "\n"


def _lines(page: Page) -> Iterator[str]:
    yield f"# {escape(page.name)}: {escape(page.verdict or page.about)}"
    yield ""
    yield f"**{escape(page.summary)}**"
    yield ""
    yield escape(f"{page.meaning} {page.caveat}".rstrip())
    for section in page.sections:
        yield from _section(section)


def _section(section: Section) -> Iterator[str]:
    """Nothing of a section that has figures only."""
    shown = [lines for block in section.blocks if (lines := list(_block(block)))]
    for lines in ([f"## {escape(section.title)}"], *shown) if shown else ():
        yield ""
        yield from lines


def _block(block: Block) -> Iterator[str]:
    match block:
        case Words():
            yield escape(block.text)
        case Items():
            if block.title:
                yield from (f"### {escape(block.title)}", "")
            yield from (f"- {escape(item)}" for item in block.items)
        case Facts():
            yield from (f"- {escape(name)}: {_cell(cell)}" for name, cell in block.facts)
        case Table():
            yield from _table(block)
        case Listing():
            yield from _fenced(block.text)
        case Reason():
            yield from _reason(block)


def _table(table: Table) -> Iterator[str]:
    yield _row(escape(column) for column in table.columns)
    kinds = (row[0] for row in zip(*table.rows, strict=True)) if table.rows else ()
    yield _row("---:" if cell.kind == "number" else "---" for cell in kinds)
    yield from (_row(_cell(cell) for cell in row) for row in table.rows)
    if table.note:
        yield from ("", escape(table.note))


def _row(cells: Iterator[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(cell: Cell) -> str:
    text = escape(cell.text)
    return f"{text}, {escape(cell.note)}" if cell.note else text


def _reason(reason: Reason) -> Iterator[str]:
    yield f"- **{escape(reason.verdict)}** {escape(reason.claim)}: {escape(reason.message)}"
    if reason.at:
        yield f"  at {escape(reason.at)}"
    if reason.relax:
        yield f"  help: {escape(reason.relax)}"


def escape(text: str) -> str:
    """A text that Markdown shows as it is, on one line."""
    flat = _SPECIAL.sub(r"\\\g<0>", visible(" ".join(typeset(text).split())))
    start = _AT_START.match(flat)
    return flat if start is None else f"{flat[: start.end() - 1]}\\{flat[start.end() - 1 :]}"


def _fenced(text: str) -> Iterator[str]:
    """Preformatted lines, between fences that none of them can end."""
    longest = max((len(ticks) for ticks in re.findall(r"`+", text)), default=0)
    fence = "`" * max(3, longest + 1)
    yield from (fence, *map(visible, text.split("\n")), fence)

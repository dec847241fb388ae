"""What a value of the library looks like in a notebook: a card with its verdict, a sentence, and what is seen first.

In: pages. Out: HTML that stands for itself. The template escapes every text.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tubecert.certificate.effective import Effective
from tubecert.report.html import environment
from tubecert.report.page import Block, Cell, Facts, Page, Reason, Section, Table, Words
from tubecert.report.page_origin import equations

_MOST = 15  # rows of a table


def of_page(page: Page) -> str:
    """The card of a page: what it says, and its first section."""
    tables = list(_tables(page.sections[0].blocks))
    return environment().get_template("card.html").render(page=page, tables=tables)


def specification(effective: Effective) -> str:
    """The card of a specification: its equations and its safe set."""
    box = effective.part("safe_set")
    sides = ", ".join(f"{name} in [{', '.join(map(str, side))}]" for name, side in box.items())
    rows = [*((Cell(text=line, kind="code"),) for line in equations(effective)), (Cell(text=sides),)]
    system = Section(key="system", title="System", blocks=(Table(columns=("",), rows=tuple(rows)),))
    page = Page(
        name=effective.name,
        verdict="",
        about="specification",
        summary="equations, safe set",
        sections=(system,),
    )
    return of_page(page)


def _tables(blocks: Sequence[Block]) -> Iterator[Table]:
    """Blocks as tables, as far as they are of words."""
    for block in blocks:
        match block:
            case Table():
                left = len(block.rows) - _MOST
                yield Table(
                    columns=block.columns,
                    rows=block.rows[:_MOST],
                    note=f"{left} more" if left > 0 else block.note,
                )
            case Facts():
                rows = ((Cell(text=name), cell) for name, cell in block.facts)
                yield Table(columns=("", ""), rows=tuple(rows))
            case Reason():
                told = Cell(text=block.message, note=f"help: {block.relax}" if block.relax else "")
                yield Table(columns=("", ""), rows=((Cell(text=block.claim), told),))
            case Words():
                yield Table(columns=("",), rows=((Cell(text=block.text),),))

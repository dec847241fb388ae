"""What a value of the library looks like in a notebook: a card with its verdict, a sentence, and a table or two.

In: pages, canonical specifications, verdict lines. Out: HTML that stands for itself. The template escapes every
text.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tubecert.certificate.effective import Effective
from tubecert.findings import Finding, Severity
from tubecert.printable import visible
from tubecert.report.findings import summary
from tubecert.report.html import environment
from tubecert.report.page import Block, Cell, Facts, Page, Reason, Table
from tubecert.report.page_origin import equations
from tubecert.verdict import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """A verdict (`style` is how it looks), what it is about, a sentence, and tables."""

    verdict: str
    name: str
    style: str = ""
    summary: str = ""
    meaning: str = ""
    tables: Sequence[Table] = ()


def render(card: Card) -> str:
    """The card as HTML."""
    return environment().get_template("card.html").render(card=card)


def of_line(line: str, name: str, style: str, details: Sequence[tuple[str, str]] = ()) -> str:
    """The card of a verdict line (`certified NAME: what follows`), with names and values below it."""
    verdict, _, summary = line.partition(f" {visible(name)}: ")
    rows = tuple((Cell(text=what), Cell(text=value)) for what, value in details)
    tables = [Table(columns=("", ""), rows=rows)] if rows else []
    return render(Card(verdict=verdict, name=name, style=style, summary=summary, tables=tables))


def specification(effective: Effective) -> str:
    """The card of a specification: its equations and its safe set."""
    rows = [(Cell(text=line, kind="code"),) for line in equations(effective)]
    box = effective.part("safe_set")
    sides = ", ".join(f"{name} in [{', '.join(map(str, side))}]" for name, side in box.items())
    rows.append((Cell(text=f"safe set: {sides}"),))
    return render(
        Card(
            verdict="specification",
            name=effective.name,
            tables=[Table(columns=("",), rows=tuple(rows))],
        )
    )


def findings(name: str, found: Sequence[Finding]) -> str:
    """The card of a check: every finding with its place, and how many there are."""
    style = Verdict.UNDECIDED if any(item.severity is not Severity.NOTE for item in found) else ""
    rows = tuple((Cell(text=str(item.severity)), Cell(text=item.message, note=item.help)) for item in found)
    tables = [Table(columns=("", ""), rows=rows)] if rows else []
    return render(Card(verdict="checked", name=name, style=style, summary=summary(found, 1), tables=tables))


def of_page(page: Page) -> str:
    """The card of a page: what it says, and what is seen first of it."""
    return render(
        Card(
            verdict=page.verdict,
            style=page.verdict,
            name=page.name,
            summary=page.summary,
            meaning=page.meaning,
            tables=tuple(_tables(page.sections[0].blocks)),
        )
    )


def _tables(blocks: Sequence[Block]) -> Iterator[Table]:
    """Blocks as tables, as far as they are of words."""
    for block in blocks:
        match block:
            case Table():
                yield block
            case Facts():
                yield Table(
                    columns=("", ""), rows=tuple((Cell(text=name), cell) for name, cell in block.facts)
                )
            case Reason():
                told = Cell(text=block.message, note=f"help: {block.relax}" if block.relax else "")
                yield Table(columns=("", ""), rows=((Cell(text=block.claim), told),))

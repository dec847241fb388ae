"""What a value of the library looks like in a notebook: a card with its verdict, a sentence, and a table or two.

In: certificates, canonical specifications, verdict lines. Out: HTML that stands for itself. The template escapes every
text.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from tubecert.certificate.effective import Effective
from tubecert.certificate.result import Certificate, Result
from tubecert.findings import Finding, Severity
from tubecert.printable import visible
from tubecert.report import console, reach
from tubecert.report.findings import summary
from tubecert.report.html import environment
from tubecert.report.outline import widths
from tubecert.report.page import Cell, Page, Table
from tubecert.report.page_origin import equations
from tubecert.report.page_sections import gains_table, not_certified
from tubecert.verdict import Verdict
from tubecert.words.assumptions import assumed


@dataclass(frozen=True, slots=True, kw_only=True)
class Card:
    """A verdict (`style` is how it looks), what it is about, a sentence, tables, and what is assumed."""

    verdict: str
    name: str
    style: str = ""
    summary: str = ""
    meaning: str = ""
    tables: Sequence[Table] = ()
    assumptions: Sequence[str] = ()


def render(card: Card) -> str:
    """The card as HTML."""
    return environment().get_template("card.html").render(card=card)


def of_line(line: str, name: str, style: str, details: Sequence[tuple[str, str]] = ()) -> str:
    """The card of a verdict line (`certified NAME: what follows`), with names and values below it."""
    verdict, _, summary = line.partition(f" {visible(name)}: ")
    rows = tuple((Cell(text=what), Cell(text=value)) for what, value in details)
    tables = [Table(columns=("", ""), rows=rows)] if rows else []
    return render(Card(verdict=verdict, name=name, style=style, summary=summary, tables=tables))


def certificate(certificate: Certificate) -> str:
    """The card of a certificate: its verdict, what it means or why it is none, and the gains of every kind."""
    result = certificate.result
    failed = not_certified(result)
    tables = [Table(columns=("not certified", ""), rows=failed)] if failed else []
    if (gains := gains_table(result)) is not None:
        tables.append(gains)
    if widths := _half_widths(result):
        tables.append(widths)
    return render(
        Card(
            verdict=result.verdict,
            name=console.name(result),
            style=result.verdict,
            summary=console.verdict_line(result).plain.partition(": ")[2],
            meaning=console.meaning(result).plain,
            tables=tables,
            assumptions=tuple(map(assumed, result.assumptions)),
        )
    )


def _half_widths(result: Result) -> Table | None:
    """What the certificate that decides proves of each state."""
    found = widths(result)
    if result.verdict is not Verdict.CERTIFIED or not found:
        return None
    return Table(
        columns=("half-widths of the tube",),
        rows=((Cell(text=reach.half_widths(result, found)),),),
    )


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
    """The card of a page: what it says, and its tables."""
    tables = [block for section in page.sections for block in section.blocks if isinstance(block, Table)]
    return render(
        Card(
            verdict=page.verdict,
            style=page.verdict,
            name=page.name,
            summary=page.summary,
            meaning=page.meaning,
            tables=tables,
        )
    )

"""What a value of the library looks like in a notebook: a card with its verdict, a sentence, and what is seen first.

In: pages. Out: HTML that stands for itself. The template escapes every text.
"""

from __future__ import annotations

from tubecert.certificate.effective import Effective
from tubecert.report.claimed import box
from tubecert.report.html import environment
from tubecert.report.page import Facts, Listing, Page, Section
from tubecert.report.page_origin import equations


def of_page(page: Page) -> str:
    """The card of a page: what it says, and its first section."""
    return environment().get_template("card.html").render(page=page)


def specification(effective: Effective) -> str:
    """The card of a specification: its equations and its safe set."""
    safe = box(effective.system.ordered(effective.part("safe_set")))
    blocks = Listing(text="\n".join(equations(effective))), Facts.of([("safe set", safe)])
    system = Section(key="system", title="System", blocks=blocks)
    page = Page(
        name=effective.name,
        verdict="",
        about="specification",
        summary="equations, safe set",
        sections=(system,),
    )
    return of_page(page)

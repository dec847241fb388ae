"""A page as HTML: one file that needs nothing else, with no script, for screens wide and narrow, light, dark and paper.

In: a page. Out: the text of the page, the same for the same page. The template escapes every text;
only the drawings, which `figures_axes` writes as well-formed SVG, and the style sheet are put in as they are.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from tubecert.report.page import Page, look, typeset

if TYPE_CHECKING:
    from jinja2 import Environment


def render_page(page: Page) -> str:
    """The text of a page."""
    return environment().get_template("page.html").render(page=page) + "\n"


@cache
def environment() -> Environment:
    """The templates; those of HTML escape every text."""
    from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

    environment = Environment(
        loader=PackageLoader("tubecert.report"),
        autoescape=select_autoescape(),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["typeset"] = typeset
    environment.filters["look"] = look
    return environment

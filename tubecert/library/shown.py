"""What shows itself: in a line, and as a card in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tubecert.report.page import Page


class Shown:
    """What shows itself by its page: in a line, and as a card in notebooks."""

    __slots__ = ()

    def _page(self) -> Page:
        raise NotImplementedError

    def __str__(self) -> str:
        from tubecert.report.text import headline

        return headline(self._page()).plain

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self}>"

    def _repr_html_(self) -> str:
        from tubecert.report import notebook

        return notebook.of_page(self._page())

"""That a search was ended before its end, and what it came out with then."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rich.text import Text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.pipeline.deadline import Cut

_CUT: Final = {"deadline": "cut short by the deadline", "interrupted": "interrupted"}
_BEST: Final = "this is the best of what was proven by then"


def cut_short(cut: Cut, what: str = _BEST) -> list[RenderableType]:
    """What ended it, and what that means for what is shown."""
    return [Text(), Text(f"{_CUT[cut]}: {what}", style="yellow")]

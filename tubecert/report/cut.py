"""That a search was ended before its end, and what it came out with then."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from rich.text import Text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from tubecert.pipeline.deadline import Cut

_BEST: Final = "this is the best of what was proven by then"
_CUT: Final = {"deadline": "cut short by the deadline", "interrupted": "interrupted"}
_ENDED: Final = {
    "no_adaptation": "ended with the first metric whose tube needs no adaptation (certificate 0): one of less, or of a "
    "narrower tube, is looked for with --objective adaptation or tube",
    "plan": "ended after two rates at which the plan alone misses the dynamics by more than the tube allows: it is the "
    "plan that has to be mended",
}
"""Where nothing more was to be found."""


def cut_short(cut: Cut, what: str = _BEST) -> list[RenderableType]:
    """What ended it, and what that means for what is shown."""
    words = _ENDED[cut] if cut in _ENDED else f"{_CUT[cut]}: {what}"
    return [Text(), Text(words, style="yellow")]

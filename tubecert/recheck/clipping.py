"""The set that the estimate is clipped to."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.recheck.cover import Outcome
from tubecert.recheck.metric import stated, together
from tubecert.recheck.norms import norms
from tubecert.recheck.place import Place
from tubecert.recheck.terms import (
    number,
)
from tubecert.recheck.unknown import joins
from tubecert.recheck.wind import adapted


def clips(place: Place, box: Sequence[tuple[Fraction, Fraction]], bound: Fraction | None) -> Outcome:
    """Whether a box of the inputs contains 0 and every value of h.

    h as expressions, with what is adapted to of a disturbance; where |h| itself is declared, the ball of `bound` = Dh.
    """
    s = place.system
    if not all(low <= 0 <= high for low, high in box):
        return stated(False, "0 is not in the set that the estimate is clipped to")
    if s.h is None or "h" in s.declared:
        if bound is None:
            return Outcome(verdict="undecided", why="|h| has no bound")
        if any(min(-low, high) < bound for low, high in box):
            return stated(False, "a declared |h| may point out of the box that the estimate is clipped to")
    if s.h is None:
        return stated(True, "")
    more, known, outcomes = adapted(place), joins(place), []
    for i, (low, high) in enumerate(box):
        own = s.h[i][0] if known is None else s.h[i][0] + known[i][0]
        shifted = [[[own - number((low + high) / 2)]]]
        if more is not None:
            shifted.append([more[i]])
        outcomes.append(norms(place, shifted, (high - low) / 2))
        if not outcomes[-1].holds:
            break
    return together(outcomes)

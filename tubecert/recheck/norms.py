"""Norms of matrices over the tube, by the way that decides them in the fewest boxes.

A matrix is taken apart where no entry joins its rows and columns; a column about a plan that stays where it is goes by
a multiplier for the tube (theory 1a.8), in many variables by its linear part (1a.7). Where these do not decide, boxes
do; only they contradict.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from tubecert.recheck.blocks import blocks
from tubecert.recheck.branches import norms_below
from tubecert.recheck.cover import Outcome, prove
from tubecert.recheck.linear import straight_below
from tubecert.recheck.metric import together
from tubecert.recheck.multiplier import column_below
from tubecert.recheck.place import Place
from tubecert.recheck.terms import Rows

_AT_ONCE = 12  # boxes that cost less than to look for a multiplier
_EASED = 300  # boxes with one, before boxes without are tried again
_FIRST = 500  # boxes before another way is tried
_FEW = 4  # variables in which boxes are poor


def norms(place: Place, matrices: Sequence[Rows], limit: Fraction) -> Outcome:
    """Whether the spectral norms of the matrices sum up to at most `limit` over the tube.

    What was confirmed of the same terms over the same tube, with a limit that is no larger, is not examined again.
    """
    key = tuple(tuple(tuple(row) for row in matrix) for matrix in matrices)  # equal terms are one object
    known = place.known.get(key)
    if known is not None and known[0] <= limit:
        return known[1]
    found = _examined(place, matrices, limit)
    if found.holds:
        place.known[key] = limit, found
    return found


def _examined(place: Place, matrices: Sequence[Rows], limit: Fraction) -> Outcome:
    parts = blocks(matrices[0]) if len(matrices) == 1 else []
    if len(parts) > 1:
        return together([norms(place, [part], limit) for part in parts])
    test = norms_below(matrices, limit)
    stays = not place.curve.moves and not place.curve.ranges
    column = [row[0] for row in matrices[0]]
    if not (stays and len(matrices) == 1 and len(matrices[0][0]) == 1):
        return prove(test, place.tube(), place.budget)
    found = prove(test, place.tube(), min(place.budget, _AT_ONCE))
    if found.verdict != "undecided" or place.budget <= _AT_ONCE:
        return found
    eased = column_below(place, column, limit, min(place.budget, _EASED))
    if eased is not None and eased.holds:
        return eased
    found = prove(test, place.tube(), min(place.budget, _FIRST))
    if found.verdict != "undecided" or place.budget <= _FIRST:
        return found
    straight = straight_below(place, column, limit) if len(test.variables) >= _FEW else None
    if straight is not None:
        return straight
    eased = column_below(place, column, limit, place.budget)
    if eased is not None and eased.holds:
        return eased
    return prove(test, place.tube(), place.budget)

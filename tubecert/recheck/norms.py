"""Norms of matrices over the tube, by the way that decides them in the fewest boxes.

A matrix is taken apart where no entry joins its rows and columns; a column about a plan that stays where it is goes by
a multiplier for the tube (theory 1a.8), in many variables by its linear part (1a.7). Where these do not decide, boxes
do; only they contradict.

Norms of columns over a ball or an ellipsoid around a point, by their linear part (theory 1a.7).

With any constants g, K: G = g + K (x - x*) + r, and K (x - x*) = K S^-1 z with |z| <= rho, so
    |G| <= |g| + rho |K S^-1| + |r|.
Each r_i is examined in the variables that it has. K is a proposal, slopes of chords of the tube; so is what every |r_i|
is asked to stay below, such that the squares sum up to the square of what is left.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction

from flint import arb

from tubecert.recheck.balls import exact, length, sharp_norm
from tubecert.recheck.cover import Outcome, prove, together
from tubecert.recheck.lipschitz import norms_below
from tubecert.recheck.multiplier import column_below
from tubecert.recheck.place import Place
from tubecert.recheck.program import Program
from tubecert.recheck.terms import NOUGHT, Rows, Term, blocks, names, number, number_of, slopes, variable

_CHORDS = (0.25, 0.5, 1.0)  # of the way to the rim
_SHARE = Fraction(1, 20)  # of what is left, for a remainder of which nothing is seen
_KEPT = 1 - Fraction(1, 10**9)


def straight_below(place: Place, column: Sequence[Term], limit: Fraction) -> Outcome | None:
    """|G| <= limit over the tube of a plan that stays where it is; None if the linear part leaves too little.

    Theory 1a.7.
    """
    states, start = place.system.states, place.curve.start
    if not names(column) <= set(states) or any(e.op != "const" for e in start):
        return None
    centre = [number_of(e) for e in start]
    rim = list(_rim(place, [float(q) for q in centre]))
    g, K = _proposed(column, states, centre, rim)
    inverse = _inverse(place)
    H = [[exact(_dot(row, along)) for along in zip(*inverse, strict=True)] for row in K]
    left = exact(limit) - length([exact(q) for q in g]) - exact(place.rho) * sharp_norm(H)
    if not left > 0:
        return None
    room = Fraction(float(left.lower())) * _KEPT
    offsets = [variable(name) - x for name, x in zip(states, start, strict=True)]
    rest = []
    for e, q, row in zip(column, g, K, strict=True):
        straight = sum((number(k) * y for k, y in zip(row, offsets, strict=True) if k), start=number(q))
        rest.append(e - straight)
    most = _shared(rest, states, rim, room)
    if most is None or not sum(q * q for q in most) <= room * room:
        return None
    outcomes = []
    for e, own in zip(rest, most, strict=True):
        outcomes.append(prove(norms_below([[[e]]], own), place.tube(), place.budget))
        if not outcomes[-1].holds:
            return None
    return together(outcomes)


def _rim(place: Place, centre: Sequence[float]) -> Iterator[list[float]]:
    """For every state the point where it is largest, then the one where it is least: x* and those, in turns."""
    n = len(centre)
    spread = [[float(i == j) for j in range(n)] for i in range(n)]
    if place.coordinates is not None:
        spread = [[float(q) for q in row] for row in place.coordinates.spread]
    for j in range(n):
        far = [float(place.rho) * spread[i][j] / math.sqrt(spread[j][j]) for i in range(n)]
        for share in _CHORDS:
            for sign in (1, -1):
                yield [c + sign * share * d for c, d in zip(centre, far, strict=True)]


def _proposed(
    column: Sequence[Term], states: Sequence[str], centre: Sequence[Fraction], rim: Sequence[Sequence[float]]
) -> tuple[list[Fraction], list[list[Fraction]]]:
    """G at the centre, and in column j of K the mean of its slopes by x_j where x_j changes most."""
    n, each = len(states), 2 * len(_CHORDS)
    g = [_short(x) for x in Program(list(column), states).run([exact(q) for q in centre])]
    columns = []
    for j, name in enumerate(states):
        program = Program(slopes(list(column), name), states)
        found = [program.run([arb(x) for x in point]) for point in rim[j * each : (j + 1) * each]]
        columns.append(
            [sum((_short(x) for x in own), Fraction(0)) / each for own in zip(*found, strict=True)]
        )
    assert len(columns) == n
    return g, [list(row) for row in zip(*columns, strict=True)]


def _shared(
    rest: Sequence[Term], states: Sequence[str], rim: Sequence[Sequence[float]], room: Fraction
) -> list[Fraction] | None:
    """What every |r_i| is asked to stay below: as large as they look, with the same factor for all."""
    program = Program(list(rest), states)
    seen = [Fraction(0)] * len(rest)
    for point in rim:
        values = program.run([arb(x) for x in point])
        seen = [max(q, abs(_short(x))) for q, x in zip(seen, values, strict=True)]
    least = _SHARE * room / len(rest)
    asked = [max(q, least) if e is not NOUGHT else Fraction(0) for q, e in zip(seen, rest, strict=True)]
    size = math.sqrt(float(sum(q * q for q in asked)))
    factor = Fraction(float(room) / size) * _KEPT if size > 0 else Fraction(1)
    return [q * factor for q in asked] if factor >= 1 else None


def _inverse(place: Place) -> Sequence[Sequence[Fraction]]:
    """S^-1."""
    if place.coordinates is not None:
        return place.coordinates.inverse
    n = range(len(place.system.states))
    return [[Fraction(i == j) for j in n] for i in n]


def _dot(a: Sequence[Fraction], b: Sequence[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(a, b, strict=True)), Fraction(0))


def _short(value: arb) -> Fraction:
    """A number near a ball, for a proposal."""
    middle = float(value.mid())
    return Fraction(round(middle * 2**30), 2**30) if math.isfinite(middle) else Fraction(0)


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

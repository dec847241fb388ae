"""The norm of a vector over the tube, where the constraint of the tube itself carries the bound.

At the rim a box always has corners outside of the tube, so that boxes alone are poor: what they overestimate is in
proportion to their width. With any L >= 0,
    |v|^2 <= L rho^2 + sup (|v|^2 - L d'Q d) over the tube,   d = x - x*(t) in the states of v,
and with the multiplier of the maximum what is searched has no slope along the rim. L is proposed: an ascent in floats.
In: suprema. Out: a bound, or none. Trusted: yes. Implements: theory 1a.8.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from math import isfinite

import numpy as np

from tubecert.bounds.searches import Searches
from tubecert.coordinates import Rows, inverse
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array, Interval, sqrt
from tubecert.enclosure.pencil import scalar
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import ZERO, Expression, constant, derivatives, free_symbols, symbol
from tubecert.expression.matrix import Matrix, column

_ASCENTS = 30


def eased_bound(
    suprema: Searches, name: str, v: Matrix, at: Mapping[str, float], effort: Effort
) -> float | None:
    """A bound of |v|, v (p, 1), over the tube, from a point `at` which |v| is large; None where there is none, (1.10).

    `effort` is that of a search for the supremum of |v|^2 - L d'Q d, and `name` what it is told as.
    """
    plan, entries = suprema.plan, [row[0] for row in v]
    if plan.spans is not None or plan.knots is not None or plan.allowance is not None:
        return None  # x* by expressions of t alone
    names = free_symbols(entries)
    which = [i for i, state in enumerate(suprema.model.states) if state in names]
    if not which or not names <= set(at):
        return None
    offset = [symbol(suprema.model.states[i]) - plan.x[i] for i in which]
    if not free_symbols(offset) <= set(at):
        return None
    spread = _spread(suprema, which)
    square = sum((e * e for e in entries), start=ZERO)
    states = [suprema.model.states[i] for i in which]
    multiplier = _proposed(square, offset, states, np.array(spread, dtype=float), (suprema.rho, at))
    if multiplier is None:
        return None
    eased = square - constant(multiplier) * _form(inverse(spread), offset)
    found = suprema.over_tube(name, scalar(eased), effort)
    rho = Interval.exact(suprema.rho)
    total = Interval.exact(found.above) + Interval.of(multiplier) * (rho * rho)
    if not isfinite(float(total.hi)):
        return None
    return float(sqrt(Interval.exact(max(0.0, float(total.hi)))).hi)


def _spread(suprema: Searches, which: Sequence[int]) -> Rows:
    """(S'S)^-1 in some of the states: the projection of the tube to these is d'Q d <= rho^2 with its inverse Q."""
    if suprema.coordinates is None:
        return tuple(tuple(Fraction(int(i == j)) for j in which) for i in which)
    return tuple(tuple(suprema.coordinates.spread[i][j] for j in which) for i in which)


def _form(Q: Rows, offset: Sequence[Expression]) -> Expression:
    """d'Q d."""
    products = (
        constant(q) * a * b
        for a, row in zip(offset, Q, strict=True)
        for b, q in zip(offset, row, strict=True)
        if q
    )
    return sum(products, start=ZERO)


def _proposed(
    square: Expression,
    offset: Sequence[Expression],
    states: Sequence[str],
    spread: Array,
    start: tuple[float, Mapping[str, float]],
) -> Fraction | None:
    """L with grad |v|^2 = 2 L Q d at the largest |v|^2 that an ascent along the rim finds, nothing else changed."""
    rho, at = start
    slopes = [derivatives([square], name)[0] for name in states]
    function = MatrixFunction([column([square, *slopes]), column(offset)])
    point = dict(at)
    best, multiplier = -np.inf, 0.0
    for _ in range(_ASCENTS):
        own = np.array([[point[name] for name in function.variables]])
        with np.errstate(all="ignore"):
            values, d = (e[0, :, 0] for e in function.floats(own))
        slope = values[1:]
        size = float(np.sqrt(slope @ spread @ slope))
        if not (np.isfinite(values).all() and 0 < size < np.inf):
            break
        if values[0] > best:
            best, multiplier = float(values[0]), float(slope @ d) / (2 * rho * rho)
        new = rho * (spread @ slope) / size
        for name, change in zip(states, new - d, strict=True):
            point[name] += float(change)
    return Fraction(multiplier) if 0 < multiplier < np.inf else None

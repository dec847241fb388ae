"""The norm of a vector over an ellipsoid around one point, by its linear part: no search over all states at once.

With any constant v0, K and v = v0 + K (x - x*) + r,
    |v| <= |[v0/a, rho K S^-1/b]| + |R|,   R_i >= sup |r_i| over the tube,   a^2 + b^2 <= 1,
since K (x - x*) = K S^-1 z with |z| <= rho. Each r_i is searched in the variables that it has: their number does not
grow with that of the states. K is proposed: the mean slope on the way to the rim. In: suprema. Out: a bound, or none.
Trusted: yes. Implements: theory 1a.7.
"""

from __future__ import annotations

from fractions import Fraction
from math import isfinite

import numpy as np

from tubecert.bounds.searches import Searches
from tubecert.coordinates import Rows, product
from tubecert.enclosure.branch_and_bound import Effort
from tubecert.enclosure.interval import Array, Interval
from tubecert.enclosure.linalg import midrad, norm_bound, spectral_norm_midrad
from tubecert.enclosure.objective import SumOfNorms
from tubecert.enclosure.taylor import MatrixFunction
from tubecert.expression import Expression, constant, free_symbols, symbol
from tubecert.expression.matrix import Matrix, column, constants, jacobian, multiply
from tubecert.model import TIME
from tubecert.tube.sections import enclosed

LEAST = 4  # variables: with fewer, boxes are as good
_STEPS = (0.1, 0.3, 0.5, 0.7, 0.9)  # of the way
_DIGITS = 2**30
_CLOSE = 1e-3  # of the linear part: how closely a remainder is enclosed
_BOXES = 4_000  # for each


def linear_bound(suprema: Searches, v: Matrix) -> float | None:
    """A bound of |v|, v (p, 1), over the tube of a plan that stays at a point; None where there is none, (1.9)."""
    model, plan = suprema.model, suprema.plan
    entries = [row[0] for row in v]
    if not plan.is_constant or plan.allowance is not None or len(free_symbols(entries)) < LEAST:
        return None
    if not all(e.is_constant for e in plan.x) or not free_symbols(entries) <= {*model.states, TIME}:
        return None
    centre = tuple(e.fraction for e in plan.x)
    found = _proposed(suprema, entries, np.array(centre, dtype=float))
    if found is None:
        return None
    v0, K = found
    offset = [symbol(name) - constant(q) for name, q in zip(model.states, centre, strict=True)]
    straight = multiply(constants(K), column(offset))
    rest = [e - constant(q) - row[0] for e, q, row in zip(entries, v0, straight, strict=True)]
    S = suprema.coordinates
    return _bound(suprema, v0, K if S is None else product(K, S.inverse), rest)


def _bound(suprema: Searches, v0: list[Fraction], H: Rows, rest: list[Expression]) -> float | None:
    """(1.9): g and K S^-1 over a and b with a^2 + b^2 <= 1, decided in exact arithmetic, and the remainders."""
    reach = Interval.exact(suprema.rho)
    mid, rad = midrad(enclosed(H) * reach)
    size = float(spectral_norm_midrad(mid, rad).hi)
    length = float(np.linalg.norm([float(q) for q in v0]))
    if any(v0):
        a = min(max((length / (length + size)) ** 0.5, 1e-3), 1 - 1e-6)
        b = float((1 - a * a) ** 0.5) * (1 - 1e-9)
        assert Fraction(a) ** 2 + Fraction(b) ** 2 <= 1
        first = enclosed(tuple((q / Fraction(a),) for q in v0))
        second = enclosed(tuple(tuple(e / Fraction(b) for e in row) for row in H)) * reach
        whole = Interval(np.hstack([first.lo, second.lo]), np.hstack([first.hi, second.hi]))
        size = float(spectral_norm_midrad(*midrad(whole)).hi)
    effort = Effort(gap=0.05, absolute=_CLOSE * size, budget=_BOXES, progress=suprema.effort.progress)
    most = [_remainder(suprema, e, effort) for e in rest]
    total = size + float(norm_bound(np.array([most])[..., None])[0])
    return float(np.nextafter(total, np.inf)) if isfinite(total) else None


def _remainder(suprema: Searches, e: Expression, effort: Effort) -> float:
    objective = SumOfNorms([((e,),)])
    return 0.0 if objective.is_zero else suprema.over_tube("remainder", objective, effort).above


def _proposed(
    suprema: Searches, entries: list[Expression], centre: Array
) -> tuple[list[Fraction], Rows] | None:
    """v at the centre, and in column j its mean slope on the way to where x_j is largest and least; t is 0."""
    n, states = len(centre), suprema.model.states
    spread = np.eye(n) if suprema.coordinates is None else np.array(suprema.coordinates.spread, dtype=float)
    far = suprema.rho * spread / np.sqrt(np.diag(spread))  # columns: the points of the rim
    steps = [sign * step for step in _STEPS for sign in (1, -1)]
    points = np.array([centre, *(centre + step * far[:, j] for j in range(n) for step in steps)])
    function = MatrixFunction([jacobian(tuple(entries), states), column(entries)])
    values = dict(zip(states, points.T, strict=True)) | {TIME: np.zeros(len(points))}
    with np.errstate(all="ignore"):
        slopes, own = function.floats(np.stack([values[name] for name in function.variables], axis=1))
    means = slopes[1:].reshape(n, len(steps), len(entries), n).mean(axis=1)
    K, v0 = means[np.arange(n), :, np.arange(n)].T, own[0, :, 0]
    if not (np.all(np.isfinite(K)) and np.all(np.isfinite(v0))):
        return None
    return [_short(e) for e in v0], tuple(tuple(map(_short, row)) for row in K)


def _short(value: float) -> Fraction:
    return Fraction(round(float(value) * _DIGITS), _DIGITS)

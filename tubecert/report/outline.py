"""The tube in the plane of two states at one time: an ellipse, cut to half-widths where that is all that is proven.

In: `result` of a certificate. Out: the outline relative to the plan, in floats, to be drawn; nothing is decided here.

For a constant W the state stays in {d(x*, x) < level}, whose projection is an ellipse with the block of W in the plane.
For any other metric what is proven is |S (x - x*)| < radius and every half-width.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.certificate.result import Result, TubeData
from tubecert.coordinates import inverse
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, ExpressionError, free_symbols, parse, symbol
from tubecert.report.figures_axes import ellipse


def widths(result: Result) -> dict[str, float] | None:
    """The half-width of every state, in the order of the states; None if none is known."""
    found = None if result.tube is None else result.tube.half_widths
    if not found:
        return None
    return {name: found[name] for name in result.spec.effective.system.states}


def level_set(result: Result) -> Array | None:
    """For a constant W what d(x*, x) < dbar = sqrt(a) rho is: {rho y: y' shape^-1 y < 1}, shape (n, n)."""
    tube, metric, W = result.tube, result.metric, _constant(result)
    if W is None or tube is None or tube.rho_r is None or metric is None or metric.lower is None:
        return None
    return metric.lower.below * W if metric.lower.below > 0 else None


def tube_outline(result: Result, pair: tuple[int, int]) -> Array | None:
    """What the state stays in: points (N, 2) counterclockwise around it; None where there is no tube."""
    tube, plane = result.tube, np.ix_(pair, pair)
    if tube is None:
        return None
    if (shape := level_set(result)) is not None:
        return float(tube.rho) * ellipse(shape[plane])
    names, known = result.spec.effective.system.states, widths(result)
    ball = float(tube.rho) * ellipse(_ball(tube, len(names))[plane])
    return ball if known is None else _cut(ball, np.array([known[names[i]] for i in pair]))


def _cut(shape: Array, sides: Array) -> Array:
    """What of a convex shape (N, 2) about the origin lies within `sides` (2,): its points drawn in, and the corners."""
    drawn_in = shape * np.minimum(1, (sides / np.maximum(np.abs(shape), 1e-300)).min(axis=1))[:, None]
    edge = np.roll(shape, -1, axis=0) - shape
    corners = sides * [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    outward = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    inside = (corners @ outward.T <= (outward * shape).sum(axis=1)).all(axis=1)
    points = np.concatenate([drawn_in, corners[inside]])
    return np.asarray(points[np.argsort(np.arctan2(points[:, 1] / sides[1], points[:, 0] / sides[0]))])


def _ball(tube: TubeData, n: int) -> Array:
    """The shape (n, n) of |S y| < 1: S^-1 S^-T."""
    if tube.coordinates is None:
        return np.eye(n)
    rows = inverse([[Fraction(entry) for entry in row] for row in tube.coordinates])
    back = np.array([[float(entry) for entry in row] for row in rows])
    return np.asarray(back @ back.T)


def _constant(result: Result) -> Array | None:
    """W where it is the same everywhere, (n, n)."""
    metric, states = result.metric, result.spec.effective.system.states
    if metric is None:
        return None
    found = [number_of(entry, states) for row in metric.dual_metric for entry in row]
    known = [value for value in found if value is not None]
    return np.array(known).reshape(len(states), -1) if len(known) == len(found) == len(states) ** 2 else None


def number_of(text: str, names: Sequence[str]) -> float | None:
    """The value of an expression that depends on nothing."""
    found = expression_of(text, names)
    if found is None or free_symbols([found]):
        return None
    return float(Tape([found], ()).run_floats([], ())[0])


def expression_of(text: str, names: Sequence[str]) -> Expression | None:
    """A text of the certificate as an expression of these names; None if it is none."""
    try:
        return parse(text, symbols={name: symbol(name) for name in names}, kinks=True).expression
    except ExpressionError:
        return None

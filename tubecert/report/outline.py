"""The tube in the plane of two states at one time: an ellipse, cut to half-widths where that is all that is proven.

In: `result` of a certificate. Out: the outline relative to the plan, in floats, to be drawn; nothing is decided here.

For a constant W the state stays in {d(x*, x) < level}, whose projection is an ellipse with the block of W in the plane.
For any other metric what is proven is |S (x - x*)| < radius and every half-width.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from tubecert.certificate.result import Result, TubeData
from tubecert.coordinates import inverse
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.expression import Expression, ExpressionError, free_symbols, parse, symbol
from tubecert.report.figures_scene import Matrix, Outline


def widths(result: Result) -> dict[str, float] | None:
    """The half-width of every state, in the order of the states; None if none is known."""
    found = None if result.tube is None else result.tube.half_widths
    if not found:
        return None
    return {name: found[name] for name in result.spec.effective.system.states}


def tube_outline(result: Result, pair: tuple[int, int]) -> Outline | None:
    """What the state stays in; None where there is no tube."""
    tube = result.tube
    if tube is None:
        return None
    level, W = _level(result, tube), _constant(result)
    if level is not None and W is not None:
        return Outline(turn=_root(level**2 * W[np.ix_(pair, pair)]))
    names, known = result.spec.effective.system.states, widths(result)
    sides = None if known is None else (known[names[pair[0]]], known[names[pair[1]]])
    return Outline(turn=_ball(tube, float(tube.rho), pair), sides=sides)


def _level(result: Result, tube: TubeData) -> float | None:
    """The distance that is not reached, dbar = sqrt(a) rho."""
    a = None if result.metric is None else result.metric.lower
    return None if a is None or tube.rho_r is None or a.below <= 0 else math.sqrt(a.below) * float(tube.rho)


def _ball(tube: TubeData, radius: float, pair: tuple[int, int]) -> Matrix:
    """The projection of |S y| < radius: y_i reaches sqrt of the diagonal of S^-1 S^-T."""
    if tube.coordinates is None:
        return (radius, 0.0), (0.0, radius)
    rows = inverse([[Fraction(entry) for entry in row] for row in tube.coordinates])
    back = np.array([[float(entry) for entry in row] for row in rows])
    return _root(radius**2 * (back @ back.T)[np.ix_(pair, pair)])


def _root(shape: Array) -> Matrix:
    """L with L L' = shape, (2, 2): the unit disc becomes {y: y' shape^-1 y < 1}; never quite flat, to be seen."""
    values, vectors = np.linalg.eigh(shape)
    least = max(1e-12 * float(values[-1]), 1e-300)
    (a, b), (c, d) = (vectors * np.sqrt(np.maximum(values, least))).tolist()
    return (a, b), (c, d)


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

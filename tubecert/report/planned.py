"""The plan against time, to be drawn: states as the certificate samples them, inputs from what it says of them.

In: `result` of a certificate. Out: curves in floats. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from tubecert.certificate.result import Result
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME
from tubecert.report.claimed import horizon
from tubecert.report.figures_axes import Point
from tubecert.report.outline import expression_of

_SAMPLES = 201
_OF_A_PIECE = 8  # lines that a parabola is drawn by
_FOR_EVER = 1.0  # s that are drawn of a plan without an end
_TEXTS = {"equilibrium": "input", "expressions": "u"}  # where the specification holds u*


def states(result: Result) -> list[list[Point]]:
    """x*_i against t for every state; empty where no points are known."""
    samples = result.plan.samples
    if samples is None or not samples.x:
        return []
    rows = samples.x if len(samples.x) > 1 else (samples.x[0],) * 2
    t = samples.t if len(samples.x) > 1 else (0.0, end(result))
    return [list(zip(t, column, strict=True)) for column in zip(*rows, strict=True)]


def inputs(result: Result) -> list[list[Point]]:
    """u*_j against t for every input; empty where nothing is known of them."""
    knots = result.plan.knots
    if knots is not None:
        drawn = _DRAWN[result.plan.interpolation]
        t = list(map(_float, knots.t))
        return [drawn(t, list(map(_float, column))) for column in zip(*knots.u, strict=True)]
    texts = result.spec.effective.part("trajectory").get(_TEXTS.get(result.plan.kind, ""), ())
    return [] if isinstance(texts, str) else _of_time(result, texts)


def end(result: Result) -> float:
    """The time up to which a plan is drawn, in s."""
    return float(horizon(result) or _FOR_EVER)


def _of_time(result: Result, texts: Sequence[str]) -> list[list[Point]]:
    known = [found for text in texts if (found := expression_of(text, [TIME])) is not None]
    if len(known) != len(result.spec.effective.system.inputs):
        return []
    t = np.linspace(0.0, end(result), _SAMPLES)
    values = Tape(known, [TIME]).run_floats([t], t.shape)
    return [list(zip(t.tolist(), row.tolist(), strict=True)) for row in values]


def _linear(t: Sequence[float], u: Sequence[float]) -> list[Point]:
    """Straight lines between knots."""
    return list(zip(t, u, strict=True))


def _held(t: Sequence[float], u: Sequence[float]) -> list[Point]:
    """Steps: what is held from a knot to the next."""
    points = list(zip(t, u, strict=True))
    corners = [corner for one, other in pairwise(points) for corner in (one, (other[0], one[1]))]
    return [*corners, points[-1]]


def _quadratic(t: Sequence[float], u: Sequence[float]) -> list[Point]:
    """Parabolas, each through a knot, the point between and the next knot."""
    found = [(t[0], u[0])]
    for k in range(0, len(t) - 1, 2):
        parabola = np.polynomial.Polynomial.fit(t[k : k + 3], u[k : k + 3], 2)
        inner = np.linspace(t[k], t[k + 2], _OF_A_PIECE + 1)[1:-1]
        found += [*zip(inner.tolist(), parabola(inner).tolist(), strict=True), (t[k + 2], u[k + 2])]
    return found


_DRAWN: Mapping[str | None, Callable[[Sequence[float], Sequence[float]], list[Point]]] = {
    "exact": _linear,
    None: _linear,
    "linear": _linear,
    "hold": _held,
    "hermite-simpson": _quadratic,
}


def _float(text: str) -> float:
    top, _, bottom = text.partition("/")
    return float(top) / float(bottom or 1)

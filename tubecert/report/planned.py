"""The plan against time, to be drawn: states as the certificate samples them, inputs from what it says of them.

In: `result` of a certificate. Out: times (K,) in s and a row (K,) for each state or input, in floats; no rows where
nothing is known. Nothing is decided here.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
from numpy.polynomial.polynomial import polyfit, polyval

from tubecert.certificate.result import Result
from tubecert.enclosure.interval import Array
from tubecert.enclosure.tape import Tape
from tubecert.model import TIME
from tubecert.report.outline import expression_of

_SAMPLES = 201
_OF_A_PIECE = 8  # lines that a parabola is drawn by
_FOR_EVER = 1.0  # s that are drawn of a plan without an end
_TEXTS = {"equilibrium": "input", "expressions": "u"}  # where the specification holds u*
_NOTHING = np.zeros(0), np.zeros((0, 0))


def states(result: Result) -> tuple[Array, Array]:
    """Every state x*_i."""
    samples = result.plan.samples
    if samples is None or not samples.x:
        return _NOTHING
    t, x = np.array(samples.t, dtype=float), np.array(samples.x, dtype=float).T
    return (t, x) if len(samples.x) > 1 else (np.array([0.0, end(result)]), np.repeat(x, 2, axis=1))


def inputs(result: Result) -> tuple[Array, Array]:
    """Every input u*_j."""
    knots = result.plan.knots
    if knots is None:
        texts = result.spec.effective.part("trajectory").get(_TEXTS.get(result.plan.kind, ""), ())
        return _NOTHING if isinstance(texts, str) else _of_time(result, texts)
    t = np.array([float(Fraction(at)) for at in knots.t])
    u = np.array([[float(Fraction(value)) for value in row] for row in knots.u]).T
    if result.plan.interpolation == "hold":  # from a knot to the next
        return np.repeat(t, 2)[1:], np.repeat(u, 2, axis=1)[:, :-1]
    return _parabolas(t, u) if result.plan.interpolation == "hermite-simpson" else (t, u)


def end(result: Result) -> float:
    """The time up to which a plan is drawn, in s."""
    return float(result.spec.effective.trajectory.horizon or _FOR_EVER)


def _of_time(result: Result, texts: Sequence[str]) -> tuple[Array, Array]:
    known = [found for text in texts if (found := expression_of(text, [TIME])) is not None]
    if len(known) != len(result.spec.effective.system.inputs):
        return _NOTHING
    t = np.linspace(0.0, end(result), _SAMPLES)
    return t, Tape(known, [TIME]).run_floats([t], t.shape)


def _parabolas(t: Array, u: Array) -> tuple[Array, Array]:
    """Parabolas, each through a knot, the point between and the next knot."""
    times, values = [t[:1]], [u[:, :1]]
    for k in range(0, len(t) - 1, 2):
        inner = np.linspace(t[k], t[k + 2], _OF_A_PIECE + 1)[1:]
        own = polyfit(t[k : k + 3] - t[k], u[:, k : k + 3].T, 2)
        times.append(inner)
        values.append(polyval(inner - t[k], own))
    return np.concatenate(times), np.concatenate(values, axis=1)

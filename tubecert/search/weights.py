"""Weights of an objective for metrics, searched without slopes by what a metric of each comes to in the end.

The objective is nearness to a target T: half-widths, gains of inputs and couplings of states are factors of T, and the
rate goes with them. A weight whose change moved the outcome most is moved first. Untrusted: it chooses among metrics
that are proven.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from math import exp, expm1, inf, isfinite, sqrt
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array

_STEP, _LEAST = 0.4, 0.05  # of a logarithm
_SHEARED: Final = 3  # states up to which their couplings are weights as well


@dataclass(frozen=True, slots=True, kw_only=True)
class Weights:
    """A target T (n, n), symmetric and positive definite, of no scale; and a rate in 1/s."""

    target: Array = field(repr=False)
    rate: float


Move = Callable[[Weights, float], Weights]


def moves(inputs: Array) -> list[Move]:
    """What can be changed, by a logarithm: half-widths, the gain of every input (n, m), couplings, the rate."""
    n = len(inputs)
    found: list[Move] = [_faster, *(partial(_gained, column) for column in inputs.T)]
    found += [partial(_widened, i) for i in range(1, n)]  # a scale of all is none
    if n <= _SHEARED:
        found += [partial(_sheared, i, j) for i in range(n) for j in range(i)]
    return found


def _faster(own: Weights, step: float) -> Weights:
    return Weights(target=own.target, rate=own.rate * exp(step))


def _widened(state: int, own: Weights, step: float) -> Weights:
    scale = np.ones(len(own.target))
    scale[state] = exp(step)
    return Weights(target=own.target * scale[:, None] * scale, rate=own.rate)


def _gained(column: Array, own: Weights, step: float) -> Weights:
    """T + c b b' with b' T^-1 b smaller by exp(2 step): beta^2 is that of a metric that is T."""
    size = float(column @ np.linalg.solve(own.target, column))
    more = expm1(2 * step) / size if size > 0 else 0.0
    return Weights(target=own.target + more * np.outer(column, column), rate=own.rate)


def _sheared(i: int, j: int, own: Weights, step: float) -> Weights:
    turn = np.eye(len(own.target))
    turn[i, j] = step * sqrt(own.target[i, i] / own.target[j, j])
    return Weights(target=turn @ own.target @ turn.T, rate=own.rate)


def descend(start: Weights, cost: Callable[[Weights], float], steps: list[Move], most: int) -> Weights:
    """The weights of the least cost that so many evaluations find around a start."""
    best, value, used, step = start, cost(start), 1, _STEP
    moved, signs = [inf] * len(steps), [1.0] * len(steps)
    while step >= _LEAST:
        before = value
        for k in sorted(range(len(steps)), key=lambda each: -moved[each]):
            for sign in (signs[k], -signs[k]):
                if used >= most:
                    return best
                other = steps[k](best, sign * step)
                found, used = cost(other), used + 1
                moved[k] = abs(found - value) if isfinite(found) else inf
                if found < value:
                    best, value, signs[k] = other, found, sign
                    break
        if value >= before:
            step /= 2
    return best

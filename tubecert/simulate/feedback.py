"""The slow part of a loop at a point: f, B, the geodesic, min-norm feedback, and the disturbance.

The feedback is the smallest k with phi_0 + phi_1'k <= 0: k = 0 if phi_0 <= 0, else -phi_0 phi_1/|phi_1|^2, where
phi_0 = -2 gamma_s(0)'M(f(x*) + B(x*)u*) + 2 gamma_s(1)'M(f(x) + B(x)u*) + 2 rate E and phi_1 = 2 B'M gamma_s(1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.expression import ZERO, Expression
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulate import geodesic
from tubecert.simulate.compiled import compiled
from tubecert.simulate.geodesic import Curve, Metric, connect
from tubecert.simulate.program import Program, assemble, execute
from tubecert.simulate.small import clip, dot

INFEASIBLE = 10
_ROUNDING = 1e-12


class Field(NamedTuple):
    """f (n,), B (n, m) row by row and the base of h (m,) as one program of t and x; the metric and its rate."""

    n: int
    m: int
    program: Program
    metric: Metric
    rate: float


class Force(NamedTuple):
    """The arrays of a `Disturbance`."""

    amplitude: Array
    frequency: Array
    wave: Array
    phase: Array
    push: Array
    radius: Array
    centre: Array
    layer: float


class Point(NamedTuple):
    """Working memory and results of `evaluate`: f (n,), B (n, m), h, k and phi_1/2 (m,)."""

    memory: Array
    f: Array
    B: Array
    h: Array
    k: Array
    push: Array
    curve: Curve


def field(model: ControlAffineModel, base: Sequence[Expression] | None, degree: int) -> Field:
    """The slow part of a model's loops."""
    n, m = len(model.states), len(model.inputs)
    h = [ZERO] * m if base is None else list(base)
    program = assemble([*model.f, *(e for row in model.B for e in row), *h], (TIME, *model.states))
    return Field(n, m, program, geodesic.metric(model, degree), float(model.rate))


def point(field: Field) -> Point:
    """Fresh working memory."""
    n, m = field.n, field.m
    return Point(
        field.program.start.copy(),
        np.zeros(n),
        np.zeros((n, m)),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        geodesic.curve(field.metric),
    )


@compiled
def evaluate(
    field: Any, force: Any, lane: int, t: float, x: Any, plan: Any, index: int, side: int, point: Any
) -> tuple[int, float]:
    """(status, energy) at (t, x), with the plan's values at a step and side; f, B, k, h go into `point`."""
    _drift(field, t, x, point)
    status, energy = connect(field.metric, point.curve, plan.x[index, side], x)
    if status == geodesic.FOUND:
        status = _feedback(field, plan.u[index, side], plan.drift[index, side], energy, point)
        _disturb(force, lane, t, x, point)
    return status, energy


@compiled
def without_feedback(field: Any, force: Any, lane: int, t: float, x: Any, point: Any) -> None:
    """f, B and h alone, for a lane that is not pushed along its geodesic."""
    _drift(field, t, x, point)
    _disturb(force, lane, t, x, point)


@compiled
def _drift(field: Any, t: float, x: Any, point: Any) -> None:
    n, m, outputs = field.n, field.m, field.program.outputs
    point.memory[0] = t
    for i in range(n):
        point.memory[1 + i] = x[i]
    execute(field.program, point.memory)
    for i in range(n):
        point.f[i] = point.memory[outputs[i]]
        for j in range(m):
            point.B[i, j] = point.memory[outputs[n + i * m + j]]
    for j in range(m):
        point.h[j] = point.memory[outputs[n + n * m + j]]


@compiled
def _feedback(field: Any, u: Any, drift: Any, energy: float, point: Any) -> int:
    n, m = field.n, field.m
    start, end = point.curve.start, point.curve.end
    phi_0 = 2 * field.rate * energy - 2 * dot(start, drift)
    size = abs(phi_0)
    for i in range(n):
        total = point.f[i]
        for j in range(m):
            total += point.B[i, j] * u[j]
        phi_0 += 2 * end[i] * total
        size += abs(end[i] * total) + abs(start[i] * drift[i])
    for j in range(m):
        point.push[j] = 0.0
        for i in range(n):
            point.push[j] += point.B[i, j] * end[i]
    reach = dot(point.push, point.push)
    for j in range(m):
        point.k[j] = -phi_0 * point.push[j] / (2 * reach) if phi_0 > 0.0 and reach > 0.0 else 0.0
    return INFEASIBLE if reach == 0.0 and phi_0 > _ROUNDING * size else geodesic.FOUND


@compiled
def _disturb(force: Any, lane: int, t: float, x: Any, point: Any) -> None:
    m = point.h.shape[0]
    for w in range(force.frequency.shape[1]):
        angle = force.frequency[lane, w] * t + force.phase[lane, w]
        for i in range(x.shape[0]):
            angle += force.wave[lane, w, i] * (x[i] - force.centre[i])
        wave = np.sin(angle)
        for j in range(m):
            point.h[j] += force.amplitude[lane, w, j] * wave
    push = force.push[lane]
    if push != 0.0:
        push /= np.sqrt(dot(point.push, point.push) + force.layer * force.layer)
        for j in range(m):
            point.h[j] += push * point.push[j]
    clip(point.h, force.radius[lane])

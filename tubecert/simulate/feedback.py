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
from tubecert.simulate.compiled import compiled
from tubecert.simulate.geodesic import FOUND, Curve, Metric, connect, metric
from tubecert.simulate.problem import Disturbance
from tubecert.simulate.program import Program, assemble, execute
from tubecert.simulate.small import clip, dot

INFEASIBLE = 10
_ROUNDING = 1e-12


class Field(NamedTuple):
    """f (n,), B (n, m) row by row and the base of h (m,) as one program of t and x; the metric and its rate."""

    program: Program
    metric: Metric
    rate: float


class Force(NamedTuple):
    """Of every lane: waves (N, W, m + n + 2) of amplitude, wave vector, frequency, phase; push and radius (N, 2)."""

    waves: Array
    lanes: Array
    layer: float


class Point(NamedTuple):
    """Working memory and results of `evaluate`: f (n,), B (n, m); `inputs` (3, m): h, k, B'M gamma_s(1)."""

    memory: Array
    f: Array
    B: Array
    inputs: Array
    curve: Curve


def field(model: ControlAffineModel, base: Sequence[Expression] | None, degree: int) -> tuple[Field, Point]:
    """The slow part of a model's loops, and working memory for it."""
    n, m = len(model.states), len(model.inputs)
    h = [ZERO] * m if base is None else list(base)
    outputs = [*model.f, *(e for row in model.B for e in row), *h]
    program, memory = assemble(outputs, (TIME, *model.states))
    space, curve = metric(model, degree)
    work = Point(memory, np.zeros(n), np.zeros((n, m)), np.zeros((3, m)), curve)
    return Field(program, space, float(model.rate)), work


def force(d: Disturbance) -> Force:
    """The arrays of a disturbance; its centre goes into the phases."""
    phase = d.phase - d.wave @ d.centre
    waves = np.concatenate([d.amplitude, d.wave, d.frequency[..., None], phase[..., None]], axis=2)
    return Force(waves, np.stack([d.push, d.radius], axis=1).astype(float), float(d.layer))


@compiled
def evaluate(
    field: Any, force: Any, lane: int, t: float, x: Any, plan: Any, whole: bool, point: Any
) -> tuple[int, float]:
    """(status, energy) at (t, x); `plan` holds x*, f(x*) + B(x*)u*, u*. f, B, h and k go into `point`.

    Without `whole` the geodesic and k are left out unless the lane is pushed along it.
    """
    n = x.shape[0]
    _drift(field.program, t, x, point.memory, point.f, point.B, point.inputs[0])
    status, energy = FOUND, 0.0
    if whole or force.lanes[lane, 0] != 0.0:
        status, energy = connect(field.metric, point.curve, point.curve.bend, plan[:n], x)
        if status != FOUND:
            return status, energy
        status = _feedback(field.rate * energy, plan[n:], point.f, point.B, point.inputs, point.curve.vectors)
    _disturb(force.waves[lane], force.lanes[lane], force.layer, t, x, point.inputs)
    return status, energy


@compiled
def _drift(program: Any, t: float, x: Any, memory: Any, f: Any, B: Any, h: Any) -> None:
    n, m = B.shape
    memory[0] = t
    for i in range(n):
        memory[1 + i] = x[i]
    execute(program.steps, program.steps.shape[0], memory)
    for i in range(n):
        f[i] = memory[program.outputs[i]]
        for j in range(m):
            B[i, j] = memory[program.outputs[n + i * m + j]]
    for j in range(m):
        h[j] = memory[program.outputs[n + n * m + j]]


@compiled
def _feedback(decay: float, plan: Any, f: Any, B: Any, inputs: Any, covectors: Any) -> int:
    n, m = B.shape
    drift, u = plan[:n], plan[n:]
    start, end, k, push = covectors[0], covectors[1], inputs[1], inputs[2]
    phi_0 = 2 * decay - 2 * dot(start, drift)
    size = abs(phi_0)
    for i in range(n):
        speed = f[i] + dot(B[i], u)
        phi_0 += 2 * end[i] * speed
        size += abs(end[i] * speed) + abs(start[i] * drift[i])
    for j in range(m):
        push[j] = 0.0
        for i in range(n):
            push[j] += B[i, j] * end[i]
    reach = dot(push, push)
    for j in range(m):
        k[j] = -phi_0 * push[j] / (2 * reach) if phi_0 > 0.0 and reach > 0.0 else 0.0
    return INFEASIBLE if reach == 0.0 and phi_0 > _ROUNDING * size else FOUND


@compiled
def _disturb(waves: Any, lane: Any, layer: float, t: float, x: Any, inputs: Any) -> None:
    n, m = x.shape[0], inputs.shape[1]
    h, push = inputs[0], inputs[2]
    for w in range(waves.shape[0]):
        wave = waves[w]
        value = np.sin(wave[m + n] * t + dot(x, wave[m : m + n]) + wave[m + n + 1])
        for j in range(m):
            h[j] += wave[j] * value
    if lane[0] != 0.0:
        share = lane[0] / np.sqrt(dot(push, push) + layer * layer)
        for j in range(m):
            h[j] += share * push[j]
    clip(h, lane[1])

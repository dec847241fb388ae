"""The slow part of a loop at a point: f, B and h at the state, the geodesic and the feedback at the measured state.

The feedback (0.5) is the smallest k with phi_0 + phi_1'k <= 0: k = 0 if phi_0 <= 0, else -phi_0 phi_1/|phi_1|^2, where
phi_0 = -2 gamma_s(0)'M(f(x*) + B(x*)u*) + 2 gamma_s(1)'M(f(x) + B(x)u*) + 2 rate E and phi_1 = 2 B'M gamma_s(1).

What acts is at the state x; what the controller computes is at the state that it measures. Today it measures x: `seen`
and `measured` are the same memory, and nothing is computed twice.
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
    """f (n,), B (n, m) row by row and the base of h (m,) as one program of t and x; the metric and its rate in 1/s."""

    program: Program
    metric: Metric
    rate: float


class Force(NamedTuple):
    """The disturbance of every lane: waves and pushes (`problem.Disturbance`), the centre taken into the phases.

    `amplitude` (N, W, m), `wave` (N, W, n), `frequency` and `phase` (N, W), `push` and `radius` (N,).
    """

    amplitude: Array
    wave: Array
    frequency: Array
    phase: Array
    push: Array
    radius: Array
    layer: float


class Reference(NamedTuple):
    """The plan at a time: x* (n,), f(x*) + B(x*)u* (n,), u* (m,)."""

    x: Array
    speed: Array
    u: Array


class Moment(NamedTuple):
    """Where a lane is evaluated: its number, t in s, the state and what is measured of it (n,), the plan."""

    lane: int
    t: float
    x: Array
    measured: Array
    plan: Reference


class Model(NamedTuple):
    """f (n,) and B (n, m) at a state."""

    f: Array
    B: Array


class Point(NamedTuple):
    """Working memory and results of `evaluate`.

    `plant`: f and B at the state; `seen`: at the measured state (the same memory as long as these are the same); h (m,)
    at the state, k (m,), `push` = B'M gamma_s(1) (m,).
    """

    memory: Array
    plant: Model
    seen: Model
    h: Array
    k: Array
    push: Array
    curve: Curve


def field(model: ControlAffineModel, base: Sequence[Expression] | None, degree: int) -> tuple[Field, Point]:
    """The slow part of a model's loops, and working memory for it."""
    n, m = len(model.states), len(model.inputs)
    h = [ZERO] * m if base is None else list(base)
    outputs = [*model.f, *(e for row in model.B for e in row), *h]
    program, memory = assemble(outputs, (TIME, *model.states))
    space, curve = metric(model, degree)
    return Field(program, space, float(model.rate)), point(memory, curve, n, m)


def point(memory: Array, curve: Curve, n: int, m: int) -> Point:
    """Fresh results around the memory of a program and of a geodesic."""
    plant = Model(np.zeros(n), np.zeros((n, m)))
    return Point(memory, plant, plant, np.zeros(m), np.zeros(m), np.zeros(m), curve)


def force(d: Disturbance) -> Force:
    """The arrays of a disturbance; its centre goes into the phases."""
    return Force(
        amplitude=_dense(d.amplitude),
        wave=_dense(d.wave),
        frequency=_dense(d.frequency),
        phase=_dense(d.phase - d.wave @ d.centre),
        push=_dense(d.push),
        radius=_dense(d.radius),
        layer=float(d.layer),
    )


def _dense(part: Array) -> Array:
    return np.ascontiguousarray(part, dtype=float)


@compiled
def evaluate(field: Any, force: Any, exact: bool, now: Any, whole: bool, point: Any) -> tuple[int, float]:
    """(status, d(x*, x)^2) at a moment; f, B, h and k go into `point`.

    `exact`: what is measured is the state. Without `whole` the geodesic and k are left out, unless the lane is pushed
    along it.
    """
    _model(field.program, now.t, now.x, point.memory, point.plant)
    m = point.h.shape[0]
    first = field.program.outputs.shape[0] - m
    for j in range(m):
        point.h[j] = point.memory[field.program.outputs[first + j]]
    status, energy = FOUND, 0.0
    if whole or force.push[now.lane] != 0.0:
        if not exact:
            _model(field.program, now.t, now.measured, point.memory, point.seen)
        status, energy = connect(field.metric, point.curve, point.curve.bend, now.plan.x, now.measured)
        if status != FOUND:
            return status, energy
        status = _feedback(field.rate * energy, now.plan, point)
        if not exact and status == FOUND:
            status, energy = connect(field.metric, point.curve, point.curve.bend, now.plan.x, now.x)
    _disturb(force, now, point)
    return status, energy


@compiled
def _model(program: Any, t: float, x: Any, memory: Any, found: Any) -> None:
    """f and B at (t, x); the memory keeps the other outputs."""
    n, m = found.B.shape
    memory[0] = t
    for i in range(n):
        memory[1 + i] = x[i]
    execute(program.steps, program.steps.shape[0], memory)
    for i in range(n):
        found.f[i] = memory[program.outputs[i]]
        for j in range(m):
            found.B[i, j] = memory[program.outputs[n + i * m + j]]


@compiled
def _feedback(decay: float, plan: Any, point: Any) -> int:
    """k of (0.5) at the measured state; `decay` is lambda E."""
    f, B, push, k = point.seen.f, point.seen.B, point.push, point.k
    n, m = B.shape
    start, end = point.curve.vectors[0], point.curve.vectors[1]  # M gamma_s at plan and state
    phi_0 = 2 * decay - 2 * dot(start, plan.speed)  # 2 lambda E - 2 gamma_s(0)'M(f(x*) + B(x*)u*) ...
    size = abs(phi_0)
    for i in range(n):
        speed = f[i] + dot(B[i], plan.u)
        phi_0 += 2 * end[i] * speed  # ... + 2 gamma_s(1)'M(f(x) + B(x)u*)
        size += abs(end[i] * speed) + abs(start[i] * plan.speed[i])
    for j in range(m):
        push[j] = 0.0
        for i in range(n):
            push[j] += B[i, j] * end[i]  # phi_1/2 = B'M gamma_s(1)
    reach = dot(push, push)
    for j in range(m):
        k[j] = (
            -phi_0 * push[j] / (2 * reach) if phi_0 > 0.0 and reach > 0.0 else 0.0
        )  # -phi_0 phi_1/|phi_1|^2
    return INFEASIBLE if reach == 0.0 and phi_0 > _ROUNDING * size else FOUND


@compiled
def _disturb(force: Any, now: Any, point: Any) -> None:
    """Adds the lane's waves and push to its base h, and keeps that in its ball (`problem.Disturbance`)."""
    h, lane = point.h, now.lane
    for w in range(force.phase.shape[1]):
        angle = force.frequency[lane, w] * now.t + dot(now.x, force.wave[lane, w]) + force.phase[lane, w]
        value = np.sin(angle)
        for j in range(h.shape[0]):
            h[j] += force.amplitude[lane, w, j] * value
    if force.push[lane] != 0.0:
        share = force.push[lane] / np.sqrt(dot(point.push, point.push) + force.layer * force.layer)
        for j in range(h.shape[0]):
            h[j] += share * point.push[j]
    clip(h, force.radius[lane])

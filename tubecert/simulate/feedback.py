"""The slow part of a loop at a point: f, B, h and the wind at the state, the geodesic and the feedback.

The feedback (0.5) is the smallest k with phi_0 + phi_1'k <= 0: k = 0 if phi_0 <= 0, else -phi_0 phi_1/|phi_1|^2, where
phi_0 = -2 gamma_s(0)'M(f(x*) + B(x*)u*) + 2 gamma_s(1)'M(f(x) + B(x)u*) + 2 rate E and phi_1 = 2 B'M gamma_s(1).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.expression import ZERO, Expression
from tubecert.expression.matrix import Matrix
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulate.compiled import compiled, folded
from tubecert.simulate.geodesic import FOUND, Curve, Metric, connect, metric
from tubecert.simulate.problem import Beside, Disturbance
from tubecert.simulate.program import Program, assemble, execute
from tubecert.simulate.small import clip, dot

INFEASIBLE = 10
_ROUNDING = 1e-12
_STEEP = 3.0  # how much more than a sine the wave of a wind is a square
_THIN = 0.05  # of the layer: where a wind that aims turns round


class Field(NamedTuple):
    """f (n,), B (n, m), the base of h (m,), E (n, k), row by row, and r (n,) as one program; metric, rate in 1/s.

    The program is one of t, x and the parameters of which ranges are known.
    """

    program: Program
    metric: Metric
    rate: float


class Force(NamedTuple):
    """The disturbance of every lane (`problem.Disturbance`), the centre taken into the phases.

    `amplitude` (N, W, m), `wave` (N, W, n), `frequency` and `phase` (N, W), `push` and `radius` (N,).
    """

    amplitude: Array
    wave: Array
    frequency: Array
    phase: Array
    push: Array
    radius: Array
    beside: Beside
    layer: float


class Reference(NamedTuple):
    """The plan at a time: x* (n,), f(x*) + B(x*)u* (n,), u* (m,)."""

    x: Array
    speed: Array
    u: Array


class Moment(NamedTuple):
    """Where a lane is evaluated: its number, t in s, the state (n,), the plan."""

    lane: int
    t: float
    x: Array
    plan: Reference


class Model(NamedTuple):
    """f (n,) and B (n, m) at a state."""

    f: Array
    B: Array


class Point(NamedTuple):
    """Working memory and results of `evaluate`.

    `plant`: f and B at the state; h (m,) there, k (m,), `push` = B'M gamma_s(1) (m,); E (n, k), w (k,) and `wind` = E w
    (n,).
    """

    memory: Array
    plant: Model
    h: Array
    k: Array
    push: Array
    E: Array
    w: Array
    wind: Array
    curve: Curve


def field(
    model: ControlAffineModel, base: Sequence[Expression] | None, E: Matrix, rest: Matrix, degree: int
) -> tuple[Field, Point]:
    """The slow part of a model's loops, and working memory for it; `rest` (n, 1) acts beside the inputs, or is ()."""
    n, m = len(model.states), len(model.inputs)
    h = [ZERO] * m if base is None else list(base)
    outputs = [*model.f, *(e for row in model.B for e in row), *h, *(e for row in E for e in row)]
    outputs += [row[0] for row in rest]
    program, memory = assemble(outputs, (TIME, *model.states, *dict(model.parameters)))
    space, curve = metric(model, degree)
    sizes = n, m, len(E[0]) if E else 0
    return Field(program, space, float(model.rate)), point(memory, curve, sizes)


def point(memory: Array, curve: Curve, sizes: tuple[int, int, int]) -> Point:
    """Fresh results around the memory of a program and of a geodesic, for n states, m inputs and k winds."""
    n, m, k = sizes
    h, push, feedback = (np.zeros(m) for _ in range(3))
    wind = np.zeros((n, k)), np.zeros(k), np.zeros(n)
    return Point(memory, Model(np.zeros(n), np.zeros((n, m))), h, feedback, push, *wind, curve)


def force(d: Disturbance) -> Force:
    """The arrays of a disturbance; its centre goes into the phases."""
    return Force(
        amplitude=_dense(d.amplitude),
        wave=_dense(d.wave),
        frequency=_dense(d.frequency),
        phase=_dense(d.phase - d.wave @ d.centre),
        push=_dense(d.push),
        radius=_dense(d.radius),
        beside=Beside(*map(_dense, d.beside)),
        layer=float(d.layer),
    )


def _dense(part: Array) -> Array:
    return np.ascontiguousarray(part, dtype=float)


@folded
def evaluate(field: Field, force: Force, now: Moment, point: Point) -> tuple[int, float]:
    """(status, d(x*, x)^2) at a moment; f, B, h, k and the wind go into `point`."""
    n, m = point.plant.B.shape
    theta = force.beside.theta
    for l in range(theta.shape[1]):
        point.memory[1 + n + l] = theta[now.lane, l]
    model(field.program, now.t, now.x, point.memory, point.plant)
    place = n + point.plant.B.size
    for j in range(m):
        point.h[j] = point.memory[field.program.outputs[place + j]]
    for i in range(n):
        for l in range(point.w.shape[0]):
            point.E[i, l] = point.memory[field.program.outputs[place + m + i * point.w.shape[0] + l]]
    status, energy = steer(field, now.plan, now.x, point.plant, point)
    _disturb(force, now, point)
    _blow(force, now, point)
    rest = place + m + point.E.size
    if theta.shape[1] > 0 and field.program.outputs.shape[0] > rest:
        for i in range(n):
            point.wind[i] += point.memory[field.program.outputs[rest + i]]
    return status, energy


@compiled
def steer(field: Field, plan: Reference, x: Array, model: Model, point: Point) -> tuple[int, float]:
    """(status, d(x*, x)^2), and k of (0.5) at x, where the model is known."""
    status, energy = connect(field.metric, point.curve, point.curve.bend, plan.x, x)
    if status == FOUND:
        status = _feedback(field.rate * energy, plan, model, point)
    return status, energy


@compiled
def model(program: Program, t: float, x: Array, memory: Array, found: Model) -> None:
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


@folded
def _feedback(decay: float, plan: Reference, model: Model, point: Point) -> int:
    """k of (0.5) at the end of the geodesic; `decay` is lambda E."""
    f, B, push, k = model.f, model.B, point.push, point.k
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


@folded
def _disturb(force: Force, now: Moment, point: Point) -> None:
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


@folded
def _blow(force: Force, now: Moment, point: Point) -> None:
    """E w: a wave in time, of full size but for its changes of sign, in a direction that aims (`problem.Beside`)."""
    own, lane, w, wind, B = force.beside, now.lane, point.w, point.wind, point.plant.B
    wind[:] = 0.0
    if own.wind[lane] == 0.0:
        return
    aim, wave = own.aim[lane], np.sin(own.gusting[lane, 0] * now.t + own.gusting[lane, 1])
    square = (_THIN * force.layer) ** 2 if aim > 0.0 else 0.0
    for l in range(w.shape[0]):
        w[l] = own.blowing[lane, l] if aim == 0.0 else 0.0
        for i in range(wind.shape[0] if aim > 0.0 else 0):
            w[l] += point.E[i, l] * (point.curve.vectors[1, i] if aim == 1.0 else dot(B[i], point.push))
        square += w[l] * w[l]
    share = own.wind[lane] * min(1.0, max(-1.0, _STEEP * wave)) / np.sqrt(square) if square > 0.0 else 0.0
    for i in range(wind.shape[0]):
        wind[i] = share * dot(point.E[i], w)

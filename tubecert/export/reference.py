"""The controller in numpy, many runs at once: what exported code is compared with.

It runs the very programs that code is printed from, in `double` or with every operation rounded to `float`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.export.blocks import INTEGRATION, NODES
from tubecert.export.controller import Controller, Pieces, Steering
from tubecert.export.geodesics import Swept
from tubecert.export.program import GREATEST, LEAST, RATIO, TABLE, Program, Step
from tubecert.export.tables import looked_up

_NUMPY: Final = {"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan}


def execute(program: Program, *given: Array, real: type = np.float64) -> tuple[Array, ...]:
    """What comes out, each (N, size), of what goes in, (N, size) or (1, size), in the order of the program."""
    memory: list[Array] = []
    inputs = {port.name: values for port, values in zip(program.inputs, given, strict=True)}
    with np.errstate(all="ignore"):
        for step, number in zip(program.steps, program.numbers, strict=True):
            called = next((own for own in program.tables if step.name == f"{TABLE}{own.name}"), None)
            if called is None:
                memory.append(_value(step, real(number), memory, inputs, real))
            else:
                memory.append(looked_up(called, memory[step.places[0]], real))
    lanes = max(len(value) for value in given)
    return tuple(
        np.stack([np.broadcast_to(memory[p], (lanes,)) for p in port.places], axis=1)
        for port in program.outputs
    )


def speeds(own: Swept, x: Array, y: Array, real: type) -> tuple[Array, Array]:
    """The speeds (N, n) at both ends of computed geodesics from x (1, n) to y (N, n)."""
    zero = np.zeros_like(y)
    w = [zero] * own.nodes
    for k in range(own.sweeps + 1):
        p = v = zero
        for each in w:
            p, v = execute(own.onward, p, v, each, real=real)
        first = (y - x) - p
        last = first + v
        p, v = np.broadcast_to(x, y.shape), first
        for j in range(own.nodes if k < own.sweeps else 0):
            (bent,) = execute(own.symbols, *execute(own.halfway, p, v, w[j], real=real), real=real)
            p, v = execute(own.onward, p, v, w[j], real=real)
            w[j] = bent
    return first, last


def _value(step: Step, number: Array, memory: list[Array], given: Mapping[str, Array], real: type) -> Array:
    if step.operation == "input":
        return np.asarray(given[step.name][:, step.index], dtype=real)
    if step.operation == "constant":
        return number
    args = [memory[place] for place in step.places]
    if step.operation == "call":
        function = _NUMPY.get(step.name) or getattr(np, step.name)
        return np.asarray(function(np.asarray(args[0], dtype=np.float64)), dtype=real)
    if step.operation == "choose":
        return _chosen(step.name, args[0], args[1], real)
    a, b = args[0], args[-1]
    match step.operation:
        case "add":
            return a + b
        case "sub":
            return a - b
        case "mul":
            return a * b
        case "div":
            return a / b
    return -a


def _chosen(name: str, a: Array, b: Array, real: type) -> Array:
    if name == LEAST:
        return np.where(a < b, a, b)
    if name == GREATEST:
        return np.where(a > b, a, b)
    if name == RATIO:
        return np.where((a > 0) & (b > 0), a / b, real(0))
    return np.where(a > b, b / a, real(1))


class Handed(NamedTuple):
    """Of a plan that is handed in at a sample: x* (1, n), u* (1, m), and the mean of u* over the last sample."""

    x: Array
    u: Array
    mean: Array


@dataclass(slots=True, kw_only=True)
class Around:
    """Plan, feedback and distance of a controller, for N states side by side; `handed`: the plan at a sample."""

    controller: Steering
    real: type = np.float64
    handed: Handed | None = None

    def plan(self, t: Array) -> tuple[Array, Array]:
        """x* (1, n) and u* (1, m) at a time; beyond the horizon those at its end."""
        c, real = self.controller, self.real
        if self.handed is not None:
            return np.asarray(self.handed.x, dtype=real), np.asarray(self.handed.u, dtype=real)
        if c.horizon is not None:
            t = min(t, real(float(c.horizon)))
        if c.plan is not None:
            x, u = execute(c.plan, np.array([[t]]), real=real)
            return x, u
        return _on_pieces(c.pieces, t, real) if c.pieces is not None else (t, t)

    def kappa(self, y: Array, t: Array) -> tuple[Array, Array]:
        """The feedback (N, m) of (0.5) at (x*(t), y), and d(x*, y)^2 (N,)."""
        c, real = self.controller, self.real
        x, u = self.plan(t)
        (f,), (v,) = execute(c.drift, y, real=real), execute(c.flow, x, u, real=real)
        ends = () if c.swept is None else speeds(c.swept, x, y, real)
        found, told = execute(c.law, y, f, x, v, u, *ends, real=real)
        return found, told[:, 0]

    def metric(self, x: Array) -> Array:
        """M (N, n, n) at states (N, n)."""
        c, n = self.controller, len(self.controller.states)
        if c.swept is None:
            M = np.array([[float(q) for q in row] for row in c.metric])
            return np.broadcast_to(M, (len(x), n, n))
        (W,) = execute(c.swept.dual, x)
        return np.asarray(np.linalg.inv(W.reshape(len(x), n, n)))

    def distance(self, x: Array, t: Array) -> Array:
        """d(x*(t), x) (N,) of states (N, n), as the controller computes it."""
        plan = self.plan(t)[0]
        swept = self.controller.swept
        last = x - plan if swept is None else speeds(swept, plan, x, np.float64)[1]
        return np.asarray(np.sqrt(np.einsum("li,lij,lj->l", last, self.metric(x), last)))


@dataclass(slots=True, kw_only=True)
class Reference(Around):
    """N controllers side by side; `start` and `step` are those of the exported code.

    `feedback` is kappa, with u* where that is held; `held` acts now, `before` acted until it did.
    """

    controller: Controller
    sample: int = 0
    y: Array = field(default_factory=lambda: np.zeros((0, 0)))
    f: Array = field(default_factory=lambda: np.zeros((0, 0)))
    q: Array = field(default_factory=lambda: np.zeros((0, 0)))
    feedback: Array = field(default_factory=lambda: np.zeros((0, 0)))
    held: Array = field(default_factory=lambda: np.zeros((0, 0)))
    before: Array = field(default_factory=lambda: np.zeros((0, 0)))
    square: Array = field(default_factory=lambda: np.zeros(0))

    def start(self, y: Array) -> Array:
        """Forgets everything; the inputs (N, m) that act from 0 on, for what is measured at 0, (N, n)."""
        self.sample = 0
        self.feedback, self.square = self._law(y, self.real(0))
        self.q = np.zeros_like(self.feedback)
        self.held = self.before = self.feedback
        return np.asarray(self.held)

    def step(self, y: Array) -> tuple[Array, Array]:
        """The inputs (N, m) that act a delay from now on, and d(x*, y)^2 (N,) where the feedback looked last."""
        c, real = self.controller, self.real
        (f,) = execute(c.drift, y, real=real)
        estimate = self.q
        if self.sample:
            self.q, estimate = execute(c.estimator, y, f, self.y, self.f, self.q, self.mean(), real=real)
        if self.sample % c.every == 0:
            seen, after = self.predicted(y), c.delay if c.predicts else 0
            self.feedback, self.square = self._law(seen, self.time(after))
        self.before, self.held = self.held, self.feedback - estimate
        self.y, self.f = y, f
        self.sample += 1
        return self.held, self.square

    def time(self, after: Fraction | int = 0) -> Array:
        """A time after the newest sample, in s."""
        begin = self.real(self.sample) * self.real(float(self.controller.sample_time))
        return np.asarray(begin + self.real(float(after)))

    def _law(self, y: Array, t: Array) -> tuple[Array, Array]:
        """The same, with u* where that is held."""
        kappa, square = self.kappa(y, t)
        return (kappa + self.plan(t)[1] if self.controller.adds_plan else kappa), square

    def mean(self) -> Array:
        """The mean of the inputs over the last sample, (N, m)."""
        c, real = self.controller, self.real
        given = [self.held, self.before]
        begin = real(self.sample - 1) * real(float(c.sample_time))
        if c.gauss is not None:
            nodes = [self.plan(begin + real(float(share * c.sample_time)))[1] for share in NODES]
            given += execute(c.gauss, *nodes, real=real)
        elif c.pieces is not None and not c.held:
            given.append(_mean_on_pieces(c.pieces, begin, self.time(), real))
        elif self.handed is not None and not c.held:
            given.append(np.asarray(self.handed.mean, dtype=real))
        (mean,) = execute(c.applied, *given, real=real)
        return mean

    def predicted(self, y: Array) -> Array:
        """Theorem H-P: yp' = f + B (u0 + kappa) over the delay, with the feedback that acts."""
        c, real = self.controller, self.real
        if c.predictor is None:
            return y
        h = c.delay / INTEGRATION
        for k in range(INTEGRATION):
            inputs = [
                self.feedback + (real(0) if c.adds_plan else self.plan(self.time((k + share) * h))[1])
                for share in (Fraction(0), Fraction(1, 2), Fraction(1))
            ]
            (y,) = execute(c.predictor, y, *inputs, real=real)
        return y


def handed_at(controller: Controller, sample: int) -> Handed:
    """What a planner hands in at a sample that follows the pieces of a controller."""
    own, pieces = Reference(controller=controller, sample=sample), controller.pieces
    x, u = own.plan(own.time())
    if pieces is None or not sample:
        return Handed(x, u, u)
    begin = np.float64(sample - 1) * float(controller.sample_time)
    return Handed(x, u, _mean_on_pieces(pieces, np.asarray(begin), own.time(), np.float64))


def _place(pieces: Pieces, t: Array, real: type) -> int:
    """The piece that a time lies in."""
    begins: Array = np.array(pieces.begins, dtype=real)
    return max(0, int(np.max(np.searchsorted(begins, t, side="right"))) - 1)


def _on_pieces(pieces: Pieces, t: Array, real: type) -> tuple[Array, Array]:
    k = _place(pieces, t, real)
    tau = t - real(float(pieces.start[k]))
    x, u = (np.array([[real(float(q)) for q in row] for row in rows[k]]) for rows in (pieces.x, pieces.u))
    return (
        (x[:, 0] + tau * (x[:, 1] + tau * (x[:, 2] + tau * x[:, 3])))[None],
        (u[:, 0] + tau * u[:, 1])[None],
    )


def _mean_on_pieces(pieces: Pieces, begin: Array, end: Array, real: type) -> Array:
    """u* is linear on every piece: its mean there is its value in the middle."""
    k, total, length = _place(pieces, begin, real), real(0), end - begin
    for _ in range(pieces.most):
        last = k + 1 == len(pieces.start)
        until = end if last else min(end, real(float(pieces.start[k + 1])))
        u = np.array([[real(float(q)) for q in row] for row in pieces.u[k]])
        middle = real(0.5) * (begin + until) - real(float(pieces.start[k]))
        total = total + (until - begin) / length * (u[:, 0] + middle * u[:, 1])[None]
        begin = until
        k = k if last or begin == end else k + 1
    return np.asarray(total)

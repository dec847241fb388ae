"""The loop as a computer closes it: samples with noise, commands that are late, inputs that are held. Trusted: no."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final, TypeAlias

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.setting import Controller
from tubecert.simulation.obstacles import in_plane, signed_distance
from tubecert.simulation.plans import integrated
from tubecert.simulation.sampled.attack import Attack, Flags, Lanes
from tubecert.simulation.sampled.families import Course
from tubecert.simulation.sampled.setting import Setting

_ROUNDING: Final = 1e-9  # of a bound: that of floats
_APART: Final = 16  # numbers of runs that are drawn
_DRAWN: Final = 512  # of the first
SINGLE: Final = 2.0**-22
"""Of an input: how far that of a plan in single precision is off."""


Step: TypeAlias = Callable[[Array, Array, Array], Array]
"""Inputs (m, N) for measurements y (n, N), the plan's x* (n, N or 1) now and its u* (m, N or 1) when they act."""
Controllers: TypeAlias = Callable[[int], Step]  # for so many lanes


def linear(tables: Controller, lanes: int) -> Step:
    """The tables in floats.

    Implements: theory of the sampled loop, section 1: delta = M zeta + N dy, zeta+ = F zeta + G dy.
    """
    zeta = np.zeros((tables.size, lanes))

    def step(y: Array, x: Array, u: Array) -> Array:
        delta = tables.M @ zeta + tables.N @ (y - x)
        zeta[...] = tables.F @ zeta + tables.G @ (y - x)
        return np.asarray(u + delta)

    return step


class Seen:
    """What is seen of N lanes, which count as long as their plan is one of its family.

    Of every state |x - x*| / W, of every input |u - u*| / U, (n + m, N): `share`, the largest, at `when` in s, `value`
    of `bound`. `profile` (2, n + m, K): the largest by sample, of random lanes and of adversaries. `left` (N,): when a
    lane was first seen outside, in s (else infinite), by `what`; `slack` (N,): the error of the integration, of the
    tube. Inputs went from `low` to `high` (m,). `path` (K, n, D): some lanes by samples, at the ends of these. `near`
    (O, N): how near lanes came to obstacles.
    """

    def __init__(self, setting: Setting, lanes: Lanes, course: Course) -> None:
        self.setting, self.lanes, self.course, self.N = setting, lanes, course, len(lanes.aimed)
        n, m = setting.loop.B.shape
        self.share, self.when, self.value, self.bound = np.zeros((4, n + m, self.N))
        self.profile = np.zeros((2, n + m, setting.samples))
        self.left, self.what, self.slack = np.full(self.N, np.inf), np.zeros(self.N, int), np.zeros(self.N)
        self.low, self.high = np.full(m, np.inf), np.full(m, -np.inf)
        self.drawn = np.flatnonzero((lanes.number % _APART == 0) & (lanes.number < _DRAWN))
        self.path = np.zeros((setting.samples, n, len(self.drawn)))
        self.near = np.full((len(setting.spec.obstacles), self.N), np.inf)

    def sample(self, k: int, delta: Array, planned: Array, error: Array) -> None:
        """The commands of sample k: u - u*, and u*, as they are held (m, N); `error` of the states (n, N)."""
        own, n = self.setting, len(error)
        error = abs(own.tables.N) @ error + SINGLE * abs(planned)
        self._see(k * own.Ts, k, slice(n, None), delta, error)
        u = (planned + delta)[:, self._counts(k)]
        self.low = np.minimum(self.low, u.min(axis=1, initial=np.inf))
        self.high = np.maximum(self.high, u.max(axis=1, initial=-np.inf))

    def states(self, t: float, k: int, x: Array, plan: Array, error: Array) -> None:
        """Where lanes are at t, within sample k or at its ends, and their plan, (n, N or 1)."""
        own, counts, self.path[k] = self.setting, self._counts(k), x[:, self.drawn]
        self._see(t, k, slice(len(x)), x - plan, error)
        for i, obstacle in enumerate(own.spec.obstacles):
            gap = signed_distance(obstacle, in_plane(own.spec, obstacle, x.T))
            self.near[i] = np.where(counts, np.fmin(self.near[i], gap), self.near[i])
        slack = (error / own.at(k)[: len(x)]).max(axis=0)
        self.slack = np.where(counts, np.fmax(self.slack, slack), self.slack)

    def _counts(self, k: int) -> Flags:
        return np.asarray(k < self.course.ends + np.zeros(self.N))

    def _see(self, t: float, k: int, rows: slice, off: Array, error: Array) -> None:
        """Deviations (c, N) of states or inputs, not known better than by `error` (c, N)."""
        value, bound = np.where(self._counts(k), abs(off), 0.0), self.setting.at(k)[rows]
        share = value / bound
        more = ~(share <= self.share[rows])  # what is no number is more than any
        for name, found in (("share", share), ("when", t), ("value", value), ("bound", bound)):
            kept = getattr(self, name)
            kept[rows] = np.where(more, found, kept[rows])
        outside = ~(value - error <= bound * (1 + _ROUNDING))
        new = outside.any(axis=0) & np.isinf(self.left)
        self.left[new], self.what[new] = t, (rows.start or 0) + outside.argmax(axis=0)[new]
        for group, profile in zip(
            (~self.lanes.aimed, self.lanes.aimed), self.profile[:, rows, k], strict=True
        ):
            np.maximum(profile, np.where(group, share, 0.0).max(axis=1), out=profile)


class _Twin:
    """The lanes of one integration: states x (n, N), the controller, what its commands add to the plan's inputs."""

    def __init__(self, setting: Setting, controller: Step, x: Array, count: int) -> None:
        self.controller, self.x, self.count = controller, x, count
        self.queue = [np.zeros((setting.loop.inputs, x.shape[1]))] * (
            setting.loop.whole + 2
        )  # the last one first

    def sample(self, noise: Array, plan: Array, planned: Array) -> Array:
        """The computer reads its sensors: what it adds (m, N)."""
        delta = self.controller(self.x + noise, plan, planned) - planned
        self.queue = [delta, *self.queue[:-1]]
        return delta


def run(attack: Attack, lanes: Lanes, course: Course, made: Controllers, count: int) -> Seen:
    """Integrates all lanes twice, by `count` steps of RK4 in each part of a sample, and by twice as many.

    What is seen is the second; the difference, about 15 times what the fourth order leaves, is its error.
    """
    own, seen, start = attack.setting, Seen(attack.setting, lanes, course), course.x[0] + lanes.off
    twins = [_Twin(own, made(seen.N), start, finer * count) for finer in (1, 2)]
    parts, whole, m = len(own.lengths), own.loop.whole, own.loop.inputs
    error, goal = np.zeros_like(start), attack.sent(lanes, -1)

    def slope(k: int, ramp: tuple[Array, Array], pushes: Array, t: float, x: Array) -> Array:
        forces = pushes + own.spread @ (ramp[0] + (t / own.Ts - k) * (ramp[1] - ramp[0]))
        if course.inputs is not None:
            forces[:m] += course.inputs(t)
        if own.own is not None:
            h = own.own.run_floats_silenced([*x, np.full(1, t)], (seen.N,))
            forces[:m] += np.where(lanes.own, h, 0.0)
        return own.plant.run_floats_silenced([*x, *lanes.parameters, *forces], (seen.N,))

    with np.errstate(all="ignore"):  # a run that diverges has left its tube before
        for k in range(own.samples):
            now, goal = goal, attack.sent(lanes, k, goal)
            plan, planned, noise = course.x[k * parts], course.held[k + whole + 1], attack.noise(lanes, k)
            seen.states(k * own.Ts, k, twins[1].x, plan, error)
            delta = [twin.sample(noise, plan, planned) for twin in twins][1]
            seen.sample(k, delta, planned, error)
            for part, length in enumerate(own.lengths.tolist()):
                late, t = part < own.acts, k * own.Ts + float(own.nodes[part])
                held = 0.0 if course.inputs is not None else course.held[k if late else k + 1]
                wind = attack.wind(lanes, k, part)
                for twin in twins:
                    pushes = np.vstack([held + twin.queue[whole + late], wind])
                    twin.x = integrated(partial(slope, k, (now, goal), pushes), t, twin.x, length, twin.count)
                error = np.maximum(error, abs(twins[1].x - twins[0].x))
                seen.states(t + length, k, twins[1].x, course.x[k * parts + part + 1], error)
    return seen

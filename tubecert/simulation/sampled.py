"""The loop as a computer closes it: samples with noise, commands that are late, inputs that are held. Trusted: no."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Tables
from tubecert.simulate.clearance import in_plane, signed_distance
from tubecert.simulation.attack import Attack, Lanes
from tubecert.simulation.families import Course

if TYPE_CHECKING:
    from tubecert.controller.compiled import Controller as Code

_ROUNDING: Final = 1e-9  # of a bound: that of floats
_DRAWN: Final = 24  # lanes of the first chunk
_SINGLE: Final = 2.0**-22  # of an input: that of a plan in single precision


class Controller(Protocol):
    """What computes the commands of all lanes, from sample to sample."""

    def step(self, y: Array, x: Array, u: Array) -> Array:
        """Inputs (m, N) for measurements y (n, N), the plan's x* (n, N or 1) now and its u (m, N or 1) then."""
        ...


class Linear:
    """The tables in floats."""

    def __init__(self, tables: Tables, lanes: int) -> None:
        self.tables = tables
        self.memory = np.zeros((len(tables.F.value), lanes))

    def step(self, y: Array, x: Array, u: Array) -> Array:
        """Implements: theory of the sampled loop, section 1: delta = M zeta + N dy, zeta+ = F zeta + G dy."""
        own, dy = self.tables, y - x
        delta = own.M.value @ self.memory + own.N.value @ dy
        self.memory = own.F.value @ self.memory + own.G.value @ dy
        return np.asarray(u + delta)


class Compiled:
    """The C code of a certificate; only of a family the plan is `handed` to it."""

    def __init__(self, code: Code, *, handed: bool) -> None:
        self.code, self.handed = code, handed

    def step(self, y: Array, x: Array, u: Array) -> Array:
        """One call for all lanes."""
        plan = (x.T, u.T) if self.handed else ()
        return np.asarray(self.code.step(y.T, *plan).T)


class Peaks:
    """What is seen of N lanes: of every state |x - x*| / W, of every input |u - u*| / U, (n + m, N).

    `share`: the largest, at `when` in s, `value` of `bound`. `profile` (2, n + m, K): the largest by sample, of random
    lanes and of adversaries. `left` (N,): when a lane was first seen outside, in s (else infinite), with `what`;
    `slack` (N,): the error of the integration, of the tube.
    """

    def __init__(self, size: int, lanes: Lanes, samples: int) -> None:
        N = len(lanes.number)
        self.share, self.when, self.value, self.bound = np.zeros((4, size, N))
        self.profile = np.zeros((2, size, samples))
        self.left, self.what, self.slack = np.full(N, np.inf), np.zeros(N, dtype=int), np.zeros(N)
        self.groups = np.stack([~lanes.aimed, lanes.aimed])

    def see(self, t: float, sample: int, rows: slice, value: Array, bound: Array, error: Array) -> None:  # noqa: PLR0917
        """Values (c, N) of states or inputs, of these numbers, not known better than by `error` (c, N)."""
        share = value / bound
        more = ~(share <= self.share[rows])  # what is no number is more than any
        for kept, new in ((self.share, share), (self.when, t), (self.value, value), (self.bound, bound)):
            kept[rows] = np.where(more, new, kept[rows])
        outside = ~(value - error <= bound * (1 + _ROUNDING))
        first_time = outside.any(axis=0) & np.isinf(self.left)
        self.left[first_time], self.what[first_time] = t, rows.start + outside.argmax(axis=0)[first_time]
        for group, profile in zip(self.groups, self.profile[:, rows, sample], strict=True):
            np.maximum(profile, np.where(group, share, 0.0).max(axis=1), out=profile)


class Sampled:
    """N lanes of the sampled loop, a driver of the engine; `peaks`, and how inputs went, `low` to `high` (m,).

    `path` (K + 1, n, D): some of the lanes by samples. `near` (O, N): how near lanes came to obstacles. Lanes count as
    long as their plan is one of its family.
    """

    def __init__(self, attack: Attack, lanes: Lanes, course: Course, controller: Controller) -> None:
        self.attack, self.lanes, self.course, self.controller = attack, lanes, course, controller
        self.setting = own = attack.setting
        self.n, self.m, self.N = len(own.spec.states), len(own.spec.inputs), len(lanes.number)
        self.peaks = Peaks(self.n + self.m, lanes, own.samples)
        self.low, self.high = np.full(self.m, np.inf), np.full(self.m, -np.inf)
        self.queue = [np.zeros((self.m, self.N))] * (own.loop.whole + 1)  # of v_1, v_2 ..: the last one first
        self.goal = self.now = np.clip(
            attack.goal(lanes, -1), -own.band.first[:, None], own.band.first[:, None]
        )
        self.own, self.signal = np.flatnonzero(lanes.own), np.where(lanes.own, 0.0, 1.0)
        self.drawn = np.arange(0, self.N, -(-self.N // _DRAWN)) if lanes.number[0] == 0 else np.arange(0)
        self.path = np.full((own.samples + 1, self.n, len(self.drawn)), np.nan)
        self.near = np.full((len(own.spec.obstacles), self.N), np.inf)
        self.error = np.zeros((self.n, self.N))
        self.step = -1  # number of the part that is integrated

    def start(self) -> Array:
        """x* and what the start is off by."""
        return np.asarray(self.course.x[0] + self.lanes.start)

    def steps(self) -> Iterator[tuple[float, float]]:
        """The parts of all samples."""
        own = self.setting.nominal
        for k in range(self.setting.samples):
            for node, length in zip(own.nodes.tolist(), own.lengths.tolist(), strict=False):
                yield k * self.setting.Ts + node, length

    def instant(self, t: float, x: Array) -> None:
        """A part begins; at the first of a sample the computer reads its sensors."""
        own = self.setting.nominal
        self.step += 1
        k, part = divmod(self.step, len(own.lengths))
        if part == 0:
            self._sample(t, k, x)
        late = part < own.acts
        self.base = self.course.held[k if late else k + 1]
        self.added = self.queue[own.whole + late]
        self.u = self.base + self.added
        self.wind = self.attack.wind(self.lanes, k, part)
        self.begin, self.length = t, own.lengths[part]
        share = own.nodes[part : part + 2] / self.setting.Ts
        self.slow = tuple(self.now + s * (self.goal - self.now) for s in share)

    def _sample(self, t: float, k: int, x: Array) -> None:
        own, plan = self.setting, self.course.x[self.step]
        self.path[k] = x[:, self.drawn]
        planned = self.course.held[k + own.loop.whole + 1]
        u = self.controller.step(x + self.attack.noise(self.lanes, k), plan, planned)
        delta = u - planned
        self.queue = [delta, *self.queue[: own.loop.whole + 1]]
        most = own.band.rate[:, None] * own.Ts
        self.now = self.goal
        self.goal = np.clip(self.attack.goal(self.lanes, k), self.now - most, self.now + most)
        error = abs(own.nominal.N) @ self.error + _SINGLE * abs(planned)
        self._see(t, k, self.n, delta, error)
        self._see(t, k, 0, x - plan, self.error)
        kept = u[:, k < self.course.ends * np.ones(self.N)]
        self.low = np.minimum(self.low, kept.min(axis=1, initial=np.inf))
        self.high = np.maximum(self.high, kept.max(axis=1, initial=-np.inf))

    def _see(self, t: float, k: int, first: int, value: Array, error: Array) -> None:
        rows, counts = slice(first, first + len(value)), k < self.course.ends
        bound = self.setting.at(k)[rows]
        self.peaks.see(t, k, rows, np.where(counts, abs(value), 0.0), bound, error)

    def at(self, t: float, x: Array) -> Array:
        """x' of all lanes."""
        own, lanes = self.setting, self.lanes
        share = (t - self.begin) / self.length
        slow = self.slow[0] + share * (self.slow[1] - self.slow[0])
        u = self.u.copy() if self.course.inputs is None else self.added + self.course.inputs(t)
        matched = own.band.matched
        for j, h in zip(matched, slow, strict=False):
            u[j] += self.signal * h
        if own.own is not None and len(columns := self.own):
            u[:, columns] += own.own.run_floats_silenced([*x[:, columns], np.full(1, t)], (len(columns),))
        wind = self.wind
        if len(slow) > len(matched):
            wind = wind + slow[len(matched) :]
        return own.plant.run_floats_silenced([*x, *lanes.parameters, *u, *wind], (self.N,))

    def seen(self, t: float, x: Array, error: Array) -> None:
        """A part has ended."""
        k = self.step // len(self.setting.nominal.lengths)
        self.error = np.maximum(self.error, error)
        e = x - self.course.x[self.step + 1]
        self._see(t, k, 0, e, self.error)
        self.path[k + 1] = x[:, self.drawn]
        counts = k < self.course.ends
        for i, obstacle in enumerate(self.setting.spec.obstacles):
            gap = signed_distance(obstacle, in_plane(self.setting.spec, obstacle, x.T))
            self.near[i] = np.where(counts, np.fmin(self.near[i], gap), self.near[i])
        slack = (self.error / self.setting.at(k)[: self.n]).max(axis=0)
        self.peaks.slack = np.where(counts, np.fmax(self.peaks.slack, slack), self.peaks.slack)

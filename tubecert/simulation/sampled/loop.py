"""The loop as a computer closes it: samples with noise, commands that are late, inputs that are held. Trusted: no."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import ceil
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.record import Tables
from tubecert.simulation.halving import Places
from tubecert.simulation.lanes import SHARES, Found, Steps
from tubecert.simulation.obstacles import in_plane, signed_distance
from tubecert.simulation.sampled.attack import Attack, Lanes
from tubecert.simulation.sampled.families import Course, course_of, courses
from tubecert.simulation.sampled.setting import Setting

_PACE: Final = 0.15  # |A| times the length of a step of the first level
_OUTPUTS: Final = 250  # times at which runs are compared, and drawn
_LIMIT: Final = 100  # shares of what is proven, beyond which nobody is followed
NOBODYS, DIVERGED = -1, 1  # why a lane is stopped: its plan is none of its family, or it is far outside

Step: TypeAlias = Callable[[Array, Array, Array], Array]
"""Inputs (m, N) for measurements y (n, N), the plan's x* (n, N or 1) now and its u* (m, N or 1) when they act."""
Controllers: TypeAlias = Callable[[int], Step]  # for so many lanes


def linear(tables: Tables, lanes: int) -> Step:
    """The tables in floats.

    Implements: theory of the sampled loop, section 1: delta = M zeta + N dy, zeta+ = F zeta + G dy.
    """
    zeta = np.zeros((tables.size, lanes))

    def step(y: Array, x: Array, u: Array) -> Array:
        delta = tables.M @ zeta + tables.N @ (y - x)
        zeta[...] = tables.F @ zeta + tables.G @ (y - x)
        return np.asarray(u + delta)

    return step


class Sampled:
    """Some lanes in the steps of a level: a `lanes.System`. All parts of all samples have `count` steps.

    What is seen, at the ends of parts: `x`, `share` (n + m, N) of |x - x*| and of |u - u*| of the last command, that
    command `u`, distances from obstacles `near` (O, N). `profile` (2, n + m, K): the largest share by sample, of random
    lanes and of adversaries.
    """

    kept = ("x",)

    def __init__(self, attack: Attack, lanes: Lanes, course: Course, made: Controllers, count: int) -> None:
        self._attack, self._own, self._lanes, self._course = attack, attack.setting, lanes, course
        self._made, self._count, own = made, count, attack.setting
        parts = (
            np.array(own.nodes[:-1], dtype=float)[:, None] + own.lengths[:, None] * np.arange(count) / count
        )
        start = np.append(np.add.outer(np.arange(own.samples) * own.Ts, parts.ravel()), own.samples * own.Ts)
        length = np.append(np.tile(np.repeat(own.lengths / count, count), own.samples), 0.0)
        self.steps = Steps(start, length, outputs(own) * parts.size)
        self.profile = np.zeros((2, len(own.names), own.samples))

    def start(self) -> Array:
        """x (n, N) at the start."""
        N = len(self._lanes.number)
        self.stopped = np.zeros(N, dtype=np.int64)
        self._controller, self._goal = self._made(N), self._attack.sent(self._lanes, -1)
        nothing = np.zeros((self._own.loop.inputs, N))
        self._queue = [nothing] * (
            self._own.loop.whole + 2
        )  # what commands add to the plan's, the last one first
        return np.asarray(self._course.x[0] + self._lanes.off)

    def at(self, step: int, stage: int, x: Array) -> Array:
        """f + B (u + h) + E w, (n, N)."""
        node, inner = divmod(step, self._count)
        if stage == 0 and inner == 0 and step < len(self.steps.start) - 1:
            self._enter(*divmod(node, len(self._own.lengths)), x)
        own, t = self._own, float(self.steps.start[step] + SHARES[stage] * self.steps.length[step])
        now, goal = self._ramp
        forces = self._pushes + own.spread @ (now + (t / own.Ts - self._sample) * (goal - now))
        m = own.loop.inputs
        if self._course.inputs is not None:
            forces[:m] += self._course.inputs(t)
        if own.own is not None:
            h = own.own.run_floats_silenced([*x, np.full(1, t)], x.shape[1:])
            forces[:m] += np.where(self._lanes.own, h, 0.0)
        return own.plant.run_floats_silenced([*x, *self._lanes.parameters, *forces], x.shape[1:])

    def _enter(self, k: int, part: int, x: Array) -> None:
        """What acts in a part of sample k; at its start the computer reads its sensors."""
        own, course, attack, lanes = self._own, self._course, self._attack, self._lanes
        if part == 0:
            self._sample, now = k, self._goal
            self._goal = attack.sent(lanes, k, now)
            self._ramp = now, self._goal
            self._planned = course.held[k + own.loop.whole + 1]
            measured = x + attack.noise(lanes, k)
            delta = self._controller(measured, course.x[k * len(own.lengths)], self._planned) - self._planned
            self._queue = [delta, *self._queue[:-1]]
            self.stopped[(self.stopped == 0) & (k >= course.ends)] = NOBODYS
        late = part < own.acts
        held = 0.0 if course.inputs is not None else course.held[k if late else k + 1]
        pushed = held + self._queue[own.loop.whole + late]
        self._pushes = np.vstack([pushed, attack.wind(lanes, k, part)])

    def instant(self, step: int, x: Array, slope: Array) -> dict[str, Array]:
        """What is seen at the start of a step; within a part what was seen before."""
        node, inner = divmod(step, self._count)
        if inner == 0:
            own, spec, delta = self._own, self._own.spec, self._queue[0]
            share = np.vstack([abs(x - self._course.x[node]), abs(delta)]) / own.at(self._sample)[:, None]
            share = np.nan_to_num(share, nan=np.inf)
            self.stopped[(self.stopped == 0) & (share.max(axis=0) > _LIMIT)] = DIVERGED
            live, aimed = self.stopped == 0, self._lanes.aimed
            for profile, group in zip(
                self.profile[..., self._sample], (live & ~aimed, live & aimed), strict=True
            ):
                np.maximum(profile, np.where(group, share, 0.0).max(axis=1), out=profile)
            gaps = [signed_distance(obstacle, in_plane(spec, obstacle, x.T)) for obstacle in spec.obstacles]
            near = np.array(gaps).reshape(-1, x.shape[1])
            self._seen = {"x": x, "share": share, "u": self._planned + delta, "near": near}
        return self._seen

    def step(self, step: int) -> float:
        """Nothing goes on beside x."""
        return 0.0

    def sizes(self, rows: Mapping[str, Array]) -> dict[str, Array]:
        """What peaks are taken of: shares by state and input, and how near obstacles are, the less the larger."""
        shares = {name: rows["share"][:, i] for i, name in enumerate(self._own.names)}
        return shares | {gap(i): -rows["near"][:, i] for i in range(rows["near"].shape[1])}


def gap(obstacle: int) -> str:
    """The name of the peak of an obstacle."""
    return f"obstacle {obstacle}"


def outputs(setting: Setting) -> NDArray[np.int64]:
    """Numbers of the samples at whose start runs are compared, (K,), and of the one after the last."""
    return np.unique(np.linspace(0, setting.samples, _OUTPUTS + 1).astype(np.int64))


class Vector:
    """Lanes of an attack, whose steps can be made shorter: a `halving.Vector`."""

    def __init__(self, attack: Attack, lanes: Lanes, made: Controllers) -> None:
        own, bundle = attack.setting, attack.setting.spec.trajectory.bundle
        self._attack, self._lanes, self._made, self.N = attack, lanes, made, len(lanes.number)
        self.course = course_of(own) if bundle is None else courses(own, bundle, lanes.draws.plan)
        self.times = np.asarray(outputs(own) * own.Ts, dtype=float)
        self.profile = np.zeros((2, len(own.names), own.samples))
        size = float(abs(own.loop.A).sum(axis=1).max() * own.lengths.max())
        self._count = max(1, ceil(size / _PACE))

    def system(self, lanes: Places, level: int) -> Sampled:
        """Some of the lanes at a level."""
        own, course = self._lanes.of(lanes), self.course.of(lanes)
        system = Sampled(self._attack, own, course, self._made, self._count * 2**level)
        self.profile = system.profile if len(lanes) == self.N else np.maximum(self.profile, system.profile)
        return system

    def apart(self, lanes: Places, finer: Found, coarser: Found) -> tuple[Array, Array]:
        """Differences of states in shares of what is proven; lanes whose plan is over are not apart."""
        own = self._attack.setting
        bounds = own.at(np.minimum(outputs(own), own.samples - 1)).T[:, : own.loop.states, None]
        shares = abs(finer.seen["x"] - coarser.seen["x"]) / bounds
        return np.nan_to_num(shares).max(axis=1), np.zeros(shares.shape[2])

"""The loop as a computer closes it: samples with noise, commands that are late, inputs that are held. Trusted: no."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import ceil
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from tubecert.controller.recursion import Step
from tubecert.enclosure.interval import Array
from tubecert.simulation.obstacles import in_plane, signed_distance
from tubecert.simulation.plans import integrated
from tubecert.simulation.sampled.attack import Attack, Lanes
from tubecert.simulation.sampled.setting import Integers

_PACE: Final = 0.15  # |A| times the length of a step, before steps are halved
_HALVED: Final = 6  # times at most
_ENOUGH: Final = 5e-3  # of a half-width, that a run may be wrong by
_DRAWN: Final = 16  # of how many runs one is
_LIMIT: Final = 100  # shares of what is proven, beyond which nobody is followed
NOBODYS, DIVERGED = -1, 1  # why a lane is stopped: its plan is none of its family, or it is far outside

Controllers: TypeAlias = Callable[[int], Step]  # for so many lanes


class Seen(NamedTuple):
    """What N lanes leave behind, seen at nodes as long as nothing stopped them.

    `most` (n + m + O + 2 m, N), and at which `node` of all: shares of |x - x*|, and of |u - u*| of the last command,
    how far into obstacles, -u, u. Why a lane `stopped`, 0 if nothing did, and the `error` of the integration as a share
    of a half-width, (N,). `x` (S, n, N) at `outputs`, of some. `profile` (2, n + m, K): the largest share by sample,
    of random lanes and of adversaries.
    """

    most: Array
    node: Integers
    stopped: Integers
    error: Array
    x: Array
    profile: Array


def resolved(attack: Attack, made: Controllers, numbers: range) -> Seen:
    """What is seen of some runs in steps that are halved until none is wrong by much, or it is far outside twice.

    An error is twice the difference to steps twice as long, mostly far above the true one; inf for what diverged.
    """
    own, lanes = attack.setting, Lanes(attack, numbers)
    count = max(1, ceil(abs(own.loop.A).sum(axis=1).max() * own.lengths.max() / _PACE))
    found, bounds = Run(lanes, made, count).seen(), own.limits[own.outputs, : own.loop.states, None]
    for level in range(1, _HALVED + 1):
        coarse, found = found, Run(lanes, made, count * 2**level).seen()
        apart = np.nan_to_num(abs(found.x - coarse.x) / bounds).max(axis=(0, 1))  # nan: the plan is over
        far, before = found.stopped == DIVERGED, coarse.stopped == DIVERGED
        found = found._replace(error=np.where(far | before, np.inf, 2 * apart))
        if ((found.error <= _ENOUGH) | (far & before)).all():
            break
    return found._replace(x=found.x[..., ::_DRAWN])


class Run:
    """Some lanes from start to end, each part of a sample in `count` Runge-Kutta steps."""

    def __init__(self, lanes: Lanes, made: Controllers, count: int) -> None:
        own, N, shares = lanes.setting, len(lanes), len(lanes.setting.names)
        beside = len(own.spec.obstacles) + 2 * own.loop.inputs
        self._lanes, self._own, self._course, self._count = lanes, own, lanes.course, count
        self._controller, (*_, self._slow) = made(N), lanes.signals(-1)
        self._added = [np.zeros((own.loop.inputs, N))] * (own.loop.whole + 2)  # by commands, the last first
        self._found = Seen(
            most=np.append(np.zeros((shares, N)), np.full((beside, N), -np.inf), axis=0),
            node=np.zeros((shares + beside, N), dtype=np.int64),
            stopped=np.zeros(N, dtype=np.int64),
            error=np.full(N, np.inf),
            x=np.full((len(own.outputs), own.loop.states, N), np.nan),
            profile=np.zeros((2, shares, own.samples)),
        )
        self._shown = dict(zip(own.outputs.tolist(), self._found.x, strict=True))

    def seen(self) -> Seen:
        """Node after node, until nobody goes on."""
        own, x, last = self._own, self._course.x[0] + self._lanes.off, len(self._own.t) - 1
        with np.errstate(all="ignore"):
            for node in range(last):
                k, part = divmod(node, len(own.lengths))
                if part == 0:
                    self._sample(k, x)
                self._look(node, k, x)
                if self._found.stopped.all():
                    return self._found
                x = self._moved(k, part, x)
            self._look(last, own.samples - 1, x)
        return self._found

    def _sample(self, k: int, x: Array) -> None:
        """The computer reads its sensors, and its command is sent."""
        own, course, now, stopped = self._own, self._course, self._slow, self._found.stopped
        noise, self._winds, self._slow = self._lanes.signals(k, now)
        self._ramp = now, self._slow - now
        self._planned = course.held[k + own.loop.whole + 1]
        sent = self._controller(x + noise, course.x[k * len(own.lengths)], self._planned)
        self._added = [sent - self._planned, *self._added[:-1]]
        stopped[(stopped == 0) & (k >= course.ends)] = NOBODYS

    def _moved(self, k: int, part: int, x: Array) -> Array:
        """The states (n, N) after a part of sample k."""
        own, late = self._own, part < self._own.acts
        held = 0.0 if self._course.inputs else self._course.held[k if late else k + 1]
        pushes = np.vstack([held + self._added[own.loop.whole + late], self._winds[part]])
        length = float(own.lengths[part])
        return integrated(partial(self._slope, k, pushes), float(own.nodes[part]), x, length, self._count)

    def _slope(self, k: int, pushes: Array, s: float, x: Array) -> Array:
        """f + B (u + h) + E w at a time s of sample k, (n, N)."""
        own, (now, further), shape = self._own, self._ramp, x.shape[1:]
        m, t = own.loop.inputs, k * own.Ts + s
        forces = pushes + own.spread @ (now + s / own.Ts * further)
        if self._course.inputs:
            forces[:m] += self._course.inputs(t)
        if own.h is not None:
            h = own.h.run_floats_silenced([*x, np.full(1, t)], shape)
            forces[:m] += np.where(self._lanes.own, h, 0.0)
        return own.plant.run_floats_silenced([*x, *forces, *self._lanes.parameters], shape)

    def _look(self, node: int, k: int, x: Array) -> None:
        """Keeps what is seen of the lanes that go on, at a node of sample k."""
        own, found, delta, aimed = self._own, self._found, self._added[0], self._lanes.aimed
        off = np.vstack([abs(x - self._course.x[node]), abs(delta)])
        share = np.nan_to_num(off / own.limits[node, :, None], nan=np.inf)
        found.stopped[(found.stopped == 0) & (share.max(axis=0) > _LIMIT)] = DIVERGED
        live, u = found.stopped == 0, self._planned + delta
        for profile, group in zip(found.profile[..., k], (live & ~aimed, live & aimed), strict=True):
            np.maximum(profile, np.where(group, share, 0.0).max(axis=1), out=profile)
        into = [-signed_distance(each, in_plane(own.spec, each, x.T)) for each in own.spec.obstacles]
        seen = np.vstack([share, *into, -u, u])
        higher = live & (seen > found.most)
        found.most[higher], found.node[higher] = seen[higher], node
        if node in self._shown:
            self._shown[node][:, live] = x[:, live]

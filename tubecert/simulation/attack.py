"""Who drives the lanes: adversaries, who know the kernel of what they aim at, and random square waves.

An adversary aims at one state or input, at one sample, then again at as many samples later: noise and wind take the
sign of the kernel, h goes where `kernels.goals` sends it. Run i of a seed is the same in every campaign. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.setting import Size
from tubecert.simulation.families import numbers, waves
from tubecert.simulation.kernels import Kernel, goals
from tubecert.simulation.setting import Setting

Integers = NDArray[np.int64]
_LAGS: Final = 5000  # of the loop that an adversary looks back, at most
_SETTLED: Final = 1e-4  # of the largest start: where the loop has forgotten it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Aim:
    """What an adversary wants: the greatest or the least (`sign`) of state or input `index` at sample `sample`.

    `own`: h is the specification's, else one of the same size and speed that does its worst.
    """

    index: int
    sample: int
    sign: int
    own: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lanes:
    """N runs: their numbers, which are adversaries `aimed` (N,), which have the specification's h, what they draw.

    `index`, `sample`, `sign` (N,) as in `Aim`; `draws` (N, width) uniform in [0, 1); `parameters` (p, N), `start`
    (n, N) about x*(0).
    """

    number: Integers
    aimed: NDArray[np.bool_]
    own: NDArray[np.bool_]
    index: Integers
    sample: Integers
    sign: Array
    draws: Array
    parameters: Array
    start: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Attack:
    """The adversaries of a setting, and the signals of any lanes."""

    setting: Setting
    seed: int

    @cached_property
    def kernels(self) -> tuple[Kernel, ...]:
        """Of every state, at the node of a sample where it gets furthest, then of every input."""
        own, lags = self.setting.nominal, min(self.setting.samples + 1, _LAGS)
        last = len(own.nodes) - 1
        states = (
            max((own.state(i, node, lags) for node in range(1, last + 1)), key=self._reach)
            for i in range(len(own.A))
        )
        return *states, *(own.input(j, lags) for j in range(own.B.shape[1]))

    def _reach(self, kernel: Kernel) -> float:
        own = self.setting
        steady = abs(kernel.h @ self.columns).sum(axis=0) @ own.band.size
        parts = (
            abs(kernel.noise) @ own.loop.noise.each,
            abs(kernel.wind) @ own.gusts.each,
            abs(kernel.start) @ own.loop.start.box,
        )
        return float(steady + sum(part.sum() for part in parts))

    @property
    def columns(self) -> Array:
        """Through which the slow signals act, (n, r)."""
        own = self.setting
        winds = len(own.band.size) - len(own.band.matched)
        return np.hstack([own.nominal.B[:, list(own.band.matched)], own.nominal.E[:, :winds]])

    @cached_property
    def _tables(self) -> tuple[Array, Array, Array, Array]:
        """By functional and lag: noise (F, L + 1, n), wind (F, L + 1, P, k), goals of h (F, L + 1, r), start (.., n).

        The last lag stands for all that are longer: nothing is known of them.
        """
        own, Ts = self.setting, self.setting.Ts
        band = own.band
        aims = [
            np.stack(
                [
                    goals(weights, size, rate * Ts)
                    for weights, size, rate in zip((k.h @ self.columns).T, band.size, band.rate, strict=True)
                ],
                axis=-1,
            )
            if len(band.size)
            else np.zeros((len(k.h), 0))
            for k in self.kernels
        ]
        raw = (
            worst_of(np.stack([k.noise for k in self.kernels]), own.loop.noise.length),
            worst_of(np.stack([k.wind for k in self.kernels]), own.gusts.length),
            np.stack(aims),
            np.stack([k.start for k in self.kernels]),
        )
        empty = [np.zeros_like(part[:, :1]) for part in raw]
        noise, wind, goal, start = (
            np.concatenate([part, none], axis=1) for part, none in zip(raw, empty, strict=True)
        )
        return noise, wind, goal, start

    @cached_property
    def aims(self) -> tuple[Aim, ...]:
        """Every adversary: both signs of every functional, early, where stages begin, and in the long run."""
        own, last = self.setting, self.setting.samples - 1
        size = max(abs(k.start).max() for k in self.kernels)
        memory = max(int(np.count_nonzero(abs(k.start).max(axis=1) > _SETTLED * size)) for k in self.kernels)
        doubled = (2**i for i in range(memory.bit_length()))
        wanted = {0, memory, last, *doubled, *own.stages.tolist()}
        samples = sorted(k for k in wanted if k <= last)
        modes = [True] if own.own is not None or not own.band.matched else []
        modes += [False] if len(own.band.matched) else []
        return tuple(
            Aim(index=index, sample=sample, sign=sign, own=mode)
            for mode, sample, index, sign in product(modes, samples, range(len(own.names)), (1, -1))
        )

    def lanes(self, first: int, last: int) -> Lanes:
        """Runs first .. last - 1: adversaries, then random ones."""
        own, numbers = self.setting, np.arange(first, last)
        width = self._width
        draws = np.stack(
            [
                np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(k,))).random(width)
                for k in numbers.tolist()
            ]
        )
        aims = [self.aims[k] if k < len(self.aims) else None for k in numbers.tolist()]
        aimed = np.array([aim is not None for aim in aims])
        drawn = (own.own is not None) & ((draws[:, 0] < 0.5) | (not own.band.matched))
        sample = np.array([aim.sample if aim else 0 for aim in aims])
        index = np.array([aim.index if aim else 0 for aim in aims])
        sign = np.array([aim.sign if aim else 1.0 for aim in aims], dtype=float)
        return Lanes(
            number=numbers,
            aimed=aimed,
            own=np.array([aim.own if aim else False for aim in aims]) | (~aimed & drawn),
            index=index,
            sample=sample,
            sign=sign,
            draws=draws,
            parameters=self._parameters(draws),
            start=self._start(draws, aimed, index, sample, sign),
        )

    @property
    def _sizes(self) -> tuple[int, int, int, int, int, int]:
        """How many numbers each part of a lane's draws has: kind, parameters, start, noise, wind, h."""
        own = self.setting
        n, k, r = len(own.loop.noise.each), len(own.gusts.each), len(own.band.size)
        return 1, 2 * len(own.ranges), n + 1, 3 * n, 3 * k, 3 * r

    @property
    def _width(self) -> int:
        return sum(self._sizes) + numbers(self.setting)

    def _part(self, draws: Array, index: int) -> Array:
        """Part `index` of what lanes have drawn, (size, N)."""
        ends = np.cumsum([0, *self._sizes])
        return draws[:, ends[index] : ends[index + 1]].T

    def _parameters(self, draws: Array) -> Array:
        """Corners of the ranges, for half of them, or anywhere, (p, N)."""
        part, kind = np.split(self._part(draws, 1), 2)
        share = np.where(kind < 0.5, np.round(part), part)
        low, high = self.setting.ranges.T[:, :, None]
        return np.asarray(low + share * (high - low))

    def _start(self, draws: Array, aimed: Array, index: Array, sample: Array, sign: Array) -> Array:
        """x(0) - x*(0), (n, N)."""
        own, table = self.setting.loop.start, self._tables[3]
        part = self._part(draws, 2)
        worst = table[index, np.minimum(sample, table.shape[1] - 1)].T * sign
        worst = np.where(aimed & (abs(worst).max(axis=0) > 0), worst, 2 * part[:-1] - 1)
        inside = np.where(aimed | (part[-1] < 0.5), 1.0, part[-1])
        around = worst_of(worst.T, own.length > 0).T * (own.length or own.box[:, None])
        return np.asarray(own.known.mid + inside * around)

    def noise(self, lanes: Lanes, k: int) -> Array:
        """What the measurements of sample k are wrong by, (n, N)."""
        own = self.setting
        raw = self._mixed(lanes, self._tables[0], k, self._waves(lanes, 3, k))
        return _within(raw, own.loop.noise)

    def wind(self, lanes: Lanes, k: int, part: int) -> Array:
        """The sudden wind in a part of sample k, (k, N)."""
        own = self.setting
        waves = self._waves(lanes, 4, k + part / len(own.nominal.lengths))
        return _within(self._mixed(lanes, self._tables[1][:, :, part], k, waves), own.gusts)

    def goal(self, lanes: Lanes, k: int) -> Array:
        """Where the slow signals are sent in sample k, (r, N); before the first, k = -1: where they start."""
        size = self.setting.band.size[:, None]
        return self._mixed(lanes, self._tables[2], k, size * self._waves(lanes, 5, k))

    def _mixed(self, lanes: Lanes, table: Array, k: int, waves: Array) -> Array:
        """Of adversaries the table's, of the others the waves."""
        period = lanes.sample + 1
        lag = np.minimum(lanes.sample - k if k < 0 else (lanes.sample - k) % period, table.shape[1] - 1)
        return np.where(lanes.aimed, table[lanes.index, lag].T * lanes.sign, waves)

    def _waves(self, lanes: Lanes, part: int, k: float) -> Array:
        """The square waves of a part of the draws, (c, N)."""
        return waves(self._part(lanes.draws, part), self.setting.samples, k)

    def planned(self, lanes: Lanes) -> Array:
        """What is left for plans of a family, (.., N)."""
        return lanes.draws[:, sum(self._sizes) :].T


def worst_of(table: Array, ball: bool) -> Array:
    """The worst signals (.., c) for kernels (.., c), however small these are: signs, or directions."""
    if not ball or not table.shape[-1]:
        return np.sign(table)
    largest = abs(table).max(axis=-1, keepdims=True)
    scaled = table / np.where(largest > 0, largest, 1.0)
    length = np.sqrt((scaled**2).sum(axis=-1, keepdims=True))
    return np.asarray(scaled / np.where(length > 0, length, 1.0))


def _within(raw: Array, bound: Size) -> Array:
    """Signals (c, N) of size 1 or less, in the units of their bounds."""
    length = np.sqrt((raw**2).sum(axis=0)) if bound.length else 1.0
    return np.asarray(raw / np.maximum(1.0, length) * bound.each[:, None])

"""Who drives the lanes: adversaries, who know the kernel of what they aim at, and random square waves.

An adversary aims at one state or input, at one sample, then again at as many samples later: noise and wind take the
sign of the kernel, h goes where `kernels.goals` sends it. Run i of a seed is the same in every campaign. Trusted: no.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.setting import Size
from tubecert.simulation.plans import waves
from tubecert.simulation.sampled.families import drawn
from tubecert.simulation.sampled.kernels import Kernels, goals, kernels_of
from tubecert.simulation.sampled.setting import Setting

Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]
_LAGS: Final = 5000  # of the loop that an adversary looks back, at most
_SETTLED: Final = 1e-4  # of the largest start: where the loop has forgotten it


class Draws(NamedTuple):
    """Uniform in [0, 1), (.., N), by what they are for."""

    kind: Array
    parameters: Array
    start: Array
    noise: Array
    wind: Array
    slow: Array
    plan: Array


class Lanes(NamedTuple):
    """N runs, by their numbers: which are adversaries (`aimed`), which have the specification's h (`own`), all (N,).

    Adversaries want the greatest or the least (`sign`) of state or input `target` at `sample`. Half of the
    `parameters` (p, N) are corners; `off` (n, N): x(0) - x*(0).
    """

    number: Integers
    aimed: Flags
    own: Flags
    sample: Integers
    target: Integers
    sign: Integers
    draws: Draws
    parameters: Array
    off: Array

    def of(self, lanes: NDArray[np.intp]) -> Lanes:
        """Some of them, by their places."""
        parts: list[Any] = [
            Draws(*(draws[..., lanes] for draws in part)) if isinstance(part, Draws) else part[..., lanes]
            for part in self
        ]
        return Lanes(*parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class Attack:
    """The adversaries of a setting, and the signals of any lanes."""

    setting: Setting
    seed: int

    @cached_property
    def kernels(self) -> Kernels:
        """Of every state, then of every input."""
        return kernels_of(self.setting, min(self.setting.samples + 1, _LAGS))

    @cached_property
    def worst(self) -> Kernels:
        """What does most to each functional, lag by lag, as shares; of all that are longer nothing is known: 0."""
        own, slow = self.setting, np.zeros_like(self.kernels.slow)
        for f, r in np.ndindex(slow.shape[1:]):
            size, rate = float(own.slow.size[r]), float(own.slow.rate[r]) * own.Ts
            slow[:, f, r] = goals(self.kernels.slow[:, f, r], size, rate)
        noise = worst_of(self.kernels.noise, own.loop.noise.length)
        wind = worst_of(self.kernels.wind, own.gusts.length)
        start = worst_of(self.kernels.start, own.loop.start.length > 0)
        parts = (noise, wind, slow, start)
        return Kernels(*(np.append(part, np.zeros_like(part[:1]), axis=0) for part in parts))

    @cached_property
    def aims(self) -> Integers:
        """Every adversary, (A, 4): whether it has the specification's h, sample, state or input, sign.

        They aim early, where stages begin, and in the long run.
        """
        own, last, size = self.setting, self.setting.samples - 1, abs(self.kernels.start).max(axis=2)
        memory = int(np.count_nonzero(size > _SETTLED * size.max(), axis=0).max())
        doubled = (2**i for i in range(memory.bit_length()))
        samples = sorted(k for k in {0, memory, last, *doubled, *own.stages.tolist()} if k <= last)
        matched = bool(own.loop.matched)
        modes = [True] * (own.own is not None or not matched) + [False] * matched
        return np.array([*product(modes, samples, range(len(own.names)), (1, -1))])

    def lanes(self, first: int, last: int) -> Lanes:
        """Runs first .. last - 1: adversaries, then random ones."""
        setting, number = self.setting, np.arange(first, last)
        draws, aimed = self._drawn(number), number < len(self.aims)
        rows = np.vstack([self.aims, [0, 0, 0, 1]])[np.minimum(number, len(self.aims))]
        chosen, sample, target, sign = rows.T
        free = (draws.kind[0] < 0.5) | (not setting.loop.matched)
        own = np.where(aimed, chosen, (setting.own is not None) & free).astype(bool)
        share, kind = np.split(draws.parameters, 2)
        low, high = setting.ranges.T[:, :, None]
        parameters = low + np.where(kind < 0.5, np.round(share), share) * (high - low)
        off = self._off(draws.start, aimed, _of(self.worst.start, sample, target, sign))
        return Lanes(number, aimed, own, sample, target, sign, draws, parameters, off)

    def _drawn(self, number: Integers) -> Draws:
        """What lanes draw, run by run."""
        own, (n, k) = self.setting, self.setting.loop.E.shape
        ends = np.cumsum([1, 2 * len(own.ranges), n + 1, 3 * n, 3 * k, 3 * len(own.slow.size), drawn(own)])
        seeds = [np.random.SeedSequence(self.seed, spawn_key=(run,)) for run in number.tolist()]
        draws = [np.random.default_rng(seed).random(int(ends[-1])) for seed in seeds]
        return Draws(*np.split(np.stack(draws, axis=1), ends[:-1]))

    def _off(self, draws: Array, aimed: Flags, worst: Array) -> Array:
        """x(0) - x*(0), (n, N)."""
        own = self.setting.loop.start
        random = worst_of(2 * draws[:-1].T - 1, own.length > 0).T
        around = np.where(aimed & worst.any(axis=0), worst, random)
        inside = np.where(aimed | (draws[-1] < 0.5), 1.0, draws[-1])
        return np.asarray(own.known.mid + inside * around * (own.length or own.box[:, None]))

    def noise(self, lanes: Lanes, k: int) -> Array:
        """What the measurements of sample k are wrong by, (n, N)."""
        return _within(self._signal(lanes, lanes.draws.noise, self.worst.noise, k), self.setting.loop.noise)

    def wind(self, lanes: Lanes, k: int, part: int) -> Array:
        """The sudden wind in a part of sample k, (k, N)."""
        later = part / len(self.setting.lengths)
        raw = self._signal(lanes, lanes.draws.wind, self.worst.wind[:, :, part], k, later)
        return _within(raw, self.setting.gusts)

    def sent(self, lanes: Lanes, k: int, now: Array | float = 0.0) -> Array:
        """Slow signals (r, N) at the end of sample k, from `now` on; before the first, k = -1: where they start.

        Where lanes have the specification's h, there is no other beside inputs.
        """
        own, slow = self.setting, self.setting.slow
        goal = slow.size[:, None] * self._signal(lanes, lanes.draws.slow, self.worst.slow, k)
        most = (slow.first if k < 0 else slow.rate * own.Ts)[:, None]
        taken = np.outer(own.spread[: own.loop.inputs].any(axis=0), lanes.own)
        return np.where(taken, 0.0, np.clip(goal, now - most, now + most))

    def _signal(self, lanes: Lanes, draws: Array, table: Array, k: int, later: float = 0.0) -> Array:
        """Of adversaries the table's, of the others square waves, as shares (c, N)."""
        lag = lanes.sample - k if k < 0 else (lanes.sample - k) % (lanes.sample + 1)
        aimed = _of(table, lag, lanes.target, lanes.sign)
        return np.where(lanes.aimed, aimed, waves(draws, self.setting.samples, k + later))


def _of(table: Array, lag: Integers, target: Integers, sign: Integers) -> Array:
    """What adversaries (N,) find in a table (L, F, c), (c, N)."""
    return np.asarray(table[np.minimum(lag, len(table) - 1), target].T * sign)


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

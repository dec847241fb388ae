"""Who drives the lanes: adversaries, who know the kernel of what they aim at, and random square waves.

An adversary aims at one state or input, at one sample, then again at as many samples later: noise and wind take the
sign of the kernel, h goes where `goals` sends it. Run i of a seed is the same in every campaign.
Implements: theory of the sampled loop, section 3, rows r_i = c AA^i without remainders, in floats. Trusted: no.
"""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from math import ceil
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.responses import Dynamics
from tubecert.sampled_loop.setting import Size
from tubecert.simulation.plans import waves
from tubecert.simulation.sampled.setting import Integers, Setting, course_of, courses_of

Flags = NDArray[np.bool_]
_LAGS: Final = 5000  # of the loop that an adversary looks back, at most
_LEVELS: Final = 1000  # of h that are told apart
_SETTLED: Final = 1e-4  # of the largest start: where the loop has forgotten it


class Attack:
    """The adversaries of a setting, and the seed of all that is drawn.

    `aims` (A, 4): whether an adversary has the specification's h, its sample, state or input, and sign; early, where
    stages begin, and in the long run. `worst` (L + 1, n + m, C): what does most to each state, at the node of a sample
    where it gets furthest, and input, by samples before it (index 0: its own), as shares: noise (n), the wind part by
    part (P k), slow signals (r), x(0) - x*(0) (n). Of all that is longer ago nothing is known: 0.
    """

    def __init__(self, setting: Setting, seed: int) -> None:
        self.setting, self.seed, loop, last = setting, seed, setting.loop, setting.samples - 1
        gusts, slow, (n, m) = setting.gusts, setting.slow, loop.B.shape
        blocks = [loop.noise.each, *[gusts.each] * len(setting.lengths), slow.size, loop.start.box]
        kernels = _kernels(setting, min(setting.samples + 1, _LAGS))
        reach = abs(kernels).sum(axis=0) @ np.concatenate(blocks)
        nodes = reach[:-m].reshape(-1, n).argmax(axis=0)
        kernels = kernels[:, np.append(nodes * n + np.arange(n), len(reach) - m + np.arange(m))]
        noise, *wind, ramps, start = np.split(kernels, np.cumsum(list(map(len, blocks)))[:-1], axis=2)
        for f, i in np.ndindex(ramps.shape[1:]):
            ramps[:, f, i] = goals(ramps[:, f, i], float(slow.size[i]), float(slow.rate[i]) * setting.Ts)
        gusting = (worst_of(each, gusts.length) for each in wind)
        shares = worst_of(noise, loop.noise.length), *gusting, ramps, worst_of(start, loop.start.length > 0)
        self.worst = np.pad(np.concatenate(shares, axis=2), ((0, 1), (0, 0), (0, 0)))

        size = abs(start).max(axis=2)
        memory = int(np.count_nonzero(size > _SETTLED * size.max(), axis=0).max())
        asked = {0, memory, last, *(2**i for i in range(memory.bit_length())), *setting.stages.tolist()}
        samples, matched = sorted(k for k in asked if k <= last), bool(loop.matched)
        modes = [True] * (setting.h is not None or not matched) + [False] * matched
        self.aims: Integers = np.array([*product(modes, samples, range(n + m), (1, -1))])


class Lanes:
    """Runs of an attack by their `numbers`, N: adversaries (`aimed`), then random ones, and what each is exposed to.

    `own`: which have the specification's h; half of the `parameters` (p, N) are corners; `off` (n, N): x(0) - x*(0);
    `course`: what they follow.
    """

    def __init__(self, attack: Attack, numbers: range) -> None:
        self.setting, self._worst, number = attack.setting, attack.worst, np.array(numbers)
        own, start, bundle = self.setting, self.setting.loop.start, self.setting.spec.trajectory.bundle
        (n, m), k, r = own.loop.B.shape, own.loop.E.shape[1], len(own.slow.size)
        counts = (1, 2 * len(own.ranges), n + 1, 3 * n, 3 * k, 3 * r, 4 * n + 3 * m if bundle else 0)
        (kind,), parameters, (*around, far), *self._draws, plan = _drawn(attack.seed, numbers, counts)
        self.aimed, rows = number < len(attack.aims), np.vstack([attack.aims, [0, 0, 0, 1]])
        chosen, self._sample, self._target, self._sign = rows[np.minimum(number, len(attack.aims))].T
        free = (kind < 0.5) | (not own.loop.matched)
        self.own = np.where(self.aimed, chosen, (own.h is not None) & free).astype(bool)
        share, corner = np.split(parameters, 2)
        low, high = own.ranges.T[:, :, None]
        self.parameters = low + np.where(corner < 0.5, np.round(share), share) * (high - low)
        free, aimed = worst_of(2 * np.array(around).T - 1, start.length > 0).T, self._known(self._sample)[-n:]
        towards = np.where(self.aimed & aimed.any(axis=0), aimed, free)
        inside = np.where(self.aimed | (far < 0.5), 1.0, far)
        self.off = start.known.mid + inside * towards * (start.length or start.box[:, None])
        self.course = courses_of(own, bundle, plan) if bundle else course_of(own)

    def __len__(self) -> int:
        return len(self.aimed)

    def signals(self, k: int, now: Array | float = 0.0) -> tuple[Array, Array, Array]:
        """Of sample k noise (n, N), in every part of it the sudden wind (P, k, N), at its end slow signals (r, N).

        These come from `now`, as far as their rates allow; before the first sample, k = -1, it is where they start.
        Where lanes have the specification's h, there is no other beside inputs.
        """
        own, slow, (noise, wind, last) = self.setting, self.setting.slow, self._draws
        later = np.arange(len(own.lengths)) / len(own.lengths)
        times = [(noise, 0.0), *((wind, part) for part in later.tolist()), (last, 0.0)]
        drawn = [waves(draws, own.samples, k + part) for draws, part in times]
        lag = self._sample - k if k < 0 else (self._sample - k) % (self._sample + 1)
        aimed = np.split(self._known(lag), np.cumsum([len(each) for each in drawn]))
        heard, *blown, goal = (np.where(self.aimed, *both) for both in zip(aimed, drawn, strict=False))
        most = (slow.first if k < 0 else slow.rate * own.Ts)[:, None]
        taken = np.outer(own.spread[: own.loop.inputs].any(axis=0), self.own)
        sent = np.where(taken, 0.0, np.clip(slow.size[:, None] * goal, now - most, now + most))
        return _within(heard, own.loop.noise), np.stack([_within(each, own.gusts) for each in blown]), sent

    def _known(self, lag: Integers) -> Array:
        """What adversaries (N,) know to do so many samples before they are at their aim, (C, N)."""
        return np.asarray(self._worst[np.minimum(lag, len(self._worst) - 1), self._target].T * self._sign)


def _drawn(seed: int, numbers: range, counts: tuple[int, ...]) -> list[Array]:
    """What runs draw, each by its own number: so many from [0, 1), (count, N) each."""
    ends = np.cumsum(counts)
    own = (np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(run,))) for run in numbers)
    return np.split(np.stack([draw.random(int(ends[-1])) for draw in own], axis=1), ends[:-1])


def _within(raw: Array, bound: Size) -> Array:
    """Signals (c, N) of size 1 or less, in the units of their bounds."""
    length = np.linalg.norm(raw, axis=0) if bound.length else 1.0
    return np.asarray(raw / np.maximum(1.0, length) * bound.each[:, None])


def _kernels(setting: Setting, lags: int) -> Array:
    """What a unit of each signal does to the states at every node but the first, and to the inputs, (L, P n + m, C).

    Slow signals are held for the sample.
    """
    own, loop, ends = Dynamics(setting.loop, setting.tables), setting.loop, setting.nodes[1:]
    n, core = loop.states, own.width - loop.H.shape[1]
    first, step = np.vstack([*(own.error(s).mid for s in ends), own.sent[0]]), own.step().mid[:core]
    since = [[own.exponential.at(max(s - a, Fraction(0)))[1].mid for a in setting.nodes] for s in ends]
    parts = np.swapaxes(-np.diff(since, axis=1), 1, 2)  # what a unit slope in each of them is at a node

    def entered(rows: Array, pushes: Array) -> Array:
        """How noise, gusts and slow signals enter rows (R, ..), of which the first are pushed, (-1, P, n)."""
        whole = np.concatenate([pushes, np.zeros((len(rows) - len(pushes), *pushes.shape[1:]))])
        slow = whole.sum(axis=1) @ np.hstack([loop.B, loop.E]) @ setting.spread
        heard = rows[:, own.width : own.width + n]
        return np.hstack([heard, (whole @ loop.E).reshape(len(rows), -1), slow])

    rows, enter = [first[:, :core]], entered(step, parts[-1])
    while len(rows) < lags:
        rows.append(rows[-1] @ step[:, :core])
    before = np.stack(rows)
    now = entered(first, parts.reshape(-1, *parts.shape[2:]))
    return np.concatenate([np.concatenate([now[None], before[:-1] @ enter]), before[:, :, :n]], axis=2)


def goals(weights: Array, size: float, rate: float) -> Array:
    """Where the h of an adversary is to go, lag by lag (L,), as shares: the greatest sum of weights (L,) times h.

    |h| <= size, and from sample to sample it changes by `rate` at most, per sample. Dynamic programming: the value is
    concave in h, kept as slopes between levels a sample's change apart; from any h the best is as far towards the
    level at which it is greatest as the rate allows.
    """
    L = len(weights)
    together = min(L, max(1, ceil(2 * size / max(rate, 1e-300) / _LEVELS)))  # samples in which h is one
    count = max(1, min(_LEVELS, ceil(2 * size / max(rate * together, 1e-300))))
    own = weights / 2 + np.append(weights[1:], 0.0) / 2  # h is linear within a sample
    slopes, best = np.full(count, weights[0] / 2), np.empty(L)
    for first in range(0, L, together):
        best[first : first + together] = np.count_nonzero(slopes > 0)
        rise, fall = slopes[slopes > 0], slopes[slopes <= 0]
        level = np.zeros(count - len(rise[1:]) - len(fall[:-1]))
        slopes = np.concatenate([rise[1:], level, fall[:-1]]) + own[first : first + together].sum()
    return 2 * best / count - 1


def worst_of(table: Array, ball: bool) -> Array:
    """The worst signals (.., c) for kernels (.., c), however small these are: signs, or directions."""
    if not ball or not table.shape[-1]:
        return np.sign(table)
    largest = abs(table).max(axis=-1, keepdims=True)
    scaled = table / np.where(largest > 0, largest, 1.0)
    length = np.linalg.norm(scaled, axis=-1, keepdims=True)
    return np.asarray(scaled / np.where(length > 0, length, 1.0))

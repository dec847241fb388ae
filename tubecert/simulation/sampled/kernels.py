"""The loop without remainders, lag by lag: what each signal does to a state, or to an input, some samples later.

Implements: theory of the sampled loop, section 3, rows r_i = c AA^i, in floats. Trusted: no.
"""

from __future__ import annotations

from fractions import Fraction
from math import ceil
from typing import Final, NamedTuple

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.sampled_loop.responses import Dynamics
from tubecert.simulation.sampled.setting import Setting

_LEVELS: Final = 1000  # of h that are told apart


class Kernels(NamedTuple):
    """Of F functionals, by samples before them (index 0: their own).

    `noise` (L, F, n); `wind` (L, F, P, k), of a unit gust in a part; `slow` (L, F, r), of signals that are held for the
    sample; `start` (L, F, n): what the error of the first sample counts.
    """

    noise: Array
    wind: Array
    slow: Array
    start: Array


def kernels_of(setting: Setting, lags: int) -> Kernels:
    """Of every state, at the node of a sample where it gets furthest, then of every input."""
    loop, (n, m) = setting.loop, setting.loop.B.shape
    found = _everywhere(setting, lags)
    reach = (
        abs(found.noise).sum(axis=0) @ loop.noise.each
        + abs(found.wind).sum(axis=(0, 2)) @ setting.gusts.each
        + abs(found.slow).sum(axis=0) @ setting.slow.size
        + abs(found.start).sum(axis=0) @ loop.start.box
    )
    nodes = reach[:-m].reshape(-1, n).argmax(axis=0)
    chosen = np.append(nodes * n + np.arange(n), len(reach) - m + np.arange(m))
    return Kernels(*(own[:, chosen] for own in found))


def _everywhere(setting: Setting, lags: int) -> Kernels:
    """Of the states at every node but the first, then of the inputs."""
    own, loop = Dynamics(setting.loop, setting.tables), setting.loop
    (n, m), P, core = loop.B.shape, len(setting.lengths), own.width - loop.H.shape[1]
    first = np.vstack([*(own.error(s).mid for s in setting.nodes[1:]), own.sent[0]])
    step, heard = own.step().mid[:core], slice(own.width, own.width + n)
    AA, NN = step[:, :core], step[:, heard]
    rows = np.empty((lags, len(first), core))
    rows[0] = first[:, :core]
    for i in range(1, lags):
        rows[i] = rows[i - 1] @ AA
    parts = np.stack([_parts(own, setting, s) for s in setting.nodes[1:]])
    now = np.concatenate([np.swapaxes(parts, 1, 2).reshape(P * n, P, n), np.zeros((m, P, n))])
    push = np.concatenate([now[None], np.einsum("lfi,pij->lfpj", rows[:-1, :, :n], parts[-1])])
    slow = push.sum(axis=2) @ np.hstack([loop.B, loop.E]) @ setting.spread
    return Kernels(
        np.concatenate([first[None, :, heard], rows[:-1] @ NN]), push @ loop.E, slow, rows[:, :, :n]
    )


def _parts(own: Dynamics, setting: Setting, s: Fraction) -> Array:
    """What a unit slope in each part of a sample is at a node s, (P, n, n); 0 for parts after it."""
    since = [own.exponential.at(max(s - node, Fraction(0)))[1].mid for node in setting.nodes]
    return -np.diff(np.stack(since), axis=0)


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

"""What acts on a loop: random members of the class and random starts, and a search for the worst of them.

Run i draws everything from its own generator, keyed by (seed, i): it can be repeated alone, and is the same run however
many there are, however they are grouped, and whoever does them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.progress import Phase, Progress, Step
from tubecert.simulation.adaptive.engine import integrate
from tubecert.simulation.adaptive.loops import Cases, Disturbance, Runs
from tubecert.simulation.adaptive.setting import Loop, Setting
from tubecert.simulation.adaptive.uncertainty import acting, adversaries, random_members

_POPULATION, _ELITE, _ROUNDS = 256, 12, 4
_COARSER: Final = 3  # times: the steps of runs that are only compared
_MOVED: Final = 0.3  # of the width of a gene, at first


def cases(setting: Setting, seed: int, numbers: Sequence[int]) -> Cases:
    """What runs of a seed do, by their numbers: half are random members, half are random adversaries."""
    kind, n = setting.uncertainty, len(setting.x0)
    sizes = np.cumsum([1, kind.member, kind.adversary, kind.beside, n + 2])
    seeds = [np.random.SeedSequence(entropy=seed, spawn_key=(number,)) for number in numbers]
    genes = np.stack([np.random.default_rng(each).random(sizes[-1]) for each in seeds], axis=1)
    (coin,), own, aimed, beside, begin = np.split(genes, sizes[:-1])
    start = _random_starts(setting, begin)
    offset = setting.S @ (start - setting.centre[:, None])
    both = random_members(kind, own, offset), adversaries(kind, aimed, offset)
    chosen = (np.where(coin < 0.5, a, b) for a, b in zip(both[0][1:], both[1][1:], strict=True))
    return _cases(setting, start, Disturbance(None, *chosen), beside)


def _cases(setting: Setting, start: Array, h: Disturbance, beside: Array) -> Cases:
    """Members of the class, which is one of functions of z = S (x - centre), as functions of x.

    What they add up to is clipped beside a wind only: every h is in the class.
    """
    kind, N = setting.uncertainty, start.shape[1]
    wave = np.einsum("win,ij->wjn", h.wave, setting.S)
    h = h._replace(
        wave=wave,
        phase=h.phase - np.einsum("wjn,j->wn", wave, setting.centre),
        radius=np.full(N, kind.h if kind.beside else np.inf),
        layer=np.full(N, kind.layer),
    )
    return Cases(start, acting(kind, h, beside))


def _random_starts(setting: Setting, genes: Array) -> Array:
    """The initial state, or points of the ball or the box that is allowed (its surface, half of the time), (n, N)."""
    n = len(setting.x0)
    direction, outside, radius = 2 * genes[:n] - 1, genes[n] < 0.5, genes[n + 1] ** (1 / n)
    if not setting.within:
        direction = np.where(outside, np.sign(direction), direction)
    return setting.started(direction, np.where(outside, 1.0, radius))


def bred(setting: Setting, genes: Array) -> Cases:
    """The adversaries that genes (G, N) in [0, 1] describe, and where their runs start."""
    kind = setting.uncertainty
    aimed, beside, begin = np.split(genes, np.cumsum([kind.adversary, kind.beside]))
    start = setting.started(2 * begin - 1 if setting.varied else np.zeros((len(setting.x0), genes.shape[1])))
    offset = setting.S @ (start - setting.centre[:, None])
    return _cases(setting, start, adversaries(kind, aimed, offset), beside)


def worst(setting: Setting, loop: Loop, seed: int, known: Runs, report: Progress | None = None) -> Cases:
    """The case with the largest distance that a short evolution of adversaries finds; deterministic for a seed.

    Its runs take a third of the steps of those that are `known`: what they find is a proposal.
    """
    rng = np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=(2**31,)))
    kind, count = setting.uncertainty, ceil(np.median(known.found.steps) / _COARSER)
    size = kind.adversary + kind.beside + (len(setting.x0) if setting.varied else 0)
    genes = rng.random((_POPULATION, size))
    kept, scores = np.zeros((0, size)), np.zeros(0)
    for turn in range(_ROUNDS):
        if report is not None:
            done, of = turn * _POPULATION, _ROUNDS * _POPULATION
            report(Step(phase=Phase.SIMULATION, name=f"{loop.controller}, adversary", done=done, of=of))
        (runs,) = integrate([(loop, bred(setting, genes.T))], tolerance=setting.tolerance, count=count)
        found = np.nan_to_num(runs.found.peak["distance"], nan=np.inf)
        pool, values = np.vstack([kept, genes]), np.concatenate([scores, found])
        order = np.argsort(-values, kind="stable")[:_ELITE]
        kept, scores = pool[order], values[order]
        genes = children(kept, _POPULATION, 0.5 ** (turn + 1), rng)
    return bred(setting, kept[:1].T)


def children(parents: Array, count: int, spread: float, rng: np.random.Generator) -> Array:
    """Mixtures of two parents each, moved a little; genes are mirrored at 0 and 1."""
    chosen = rng.integers(len(parents), size=(2, count))
    take = rng.random((count, parents.shape[1])) < 0.5
    mixed = np.where(take, parents[chosen[0]], parents[chosen[1]])
    moved = mixed + _MOVED * spread * rng.normal(size=mixed.shape)
    return np.asarray(np.abs(np.remainder(moved + 1, 2) - 1))

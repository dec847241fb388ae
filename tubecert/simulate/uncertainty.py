"""Uncertainties within a declared class: random members, and adversaries; each is in the class by construction.

The class: |h| <= Dh, |h_x| <= Dhx, |h_t| <= Dht, and |h(0, x(0))| <= H0, the constants of a certificate. A sum of waves
a_k sin(w_k t + q_k'(x - centre) + p_k) has |h| <= sum |a_k|, |h_x| <= sum |a_k||q_k| and |h_t| <= sum |a_k| w_k.

An adversary is a triangular wave in w t + q'(x - centre) + p: it moves as fast as the class allows all the time, and a
filter of bandwidth omega misses of h what it moves within 1/omega. Its Fejer mean is used, which has the bounds of the
triangle: slope at most 1, and no overshoot. Where metric and inputs are constant, a part of h may push along B'M g_s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from tubecert.enclosure.interval import Array
from tubecert.simulate.certified import Certified
from tubecert.simulate.problem import Beside, Disturbance, nothing_beside

WAVES: Final = 6  # of a random member, and odd harmonics of an adversary
_ROUND: Final = 1 - 1e-9  # sums of floats stay within the class
_STEADY: Final = 0.2  # below, a wind never turns round
_ENDS: Final = 1.6  # parameters lie at the ends of their ranges in 3 of 8 cases


@dataclass(frozen=True, slots=True, kw_only=True)
class Class:
    """Bounds of |h|, |h_x|, |h_t| and |h(0, x(0))|, n states, m inputs.

    `push` bounds how fast B'M gamma_s changes with x, and with t along the plan; None where that is not known.
    `sources` are those of wind and unknown parameters, if there are any.
    """

    h: float
    h_x: float
    h_t: float
    h_initial: float
    n: int
    m: int
    push: tuple[float, float] | None = None
    sources: Sources | None = None

    def rate_at(self, speed: float) -> float:
        """s1 = Dht + Dhx Y, how fast h moves along a loop of the speed Y."""
        return self.h_t + self.h_x * speed


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sources:
    """What acts beside h: |w| <= `wind` for a w of k entries, parameters in `ranges` (p, 2); `pace` lambda, 1/s."""

    pace: float
    k: int
    wind: float
    ranges: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Member:
    """One h: amplitude (W, m), frequency (W,), wave (W, n), phase (W,), push; and what acts beside it, as one lane."""

    amplitude: Array
    frequency: Array
    wave: Array
    phase: Array
    push: float = 0.0
    beside: Beside | None = None

    def bounds(self) -> tuple[float, float, float]:
        """Bounds of |h|, |h_x| and |h_t| of a sum of waves, by the triangle inequality."""
        size = np.linalg.norm(self.amplitude, axis=1)
        slope = np.linalg.norm(self.wave, axis=1)
        return float(size.sum()), float(size @ slope), float(size @ np.abs(self.frequency))


def class_of(certified: Certified, n: int = 0, m: int = 0, sources: Sources | None = None) -> Class:
    """The class that a certificate is about; pushes only where the metric and B are constant."""
    constants = {name: certified[name] for name in ("h", "h_x", "h_t", "h_initial")}
    flat = certified["M_x"] == 0 and certified["B_x"] == 0
    push = None
    if flat and certified.upper is not None:
        slope = certified["B"] * certified.upper
        push = slope, slope * (certified["drift_on_plan"] + certified["plan_defect"])
    return Class(**constants, n=n, m=m, push=push, sources=sources)


def random_member(kind: Class, x0: Array, centre: Array, rng: np.random.Generator) -> Member:
    """A random member; often, but not always, at the limits of the class."""
    sizes = rng.dirichlet(np.full(WAVES, 0.7))
    amplitude = (sizes * kind.h * _ROUND)[:, None] * _directions(rng, WAVES, kind.m)
    if rng.random() < 0.3:
        amplitude *= rng.random()
    size = np.linalg.norm(amplitude, axis=1)
    frequency = _budgeted(10.0 ** rng.uniform(-1.5, 1.0, WAVES), size, kind.h_t * _share(rng))
    steepness = _budgeted(10.0 ** rng.uniform(-1.5, 1.0, WAVES), size, kind.h_x * _share(rng))
    wave = steepness[:, None] * _directions(rng, WAVES, kind.n)
    member = Member(
        amplitude=amplitude, frequency=frequency, wave=wave, phase=rng.uniform(0, 2 * np.pi, WAVES)
    )
    return beset(started(member, kind, x0 - centre), kind, rng.random(genes_beside(kind)))


def _directions(rng: np.random.Generator, count: int, size: int) -> Array:
    vectors = rng.normal(size=(count, size))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _share(rng: np.random.Generator) -> float:
    """How much of a bound is used: all of it, half of the time."""
    return _ROUND if rng.random() < 0.5 else float(rng.random())


def _budgeted(raw: Array, size: Array, budget: float) -> Array:
    """The rates, scaled so that sum size * rate is the budget."""
    used = float(size @ raw)
    return raw * (budget / used) if used > 0 else np.zeros_like(raw)


def started(member: Member, kind: Class, offset: Array) -> Member:
    """The member with its phases moved towards zeros of the waves, as far as |h(0, x(0))| <= H0 asks for."""
    base = member.wave @ offset
    angle = np.remainder(base + member.phase + np.pi, 2 * np.pi) - np.pi

    def size(share: float) -> float:
        return float(np.linalg.norm(np.sin(share * angle) @ member.amplitude))

    room = max(0.0, kind.h_initial - abs(member.push))
    if size(1.0) <= room:
        return member
    low, high = 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if size(middle) <= room else (low, middle)
    return Member(
        amplitude=member.amplitude,
        frequency=member.frequency,
        wave=member.wave,
        phase=low * angle - base,
        push=member.push,
    )


def triangle(waves: int) -> tuple[Array, Array]:
    """Odd harmonics (W,) and coefficients (W,) of a triangular wave of slope at most 1, as a Fejer mean."""
    j = np.asarray(2.0 * np.arange(waves) + 1)
    weight = 1 - j / (2 * waves + 1)
    return j, np.asarray(4 / np.pi * weight * (-1.0) ** np.arange(waves) / j**2)


def adversary(kind: Class, genes: Array, x0: Array, centre: Array, layer: float) -> Member:
    """The member that `genes` in [0, 1] describe: frequency, phase, shares of h_x and push, directions.

    Whatever the frequency, the wave moves as fast, or as far, as the class allows.
    """
    j, c = triangle(WAVES)
    frequency = 10.0 ** (3 * genes[0] - 1.5) * (kind.h_t / kind.h if kind.h > 0 else 1.0)
    pushed = _pushed(kind, genes[3], layer)
    room_h, room_x, room_t = (
        bound * _ROUND - used for bound, used in zip((kind.h, kind.h_x, kind.h_t), pushed[1:], strict=True)
    )
    slope = room_h / float(np.abs(c).sum())
    if frequency > 0:
        slope = min(slope, room_t / frequency)
    slope = max(slope, 0.0)
    steepness = genes[2] * room_x / slope if slope > 0 else 0.0
    q = steepness * _unit(genes[4 : 4 + kind.n])
    amplitude = slope * c[:, None] * _unit(genes[4 + kind.n : 4 + kind.n + kind.m])[None, :]
    member = Member(
        amplitude=amplitude,
        frequency=j * frequency,
        wave=j[:, None] * q[None, :],
        phase=j * 2 * np.pi * genes[1],
        push=pushed[0],
    )
    return beset(_begun(member, kind, x0 - centre), kind, genes[4 + kind.n + kind.m :])


def genes_of(kind: Class) -> int:
    """How many numbers describe an adversary."""
    return 4 + kind.n + kind.m + genes_beside(kind)


def genes_beside(kind: Class) -> int:
    """How many of them are about wind and unknown parameters."""
    return 0 if kind.sources is None else 3 + kind.sources.k + len(kind.sources.ranges)


def beset(member: Member, kind: Class, genes: Array) -> Member:
    """The member with the wind and the parameters that `genes` in [0, 1] describe."""
    return member if kind.sources is None else replace(member, beside=_beside(kind.sources, genes))


def usual(kind: Class, sources: Sources) -> Beside:
    """A wind that blows outward and does not turn, beside an h that is given."""
    genes = np.full(genes_beside(kind), 0.5)
    genes[1] = 0.0
    return _beside(sources, genes)


def _beside(sources: Sources, genes: Array) -> Beside:
    """Genes: the aim of the wind, how fast it turns, its phase, its direction, the parameters."""
    last = 3 + sources.k
    blows = _unit(genes[3:last]) if sources.k else np.zeros(0)
    low, high = sources.ranges[:, 0], sources.ranges[:, 1]
    turns = sources.pace * 10 ** (4 * genes[1] - 1) if genes[1] > _STEADY else 0.0
    lane = Beside(
        wind=np.array(sources.wind * _ROUND),
        aim=np.array(int(2.999 * genes[0])),
        blowing=blows,
        gusting=np.array([turns, 2 * np.pi * genes[2] if turns else np.pi / 2]),
        theta=low + (high - low) * np.clip(_ENDS * (genes[last:] - 0.5) + 0.5, 0.0, 1.0),
    )
    return Beside(*(part[None] for part in lane))


def _pushed(kind: Class, share: float, layer: float) -> tuple[float, float, float, float]:
    """The push, and what it uses of |h|, |h_x| and |h_t|: its direction turns at most by 1/layer of what it follows."""
    if kind.push is None or kind.h == 0:
        return 0.0, 0.0, 0.0, 0.0
    slope, rate = (value / layer for value in kind.push)
    most = min(kind.h, kind.h_x / slope if slope > 0 else kind.h, kind.h_t / rate if rate > 0 else kind.h)
    push = share * most * _ROUND
    return push, push, push * slope, push * rate


def _unit(genes: Array) -> Array:
    vector = 2 * genes - 1
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.eye(len(genes))[0]


def _begun(member: Member, kind: Class, offset: Array) -> Member:
    """The triangle with its phase moved as |h(0, x(0))| <= H0 asks for, all harmonics together."""
    room = max(0.0, kind.h_initial - member.push)
    j = 2.0 * np.arange(len(member.phase)) + 1
    base = float(member.wave[0] @ offset)
    angle = float(np.remainder(base + member.phase[0] + np.pi / 2, np.pi) - np.pi / 2)
    flipped = np.cos(base + member.phase[0]) < 0

    def size(share: float) -> float:
        return float(np.linalg.norm(np.sin(j * share * angle) @ member.amplitude))

    share = 1.0
    if size(1.0) > room:
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if size(middle) <= room else (low, middle)
        share = low
    phase = np.asarray(j * (share * angle - base + (np.pi if flipped else 0.0)))
    return Member(
        amplitude=member.amplitude,
        frequency=member.frequency,
        wave=member.wave,
        phase=phase,
        push=member.push,
    )


def assembled(members: Sequence[Member], kind: Class, centre: Array, layer: float) -> Disturbance:
    """One lane for each member; what it adds up to is clipped beside a wind only: every member is in the class."""
    rows = [member.beside or nothing_beside(1) for member in members]
    return Disturbance(
        beside=Beside(*map(np.concatenate, zip(*rows, strict=True))),
        base=None,
        amplitude=np.array([member.amplitude for member in members]),
        frequency=np.array([member.frequency for member in members]),
        wave=np.array([member.wave for member in members]),
        phase=np.array([member.phase for member in members]),
        push=np.array([member.push for member in members]),
        radius=np.full(len(members), kind.h if kind.sources else np.inf),
        centre=centre,
        layer=layer,
    )

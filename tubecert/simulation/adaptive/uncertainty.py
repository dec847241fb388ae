"""Uncertainties within a declared class: random members, and adversaries; each is in the class by construction.

The class: |h| <= Dh, |h_x| <= Dhx, |h_t| <= Dht, and |h(0, x(0))| <= H0, the constants of a certificate. A sum of waves
a_k sin(w_k t + q_k'(x - centre) + p_k) has |h| <= sum |a_k|, |h_x| <= sum |a_k||q_k| and |h_t| <= sum |a_k| w_k.

An adversary is a triangular wave in w t + q'(x - centre) + p: it moves as fast as the class allows all the time, and a
filter of bandwidth omega misses of h what it moves within 1/omega. Its Fejer mean is used, which has the bounds of the
triangle: slope at most 1, and no overshoot. Where metric and inputs are constant, a part of h may push along B'M g_s.

Genes (G, N) in [0, 1] describe N members, one for each lane, and what acts beside them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Final

import numpy as np

from tubecert.certificate.file import incomplete
from tubecert.certificate.result import Result
from tubecert.enclosure.interval import Array
from tubecert.model import ControlAffineModel
from tubecert.simulation.adaptive.loops import Disturbance

WAVES: Final = 6  # of a random member, and odd harmonics of an adversary
_ROUND: Final = 1 - 1e-9  # sums of floats stay within the class
_UNEVEN: Final = 1.5  # a power: shares of h among the waves of a random member
_FAINT: Final = 0.3  # of the random members use only a part of |h|
_HALVINGS: Final = 60  # until a start is what |h(0, x(0))| allows
_TINY: Final = float(np.finfo(float).tiny)
_NOWHERE: Final = 1 - 1e-9  # twice the genes that have no direction: none has them
_LAYER: Final = 0.25  # of what |B'M gamma_s| can reach in the tube, for adversaries that push
_STEADY: Final = 0.2  # below, a wind never turns round
_ENDS: Final = 1.6  # parameters lie at the ends of their ranges in 3 of 8 cases


@dataclass(frozen=True, slots=True, kw_only=True)
class Class:
    """Bounds of |h|, |h_x|, |h_t| and |h(0, x(0))|, n states, m inputs.

    `push` bounds how fast B'M gamma_s changes with x, and with t along the plan; None where that is not known. `layer`
    is so much of |B'M gamma_s|, within which what pushes along it does so by less (`loops.Disturbance`). Beside h
    there may be |w| <= `wind` for a w of k entries, which turns round as `pace` (lambda, 1/s) says, and parameters in
    `ranges` (p, 2).
    """

    h: float
    h_x: float
    h_t: float
    h_initial: float
    n: int
    m: int
    push: tuple[float, float] | None = None
    layer: float = 1.0
    pace: float = 0.0
    k: int = 0
    wind: float = 0.0
    ranges: Array = field(default_factory=lambda: np.zeros((0, 2)))

    @property
    def adversary(self) -> int:
        """How many genes describe an adversary."""
        return 4 + self.n + self.m

    @property
    def member(self) -> int:
        """How many describe a random member."""
        return 6 + WAVES * (4 + self.n + self.m)

    @property
    def beside(self) -> int:
        """How many describe wind and unknown parameters."""
        count = self.k + len(self.ranges)
        return 3 + count if count else 0


def sup(result: Result, name: str, otherwise: float | None = None) -> float:
    """The safe side of a constant; raises `TubecertError` if it is not known, and there is no other value for that."""
    bound = result.constants.get(name)
    found = otherwise if bound is None or bound.above is None else bound.above
    if found is None:
        raise incomplete("that is simulated", f"{name} is missing")
    return found


def class_of(result: Result, model: ControlAffineModel, reach: float, upper: float | None) -> Class:
    """The class that a certificate is about; pushes only where metric, with lmax(M) <= `upper`, and B are constant."""
    of, push = partial(sup, result), None
    if of("M_x") == of("B_x") == 0 and upper is not None:
        slope = of("B") * upper
        push = slope, slope * (of("drift_on_plan") + of("plan_defect"))
    ranges = [[float(low), float(high)] for _, (low, high) in model.parameters]
    return Class(
        h=of("h"),
        h_x=of("h_x"),
        h_t=of("h_t"),
        h_initial=of("h_initial"),
        n=len(model.states),
        m=len(model.inputs),
        push=push,
        layer=_LAYER * of("metric_input_gain") * reach,
        pace=float(model.rate),
        k=len(model.E[0]) if model.E else 0,
        wind=float(model.wind_bound or 0),
        ranges=np.array(ranges).reshape(-1, 2),
    )


def random_members(kind: Class, genes: Array, offset: Array) -> Disturbance:
    """Random members for starts that are `offset` (n, N) from the centre; often at the limits of the class."""
    own, each = genes[:6], genes[6:].reshape(WAVES, -1, genes.shape[1])
    raw = (-np.log1p(-each[:, 0])) ** _UNEVEN
    part = np.where(own[0] < _FAINT, own[1], 1.0)
    size = kind.h * _ROUND * part * raw / np.maximum(raw.sum(axis=0), _TINY)
    shares = np.where(own[2::2] < 0.5, _ROUND, own[3::2])  # of a bound: all of it, half of the time
    limits, speeds = np.array([[kind.h_t], [kind.h_x]]) * shares, 10 ** (2.5 * each[:, 1:3] - 1.5)
    used = (size[:, None] * speeds).sum(axis=0)
    scale = np.where(used > 0, limits / np.maximum(used, _TINY), 0.0)
    rates, steepness = np.moveaxis(speeds * scale, 1, 0)
    amplitude, wave = size[:, None] * _unit(each[:, 4 : 4 + kind.m]), _unit(each[:, 4 + kind.m :])
    wave *= steepness[:, None]
    starts = (wave * offset).sum(axis=1), each[:, 3]
    still = Disturbance.nothing(kind.n, kind.m, genes.shape[1])
    waves = still._replace(amplitude=amplitude, frequency=rates, wave=wave)
    return waves._replace(phase=_phases(kind, waves, starts))


def triangle(waves: int) -> tuple[Array, Array]:
    """Odd harmonics (W,) and coefficients (W,) of a triangular wave of slope at most 1, as a Fejer mean."""
    j = np.asarray(2.0 * np.arange(waves) + 1)
    weight = 1 - j / (2 * waves + 1)
    return j, np.asarray(4 / np.pi * weight * (-1.0) ** np.arange(waves) / j**2)


def adversaries(kind: Class, genes: Array, offset: Array) -> Disturbance:
    """Those of genes for frequency, phase, shares of h_x and push, directions; starts as for random members.

    Whatever the frequency, the wave moves as fast, or as far, as the class allows.
    """
    (j, c), last = (each[:, None] for each in triangle(WAVES)), 4 + kind.n
    frequency = 10.0 ** (3 * genes[0] - 1.5) * (kind.h_t / kind.h if kind.h > 0 else 1.0)
    push, slope, rate = _pushed(kind, genes[3])
    room = [bound * _ROUND - used for bound, used in ((kind.h, push), (kind.h_x, slope), (kind.h_t, rate))]
    height = np.maximum(0.0, np.minimum(room[0] / np.abs(c).sum(), _over(room[2], frequency)))
    steepness = np.where(height > 0, genes[2] * _over(room[1], height), 0.0)
    q = steepness * _unit(genes[4:last])
    amplitude = (c * height)[:, None] * _unit(genes[last : last + kind.m])
    still, wave = Disturbance.nothing(kind.n, kind.m, len(push)), j[:, None] * q
    own = still._replace(amplitude=amplitude, frequency=j * frequency, wave=wave, push=push)
    return own._replace(phase=_phases(kind, own, ((q * offset).sum(axis=0), genes[1]), j))


def _pushed(kind: Class, share: Array) -> tuple[Array, Array, Array]:
    """The push, and what it uses of |h_x| and |h_t|: its direction turns at most by 1/layer of what it follows."""
    slope, rate = (value / kind.layer for value in kind.push or (0.0, 0.0))
    most = 0.0
    if kind.push is not None:
        most = min(kind.h, *(b / a for a, b in ((slope, kind.h_x), (rate, kind.h_t)) if a > 0))
    push = share * most * _ROUND
    return push, push * slope, push * rate


def _over(a: Array, b: Array) -> Array:
    """a / b, infinite where b is 0."""
    return np.asarray(np.divide(a, b, out=np.full(a.shape, np.inf), where=b > 0))


def _unit(genes: Array) -> Array:
    """Directions (.., n, N)."""
    vector = 2 * genes - _NOWHERE
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-2, keepdims=True), _TINY))


def _phases(
    kind: Class, own: Disturbance, starts: tuple[Array, Array], harmonics: Array | float = 1.0
) -> Array:
    """The phases (W, N) of waves that begin at places, in rad, and in shares of a turn.

    They are moved towards zeros as |h(0, x(0))| <= H0 asks for, all alike.
    """
    base, turn = starts
    angle = harmonics * (np.remainder(base + 2 * np.pi * turn + np.pi, 2 * np.pi) - np.pi)
    room, N = np.maximum(0.0, kind.h_initial - own.push), len(own.push)

    def fits(share: Array) -> Array:
        h = (np.sin(share * angle)[:, None] * own.amplitude).sum(axis=0)
        return np.asarray(np.linalg.norm(h, axis=0) <= room)

    low, high = np.where(fits(np.ones(N)), 1.0, 0.0), np.ones(N)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        good = fits(middle)
        low, high = np.where(good, middle, low), np.where(good, high, middle)
    return np.asarray(low * angle - harmonics * base)


def acting(kind: Class, h: Disturbance, genes: Array) -> Disturbance:
    """h beside a wind and parameters, if there are any.

    Genes (.., N): the aim of the wind, how fast it turns, its phase, its direction, the parameters.
    """
    if not kind.beside:
        return h
    low, high = kind.ranges.T[..., None]
    turns = np.where(genes[1] > _STEADY, kind.pace * 10 ** (4 * genes[1] - 1), 0.0)
    share = np.clip(_ENDS * (genes[3 + kind.k :] - 0.5) + 0.5, 0.0, 1.0)
    return h._replace(
        wind=np.full(len(turns), kind.wind * _ROUND),
        aim=np.floor(2.999 * genes[0]),
        blowing=_unit(genes[3 : 3 + kind.k]),
        gusting=np.stack([turns, 2 * np.pi * np.where(turns > 0, genes[2], 0.25)]),
        theta=low + (high - low) * share,
    )

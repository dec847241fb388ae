"""Closed loops, what acts on every lane of a vector (one lane is one run), and what runs leave behind.

| controller | the filter's u_a' | beside it |
|---|---|---|
| `nominal`, `ccm` | none: u = u* + k, without and with what is drawn | |
| `reference` | -omega (u_a + h), theory 3 | |
| `l1` | -omega (u_a + sigma_hat), (0.8) | predictor (0.6), adaptation (0.7) |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from tubecert.conditions.inputs import InputBound
from tubecert.enclosure.interval import Array
from tubecert.expression import Expression
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel
from tubecert.records import to_json
from tubecert.trajectory import Plan

R = TypeVar("R")
Controller = Literal["nominal", "ccm", "reference", "l1"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopGains:
    """The gains of a loop that filters.

    `bandwidth` in rad/s; `adaptation_rate` is Gamma, which "l1" has; `predictor_gain` is the g of A_m = -g I in 1/s;
    `projection_radius` is R_H; `smooth` the layer nu of the smooth projection, None for the hard one.
    """

    bandwidth: float
    adaptation_rate: float | None
    projection_radius: float
    predictor_gain: float
    smooth: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Decay:
    """D(t) of theorem B: d(x*, x) <= D(t), (2.15)."""

    rate: float
    bandwidth: float
    start: float  # d0
    beta: float
    defect: float
    first: float  # H0
    rest: float  # S
    error: float  # e, of the estimate, which is there from the start

    def __call__(self, t: Array) -> Array:
        """D at times t (K,)."""
        settled = (self.beta * (self.rest + self.error) + self.defect) / self.rate
        gap = self.bandwidth - self.rate
        e_rate, e_band = np.exp(-self.rate * t), np.exp(-self.bandwidth * t)
        K = t * e_rate if abs(gap) < 1e-9 * self.rate else (e_rate - e_band) / gap
        return np.asarray(
            settled + (self.start - settled) * e_rate + self.beta * (self.first - self.rest) * K
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """What is certified of the adaptive loop: `bounds` by the names of peaks, half-widths by state and output.

    `ultimate` is the radius in the long run, `decay` the bound of the distance over time; either may be missing.
    `ranges`: those of inputs that have limits, by name.
    """

    bounds: Mapping[str, float]
    half_widths: Mapping[str, float]
    ranges: Mapping[str, InputBound]
    ultimate: float | None = None
    decay: Decay | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """A closed loop, what its gains are, and the promise about it, if there is one."""

    controller: Controller
    gains: LoopGains | None = None
    gains_are: str = "no adaptation"
    promise: Promise | None = None

    @property
    def adapts(self) -> bool:
        """Whether h is estimated: such a loop is meant to stay in the tube."""
        return self.controller == "l1"

    @property
    def filters(self) -> bool:
        """Whether there is u_a."""
        return self.controller in ("reference", "l1")

    @property
    def data(self) -> dict[str, object]:
        """What is told of it."""
        told = {"controller": self.controller, "gains_are": self.gains_are}
        gains = {} if self.gains is None else {"gains": to_json(self.gains)}
        return told | {"covered": self.promise is not None, "tested": self.adapts} | gains


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """What loops have in common: a plant along a plan over [0, horizon] in s.

    `E` (n, k) is that of the wind E w, `rest` (n, 1) what unknown parameters do that no input can. `times` (K,) are the
    output times. `degree` is that of the geodesics' polynomials (unused if W is constant). A lane is stopped where
    |x - x*| exceeds `limit`. The adaptation is designed in z = S x, `S` (n, n); |xtilde| and |x - x*| are lengths in z.
    """

    model: ControlAffineModel
    plan: Plan
    horizon: float
    times: Array
    S: Array
    degree: int = 5
    limit: float = 1e6
    E: Matrix = ()
    rest: Matrix = ()

    @property
    def P(self) -> Array:
        """S'S, (n, n)."""
        return np.asarray(self.S.T @ self.S)


class Disturbance(NamedTuple):
    """What acts on N lanes; every array has the lanes last.

    h = clip(base(t, x) + sum_k amplitude_k sin(frequency_k t + wave_k'x + phase_k) + push c), where clip is the
    projection to the ball of `radius` (inf: none), and c = B'M gamma_s / sqrt(|B'M gamma_s|^2 + layer^2) at x, the
    direction that pushes away from the plan. At fixed x the rate of a wave is at most |amplitude| frequency, its slope
    |amplitude| |wave|. `base` (m,): expressions of t and the states, or None for 0; amplitude (W, m, N), frequency (W,
    N) in rad/s, wave (W, n, N), phase (W, N), the others (N,).

    The wind of E w is |w| <= `wind` (N,); its `aim` (N,) is 0 along `blowing` (k, N), 1 outward along E'M gamma_s, 2
    along the inputs, E'B B'M gamma_s. It goes forwards and backwards as a square wave of frequency and phase says:
    `gusting` (2, N). `theta` (p, N) are the parameters of which ranges are known.
    """

    base: tuple[Expression, ...] | None
    amplitude: Array
    frequency: Array
    wave: Array
    phase: Array
    push: Array
    radius: Array
    layer: Array
    wind: Array
    aim: Array
    blowing: Array
    gusting: Array
    theta: Array

    @classmethod
    def from_expressions(
        cls, base: tuple[Expression, ...] | None, model: ControlAffineModel, lanes: int
    ) -> Disturbance:
        """The same h, given by expressions of t and the states, on every lane, without wind."""
        return cls.nothing(len(model.states), len(model.inputs), lanes)._replace(base=base)

    @classmethod
    def nothing(cls, n: int, m: int, lanes: int) -> Disturbance:
        """Nothing for n states and m inputs."""
        waves, others = ((0, m), (0,), (0, n), (0,)), ((), (), (0,), (2,), (0,))
        none = [np.zeros((*shape, lanes)) for shape in (*waves, (), (), (), *others)]
        return cls(None, *none)._replace(radius=np.full(lanes, np.inf), layer=np.full(lanes, 1e-3))


class Cases(NamedTuple):
    """N runs: starts (n, N), and what acts on each of them."""

    start: Array
    h: Disturbance


Batch: TypeAlias = tuple[Problem, Loop, Cases]  # runs of a loop


class Lanes(NamedTuple):
    """N runs of some batches, one after the other.

    `loop` and `plan` (N,) are numbers in lists. Which have the base of h, and unknown parameters, is 0 or 1.
    """

    start: Array
    h: Disturbance
    loop: NDArray[np.intp]
    plan: NDArray[np.intp]
    based: Array
    unknown: Array


def lanes_of(batches: Sequence[Batch], loops: Sequence[int], plans: Sequence[int]) -> Lanes:
    """The lanes of batches with such loops and plans; where some have more waves than others the rest is 0."""
    starts, model = [cases.start for *_, cases in batches], batches[0][0].model
    none = (Disturbance.from_expressions(None, model, start.shape[1]) for start in starts)
    pairs = zip(batches, none, strict=True)
    acting = [h if loop.controller == "nominal" else cases.h for (_, loop, cases), h in pairs]
    base, *others = dict.fromkeys(h.base for h in acting if h.base is not None) or [None]
    if others:
        raise ValueError("lanes of one vector have one base of h")
    flags = ([float(h.base is not None) for h in acting], [float(len(h.theta) > 0) for h in acting])
    each = (np.repeat(own, [start.shape[1] for start in starts]) for own in (loops, plans, *flags))
    joint = (_padded(own) for own in zip(*(h[1:] for h in acting), strict=True))
    return Lanes(np.hstack(starts), Disturbance(base, *joint), *each)


def _padded(parts: Sequence[Array]) -> Array:
    """Arrays (.., N) one after the other; where they are of unequal size the rest is 0."""
    shape = np.max([part.shape[:-1] for part in parts], axis=0).astype(int)
    rooms = [[*((0, most) for most in shape - part.shape[:-1]), (0, 0)] for part in parts]
    return np.concatenate([np.pad(*each) for each in zip(parts, rooms, strict=True)], axis=-1)


def mapped(how: Callable[..., Array | None], *records: R) -> R:
    """A record with what `how` makes of the arrays of several of its kind, and of those of records within."""
    first: Any = records[0]
    if isinstance(first, np.ndarray):
        first = how(*records)
    elif hasattr(first, "_fields"):
        first = type(first)(*(mapped(how, *each) for each in zip(*records, strict=True)))
    return cast("R", first)


def of_some(record: R, lanes: NDArray[np.intp]) -> R:
    """That of some lanes."""
    return mapped(lambda part: np.take(part, lanes, axis=-1), record)


def put(record: R, lanes: NDArray[np.intp], other: R) -> None:
    """Some lanes become those of another record, one after the other."""
    mapped(lambda whole, part: whole.__setitem__((..., lanes), part), record, other)


class Seen(NamedTuple):
    """N lanes at an instant, or at several (K, .., N).

    x, x - x* = `off`, x' = `slope` and `xtilde` (n, N); u = u* + k + u_a, `k`, `u_a`, `sigma_hat`, `h` (m, N);
    `distance` (N,), the Riemannian d(x*, x). What a loop does not have is 0.
    """

    x: Array
    off: Array
    slope: Array
    u: Array
    k: Array
    u_a: Array
    sigma_hat: Array
    h: Array
    xtilde: Array
    distance: Array


class Sizes(NamedTuple):
    """What peaks are taken of, (N,): d(x*, x), |S (x - x*)|, |u|, |k|, |S xtilde|, |sigma_hat - h|, |S x'|."""

    distance: Array
    deviation: Array
    u: Array
    k: Array
    xtilde: Array
    sigma_error: Array
    speed: Array


class Found(NamedTuple):
    """What N lanes leave behind.

    `seen` (K, .., N) at the output times, nan where they did not come; `peak` (-inf where there is none), `peak_time`;
    `least` and `greatest` (m, N) of the inputs; why (0: it was not) and when in s a lane was `stopped`, `ended` (N,).
    `error` (N,) is twice the largest difference of states to the run with steps twice as long, or an eighth of the
    difference before: mostly far above the true one; inf where it is not known, or the lane failed. `unresolved` (N,)
    is the first output time at which that difference exceeds the tolerance, nan where it never does; `steps` (N,) how
    many there were.
    """

    seen: Seen
    peak: Sizes
    peak_time: Sizes
    least: Array
    greatest: Array
    stopped: NDArray[np.int64]
    ended: Array
    error: Array
    unresolved: Array
    steps: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """N runs at K output times.

    `t` (K,), `x_plan` (K, n), `u_plan` (K, m). What was `Seen` is an attribute, too, with the lanes first: x (N, K, n),
    u (N, K, m), distance (N, K), ... After a lane was stopped its values are nan.
    """

    t: Array
    x_plan: Array
    u_plan: Array
    found: Found

    def __getattr__(self, name: str) -> Array:
        if name not in Seen._fields:
            raise AttributeError(name)
        return np.moveaxis(getattr(self.found.seen, name), -1, 0)

    @property
    def error(self) -> Array:
        """Of the integration, in |S x|, (N,)."""
        return self.found.error

    def with_only(self, names: Sequence[str]) -> Runs:
        """The same without what else was seen: many of them fit into memory."""
        seen = self.found.seen
        dropped = {name: np.zeros((0, len(self.error))) for name in Seen._fields if name not in names}
        return replace(self, found=self.found._replace(seen=seen._replace(**dropped)))


def joined(parts: Sequence[Runs]) -> Runs:
    """Runs at the same times, one after the other; lanes are numbered through."""
    found = mapped(lambda *each: np.concatenate(each, axis=-1), *(part.found for part in parts))
    return replace(parts[0], found=found)

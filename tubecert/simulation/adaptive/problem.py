"""What is simulated: a loop with its gains, and the disturbance that acts on every lane (one lane is one run)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tubecert.digits import near
from tubecert.enclosure.interval import Array
from tubecert.expression import Expression, free_symbols
from tubecert.expression.matrix import Matrix
from tubecert.model import TIME, ControlAffineModel
from tubecert.simulation.adaptive.loops import CONTROLLERS, DESIGNS, Controller, Terms
from tubecert.trajectory import Plan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopGains:
    """The gains of the adaptive part; P = I.

    `bandwidth` in rad/s; `adaptation_rate` is Gamma, needed by "l1"; `predictor_gain` is the g of A_m = -g I in 1/s;
    `projection_radius` is R_H; `smooth` the layer nu of the smooth projection, None for the hard one. ValueError if a
    gain is not positive.
    """

    bandwidth: float
    projection_radius: float
    predictor_gain: float = 1.0
    adaptation_rate: float | None = None
    smooth: float | None = None

    def __post_init__(self) -> None:
        positive = {
            "bandwidth": self.bandwidth,
            "projection_radius": self.projection_radius,
            "adaptation_rate": self.adaptation_rate,
            "smooth": self.smooth,
            "predictor_gain": self.predictor_gain,
        }
        for name, value in positive.items():
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, not {value}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """One closed loop over [0, horizon] in s.

    `nominal` is the min-norm feedback without any disturbance, `ccm` the same under h, `reference` the reference
    system (u_a = -C[h]), `l1` the projection-based loop. `E` (n, k) is that of the wind E w, `rest` (n, 1) what unknown
    parameters do that no input can. `times` (K,), increasing in [0, horizon], are the output times. `degree` is that
    of the geodesics' polynomials (unused if W is constant). A lane is stopped where |x - x*| exceeds `limit`.
    `P` (n, n) is S'S of the coordinates z = S x in which the adaptation is designed, None for those of x; |xtilde| and
    |x - x*| are lengths in z.
    """

    model: ControlAffineModel
    plan: Plan
    controller: Controller
    horizon: float
    times: Array
    gains: LoopGains | None = None
    degree: int = 5
    limit: float = math.inf
    P: Array | None = None
    E: Matrix = ()
    rest: Matrix = ()

    def __post_init__(self) -> None:
        if self.controller not in CONTROLLERS:
            raise ValueError(f"controller must be one of {', '.join(CONTROLLERS)}, not {self.controller}")
        if not (np.isfinite(self.horizon) and self.horizon > 0):
            raise ValueError(f"horizon must be a positive time, not {self.horizon}")
        if self.plan.horizon is not None and self.horizon > float(self.plan.horizon) * (1 + 1e-12):
            raise ValueError(f"the plan ends at {near(self.plan.horizon)} s, before {near(self.horizon)} s")
        if not len(self.times) or np.any(np.diff(self.times) <= 0):
            raise ValueError("times must increase")
        if self.times[0] < 0 or self.times[-1] > self.horizon * (1 + 1e-12):
            raise ValueError("times must lie in [0, horizon]")
        if not self.limit > 0:
            raise ValueError(f"limit must be a positive distance, not {self.limit}")
        if self.degree < 2:
            raise ValueError("degree must be at least 2")
        if self.adaptive and self.gains is None:
            raise ValueError(f"the controller {self.controller} needs gains")
        for needed in DESIGNS[self.controller].needs:
            if getattr(self.gains, needed) is None:
                raise ValueError(f"the controller {self.controller} needs the gain {needed}")

    @property
    def terms(self) -> Terms:
        """The terms of its right-hand sides."""
        return DESIGNS[self.controller].terms

    @property
    def adaptive(self) -> bool:
        """Whether there is a filter."""
        return self.terms.filters


class Beside(NamedTuple):
    """What acts beside the waves of h: the wind w of E w, and the parameters of which ranges are known.

    Every array has the lanes first. The wind is |w| <= `wind` (N,); its `aim` (N,) is 0 along `blowing` (N, k), 1
    outward along E'M gamma_s, 2 along the inputs, E'B B'M gamma_s. It goes forwards and backwards as a square wave of
    frequency and phase says: `gusting` (N, 2). `theta` (N, p) are the parameters.
    """

    wind: Array
    aim: Array
    blowing: Array
    gusting: Array
    theta: Array


def nothing_beside(N: int, k: int = 0) -> Beside:
    """No wind, for N lanes of k winds; all parameters are known."""
    return Beside(*(np.zeros((N, *shape)) for shape in ((), (), (k,), (2,), (0,))))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Disturbance:
    """h(t, x) of N lanes; every array has the lanes first.

    h = clip(base(t, x) + sum_k amplitude_k sin(frequency_k t + wave_k'(x - centre) + phase_k) + push c),
    where clip is the projection to the ball of `radius` (inf: none), and c = B'M gamma_s /
    sqrt(|B'M gamma_s|^2 + layer^2) at x, the direction that pushes away from the plan. At fixed x the rate of a wave is
    at most |amplitude| frequency, its slope |amplitude| |wave|.

    Shapes: base (m,) expressions of t and the states, or None for 0; amplitude (N, W, m), frequency (N, W) in rad/s,
    wave (N, W, n), phase (N, W), push (N,), radius (N,), centre (n,).
    """

    base: tuple[Expression, ...] | None
    amplitude: Array
    frequency: Array
    wave: Array
    phase: Array
    push: Array
    radius: Array
    centre: Array
    beside: Beside
    layer: float = 1e-3

    def __post_init__(self) -> None:
        N, W, m = self.amplitude.shape
        n = len(self.centre)
        shapes = {"frequency": (N, W), "wave": (N, W, n), "phase": (N, W), "push": (N,), "radius": (N,)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have shape {shape}, not {getattr(self, name).shape}")
        if self.base is not None and len(self.base) != m:
            raise ValueError(f"base must have {m} entries")
        if not self.layer > 0:
            raise ValueError("layer must be positive")

    @property
    def lanes(self) -> int:
        """N."""
        return len(self.push)

    def of(self, lanes: NDArray[np.intp]) -> Disturbance:
        """The disturbance of some lanes, given by their numbers."""
        own = ("amplitude", "frequency", "wave", "phase", "push", "radius")
        beside = Beside(*(part[lanes] for part in self.beside))
        return replace(self, beside=beside, **{name: getattr(self, name)[lanes] for name in own})

    @classmethod
    def from_expressions(
        cls, base: tuple[Expression, ...] | None, model: ControlAffineModel, lanes: int, k: int = 0
    ) -> Disturbance:
        """The same h, given by expressions of t and the states, on every lane; none of k winds."""
        if base is not None:
            unknown = free_symbols(base) - {TIME, *model.states}
            if unknown:
                raise ValueError(f"h depends on {', '.join(sorted(unknown))}")
        n, m = len(model.states), len(model.inputs)
        return cls(
            beside=nothing_beside(lanes, k),
            base=base,
            amplitude=np.zeros((lanes, 0, m)),
            frequency=np.zeros((lanes, 0)),
            wave=np.zeros((lanes, 0, n)),
            phase=np.zeros((lanes, 0)),
            push=np.zeros(lanes),
            radius=np.full(lanes, np.inf),
            centre=np.zeros(n),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Batch:
    """N runs of a loop from x0 (N, n) under a disturbance of N lanes. ValueError where these do not fit."""

    problem: LoopProblem
    x0: Array
    disturbance: Disturbance

    def __post_init__(self) -> None:
        N, n = self.x0.shape
        model, own = self.problem.model, self.disturbance
        if n != len(model.states) or own.lanes != N or len(own.centre) != n:
            raise ValueError(f"x0 of shape {self.x0.shape} does not fit the disturbance's {own.lanes} lanes")
        if own.amplitude.shape[2] != len(model.inputs):
            raise ValueError("the disturbance has another number of inputs than the model")

    @property
    def acting(self) -> Disturbance:
        """What acts on the loop: nothing on one that is run without any disturbance."""
        if DESIGNS[self.problem.controller].disturbed:
            return self.disturbance
        return Disturbance.from_expressions(None, self.problem.model, len(self.x0))

    def of(self, lanes: NDArray[np.intp]) -> Batch:
        """Some of the runs, given by their numbers."""
        return replace(self, x0=self.x0[lanes], disturbance=self.disturbance.of(lanes))

    def beside(self, other: Batch) -> bool:
        """Whether both can be lanes of one vector: of the same model and times."""
        own, its = self.problem, other.problem
        same = own.model is its.model and own.horizon == its.horizon
        return same and own.degree == its.degree and np.array_equal(own.times, its.times)

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
from tubecert.simulate.loops import CONTROLLERS, DESIGNS, Controller, Terms
from tubecert.trajectory import Plan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopGains:
    """The gains of the adaptive part; P = I.

    `bandwidth` in rad/s; `adaptation_rate` is Gamma, needed by "l1"; `predictor_gain` is A_m (n, n), or a number g in
    1/s for A_m = -g I ("sampled" needs the number); `projection_radius` is R_H; `smooth` the layer nu of the smooth
    projection, None for the hard one; `sample_time` in s, needed by "sampled". ValueError if a gain is not positive.
    """

    bandwidth: float
    projection_radius: float
    predictor_gain: float | Array = 1.0
    adaptation_rate: float | None = None
    smooth: float | None = None
    sample_time: float | None = None

    def __post_init__(self) -> None:
        positive = {
            "bandwidth": self.bandwidth,
            "projection_radius": self.projection_radius,
            "adaptation_rate": self.adaptation_rate,
            "smooth": self.smooth,
            "sample_time": self.sample_time,
        }
        if isinstance(self.predictor_gain, float | int):
            positive["predictor_gain"] = self.predictor_gain
        for name, value in positive.items():
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be a positive number, not {value}")

    def A_m(self, n: int) -> Array:
        """The predictor's matrix, (n, n)."""
        if isinstance(self.predictor_gain, float | int):
            return -float(self.predictor_gain) * np.eye(n)
        matrix = np.asarray(self.predictor_gain, dtype=float)
        if matrix.shape != (n, n):
            raise ValueError(f"A_m must have shape {(n, n)}, not {matrix.shape}")
        return matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MachineRun:
    """The machine of theorem H: times in s, `bandwidth` of the filter in rad/s (inf: without memory).

    The estimate is clipped to the box (2, m), or where there is none to the ball of `radius`. `feedback_time` is None
    where the feedback has no rate of its own; its delay is the same; `held`: u* is played from sample to sample;
    `predict`: the feedback is that of the predicted state (H-P). `raised`: what the feedback is multiplied by, where B
    is uncertain. ValueError for a delay of more than a sample.
    """

    sample_time: float
    delay: float
    bandwidth: float
    box: Array | None = None
    radius: float = math.inf
    feedback_time: float | None = None
    held: bool = False
    predict: bool = False
    raised: float = 1.0

    def __post_init__(self) -> None:
        for period, delay in (self.adaptation, self.feedback):
            short = delay <= period * (1 + 1e-12) or (period == self.feedback_time and not self.predict)
            if not (np.isfinite(period) and period > 0 and delay >= 0 and short):
                raise ValueError(f"a delay of {delay} s does not fit a sample time of {period} s")
        if not self.bandwidth > 0:
            raise ValueError(f"bandwidth must be a positive number, not {self.bandwidth}")

    @property
    def adaptation(self) -> tuple[float, float]:
        """Sample time and delay of the estimate."""
        return self.sample_time, self.delay

    @property
    def feedback(self) -> tuple[float, float]:
        """Sample time and delay of the feedback."""
        return self.feedback_time or self.sample_time, self.delay


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """One closed loop over [0, horizon] in s.

    `nominal` is the min-norm feedback without any disturbance, `ccm` the same under h, `reference` the reference
    system (u_a = -C[h]), `l1` the projection-based loop, `sampled` the loop of certificate C. With a `control_rate` in
    Hz the whole controller is a computer that holds u and its adaptation between its samples; `hardware` is the loop of
    theorem H on a `machine`. `E` (n, k) is that of the wind E w, `rest` (n, 1) what unknown
    parameters do that no input can. `times` (K,), increasing in [0, horizon], are the
    output times. `degree` is that of the geodesics' polynomials (unused if W is constant). A
    lane is stopped where |x - x*| exceeds `limit`. `P` (n, n) is S'S of the coordinates z = S x in which the adaptation
    is designed, None for those of x; |xtilde| and |x - x*| are lengths in z.
    """

    model: ControlAffineModel
    plan: Plan
    controller: Controller
    horizon: float
    times: Array
    gains: LoopGains | None = None
    control_rate: float | None = None
    degree: int = 5
    limit: float = math.inf
    P: Array | None = None
    machine: MachineRun | None = None
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
        if self.control_rate is not None and not (np.isfinite(self.control_rate) and self.control_rate > 0):
            raise ValueError(f"control_rate must be a positive frequency, not {self.control_rate}")
        if not self.limit > 0:
            raise ValueError(f"limit must be a positive distance, not {self.limit}")
        if self.degree < 2:
            raise ValueError("degree must be at least 2")
        if self.terms.measures and (self.machine is None or self.control_rate is not None):
            raise ValueError(
                f"the controller {self.controller} needs a machine, and no control rate beside it"
            )
        if self.adaptive and self.gains is None:
            raise ValueError(f"the controller {self.controller} needs gains")
        for needed in DESIGNS[self.controller].needs:
            if getattr(self.gains, needed) is None:
                raise ValueError(f"the controller {self.controller} needs the gain {needed}")
        if self.terms.samples and np.ndim(getattr(self.gains, "predictor_gain", 0.0)):
            raise ValueError(f"the controller {self.controller} needs a number as predictor_gain")

    @property
    def terms(self) -> Terms:
        """The terms of its right-hand sides."""
        return DESIGNS[self.controller].terms

    @property
    def adaptive(self) -> bool:
        """Whether there is a filter."""
        return self.terms.filters


class Beside(NamedTuple):
    """What acts beside the waves of h: a signal, the wind w of E w, and the noise of what a machine measures.

    Every array has the lanes first. The signal, a part of h, starts at `begin` (N, m) and moves at the rate `ramp` (N,)
    along `along` (N, m), or where that is 0 along c = B'M gamma_s; it turns at the samples of a machine. The wind is
    |w| <= `wind` (N,); its `aim` (N,) is 0 along `blowing` (N, k), 1 outward along E'M gamma_s, 2 along the inputs,
    E'B c. Both go forwards and backwards as square waves of frequency and phase say: `turning`, `gusting` (N, 2). Noise
    is an entry of `table` (N, Q, n), by `choice` (N,): 0 at random; 1 the first one, its sign changing every `period`
    (N,) measurements; 2 the one that costs the feedback most. It changes by `most` (N,) per second at most. `theta`
    (N, p) are the parameters of which ranges are known. `decided` (N, S, 1 + m): what an adversary that looks at the
    state has decided at measurement s, the entry of `table` and the direction of the signal; nan where it has not yet.
    """

    ramp: Array
    begin: Array
    along: Array
    turning: Array
    wind: Array
    aim: Array
    blowing: Array
    gusting: Array
    choice: Array
    period: Array
    table: Array
    most: Array
    theta: Array
    decided: Array


def nothing_beside(N: int, n: int, m: int, k: int = 0) -> Beside:
    """No signal, no wind and no noise, for N lanes of n states, m inputs and k winds; all parameters are known."""
    shapes = (), (m,), (m,), (2,), (), (), (k,), (2,), (), (), (1, n), (), (0,), (0, 1 + m)
    found = Beside(*(np.zeros((N, *shape)) for shape in shapes))
    return found._replace(period=found.period + 1, most=found.most + np.inf)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Disturbance:
    """h(t, x) of N lanes, evaluated inside the compiled loop; every array has the lanes first.

    h = clip(base(t, x) + sum_k amplitude_k sin(frequency_k t + wave_k'(x - centre) + phase_k) + push c + signal),
    where clip is the projection to the `box` and then to the ball of `radius` (inf: none), and c = B'M gamma_s /
    sqrt(|B'M gamma_s|^2 + layer^2) at x, the direction that pushes away from the plan. At fixed x the rate of a wave is
    at most |amplitude| frequency, its slope |amplitude| |wave|.

    Shapes: base (m,) expressions of t and the states, or None for 0; amplitude (N, W, m), frequency (N, W) in rad/s,
    wave (N, W, n), phase (N, W), push (N,), radius (N,), centre (n,), box (2, m).
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
    box: Array
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

    @property
    def is_zero(self) -> bool:
        """Whether h vanishes for every lane."""
        parts = (self.amplitude, self.push, self.beside.ramp, self.beside.wind, self.beside.table)
        known = not self.beside.theta.size
        return known and self.base is None and not any(np.any(part) for part in parts)

    def of(self, lanes: NDArray[np.intp]) -> Disturbance:
        """The disturbance of some lanes, given by their numbers."""
        own = ("amplitude", "frequency", "wave", "phase", "push", "radius")
        beside = Beside(*(part[lanes] for part in self.beside))
        return replace(self, beside=beside, **{name: getattr(self, name)[lanes] for name in own})

    def undecided(self, measurements: int) -> Disturbance:
        """The same, before anything was decided."""
        shape = (self.lanes, measurements, self.beside.decided.shape[2])
        return replace(self, beside=self.beside._replace(decided=np.full(shape, np.nan)))

    @classmethod
    def from_expressions(
        cls, base: tuple[Expression, ...] | None, model: ControlAffineModel, lanes: int, k: int = 0
    ) -> Disturbance:
        """The same h, given by expressions of t and the states, on every lane; none of k winds, no noise."""
        if base is not None:
            unknown = free_symbols(base) - {TIME, *model.states}
            if unknown:
                raise ValueError(f"h depends on {', '.join(sorted(unknown))}")
        n, m = len(model.states), len(model.inputs)
        return cls(
            beside=nothing_beside(lanes, n, m, k),
            box=unbounded(m),
            base=base,
            amplitude=np.zeros((lanes, 0, m)),
            frequency=np.zeros((lanes, 0)),
            wave=np.zeros((lanes, 0, n)),
            phase=np.zeros((lanes, 0)),
            push=np.zeros(lanes),
            radius=np.full(lanes, np.inf),
            centre=np.zeros(n),
        )


def unbounded(m: int) -> Array:
    """The box (2, m) without faces."""
    return np.array([[-np.inf] * m, [np.inf] * m])

"""Closed loops, what acts on every lane of one (one lane is one run), and the runs that come out.

| controller | the filter's u_a' | beside it |
|---|---|---|
| `nominal`, `ccm` | none: u = u* + k, without and with what is drawn | |
| `reference` | -omega (u_a + h), theory 3 | |
| `l1` | -omega (u_a + sigma_hat), (0.8) | predictor (0.6), adaptation (0.7) |
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tubecert.enclosure.interval import Array
from tubecert.expression import Expression
from tubecert.expression.matrix import Matrix
from tubecert.model import ControlAffineModel
from tubecert.simulation.adaptive.lanes import Found, combined
from tubecert.trajectory import Plan

Controller = Literal["nominal", "ccm", "reference", "l1"]
CONTROLLERS: Final[tuple[Controller, ...]] = ("nominal", "ccm", "reference", "l1")


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoopProblem:
    """One closed loop over [0, horizon] in s.

    `E` (n, k) is that of the wind E w, `rest` (n, 1) what unknown parameters do that no input can. `times` (K,) are the
    output times. `degree` is that of the geodesics' polynomials (unused if W is constant). A lane is stopped where
    |x - x*| exceeds `limit`. `P` (n, n) is S'S of the coordinates z = S x in which the adaptation is designed, None for
    those of x; |xtilde| and |x - x*| are lengths in z.
    """

    model: ControlAffineModel
    plan: Plan
    controller: Controller
    horizon: float
    times: Array
    gains: LoopGains | None = None
    degree: int = 5
    limit: float = 1e6
    P: Array | None = None
    E: Matrix = ()
    rest: Matrix = ()

    @property
    def adapts(self) -> bool:
        """Whether h is estimated: such a loop is meant to stay in the tube."""
        return self.controller == "l1"

    @property
    def filters(self) -> bool:
        """Whether there is u_a."""
        return self.controller in ("reference", "l1")


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

    def of(self, lanes: NDArray[np.intp]) -> Disturbance:
        """That of some lanes, given by their numbers."""
        return Disturbance(self.base, *(part[..., lanes] for part in self[1:]))

    @classmethod
    def from_expressions(
        cls, base: tuple[Expression, ...] | None, model: ControlAffineModel, lanes: int, k: int = 0
    ) -> Disturbance:
        """The same h, given by expressions of t and the states, on every lane; none of k winds."""
        return cls.nothing(len(model.states), len(model.inputs), lanes, k)._replace(base=base)

    @classmethod
    def nothing(cls, n: int, m: int, lanes: int, k: int = 0) -> Disturbance:
        """Nothing for n states, m inputs and k winds."""
        waves, others = ((0, m), (0,), (0, n), (0,)), ((), (), (k,), (2,), (0,))
        none = [np.zeros((*shape, lanes)) for shape in (*waves, (), (), (), *others)]
        return cls(None, *none)._replace(radius=np.full(lanes, np.inf), layer=np.full(lanes, 1e-3))


class Cases(NamedTuple):
    """N runs: starts (n, N), and what acts on each of them."""

    start: Array
    h: Disturbance

    def of(self, lanes: NDArray[np.intp]) -> Cases:
        """Some of them, given by their numbers."""
        return Cases(self.start[:, lanes], self.h.of(lanes))


Batch: TypeAlias = tuple[LoopProblem, Cases]  # runs of a loop


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """N runs at K output times.

    `t` (K,), `x_plan` (K, n), `u_plan` (K, m). What was seen is an attribute, too, with the lanes first: x, x - x* =
    `off`, x' = `slope` and `xtilde` (N, K, n), `k`, `u_a`, `sigma_hat`, `h` and u = u* + k + u_a (N, K, m), `distance`
    (N, K), the Riemannian d(x*, x). A quantity that a loop does not have is 0. Peaks over all steps are in `found`, as
    are the ends of inputs and the errors. After a lane was stopped its values are nan.
    """

    t: Array
    x_plan: Array
    u_plan: Array
    found: Found

    def __getattr__(self, name: str) -> Array:
        if name == "found" or name not in self.found.seen:
            raise AttributeError(name)
        return np.moveaxis(self.found.seen[name], -1, 0)

    @property
    def error(self) -> Array:
        """Of the integration, in |S x|, (N,)."""
        return self.found.error

    def with_only(self, names: Sequence[str]) -> Runs:
        """The same without what else was seen: many of them fit into memory."""
        seen = {name: self.found.seen[name] for name in names}
        return replace(self, found=self.found._replace(seen=seen))


def joined(parts: Sequence[Runs]) -> Runs:
    """Runs at the same times, one after the other; lanes are numbered through."""
    found = combined([part.found for part in parts], lambda *each: np.concatenate(each, axis=-1))
    return replace(parts[0], found=found)
